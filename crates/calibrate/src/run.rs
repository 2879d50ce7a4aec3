//! A whole calibration: set in, diagnosis, report and model file out.

use std::path::{Path, PathBuf};

use super::atlas::Atlas;
use super::diagnosis::{Diagnosis, SetVerdict};
use super::page::write_page;
use super::session::{Session, Settings};
use super::set::MeasuredSet;
use metalith_core::{Progress, Result};
use metalith_made::CalibratedModel;

/// What a calibration leaves.
#[derive(Clone, Debug)]
pub struct Calibration {
    pub diagnosis: Diagnosis,
    /// `diagnosis.json`.
    pub answer: PathBuf,
    /// `report.html`.
    pub report: PathBuf,
    /// `model.toml`, where the set has taught something or nothing had to be learned.
    pub model: Option<PathBuf>,
}

/// Read the sets at `paths`, find what the model lacks, and write diagnosis, report and model of each to its
/// folder of `outs`. Sessions that were planned alike share their simulations.
///
/// # Errors
/// Every fault of a set at once; else if a cell cannot be solved, a file cannot be written, or the user
/// stopped it.
pub fn calibrate(
    paths: &[PathBuf],
    outs: &[PathBuf],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Vec<Calibration>> {
    let sets = paths
        .iter()
        .map(|p| MeasuredSet::read(p, progress))
        .collect::<Result<Vec<_>>>()?;
    let mut known: Option<(usize, Atlas)> = None;
    let mut done = Vec::new();
    for (place, (set, out)) in sets.iter().zip(outs).enumerate() {
        let mut session = Session::new(set, settings.clone())?;
        let shared = known.take().filter(|(other, _)| sets[*other].same_plan(set));
        let (other, atlas) = match shared {
            Some(known) => known,
            None => (place, session.atlas(progress)?),
        };
        done.push(finish(&mut session, &atlas, out, progress)?);
        known = Some((other, atlas));
    }
    Ok(done)
}

/// Diagnose a session whose atlas is made, and write what it comes to.
///
/// # Errors
/// As [`calibrate`].
pub fn finish(session: &mut Session<'_>, atlas: &Atlas, out: &Path, progress: &dyn Progress) -> Result<Calibration> {
    let (diagnosis, finding) = session.diagnose(atlas, progress)?;
    let answer = out.join("diagnosis.json");
    let report = out.join("report.html");
    diagnosis.write(&answer)?;
    write_page(&report, session, atlas, &diagnosis, finding.as_ref())?;
    let learned = matches!(
        diagnosis.verdict,
        SetVerdict::NoResidual | SetVerdict::Explained | SetVerdict::OneOf | SetVerdict::Partly
    );
    let model = match finding.filter(|_| learned) {
        None => None,
        Some(finding) => {
            let perturbation = session.simulator.perturbation(&finding.after.theta);
            let path = out.join("model.toml");
            CalibratedModel::new(diagnosis.set.clone(), diagnosis.sentence(), perturbation).write(&path)?;
            Some(path)
        }
    };
    Ok(Calibration {
        diagnosis,
        answer,
        report,
        model,
    })
}
