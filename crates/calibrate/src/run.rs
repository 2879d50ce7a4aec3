//! A whole calibration: set in, diagnosis, report and model file out.

use std::path::{Path, PathBuf};

use crate::boundary_search::search_about_boundaries;
use crate::diagnosis::{Diagnosis, Proposal};
use crate::effects::{self, DeclaredEffect};
use crate::page::write_page;
use crate::proposal::{Proposed, propose};
use crate::session::{Session, Settings, Simulations, check_effects};
use crate::set::MeasuredSet;
use crate::statistics::{Evidence, LEAST_GAIN};
use crate::whole_progress::WholeProgress;
use metalith_core::{AtomicFile, FolderLock, Progress, Result};
use metalith_optics::CalibratedModel;
use metalith_pillars::PillarReader;

/// The file of the calibrated model, in the folder of the answers.
const MODEL: &str = "model.toml";

/// The file of effects that are proposed, there.
const PROPOSAL: &str = "proposal.toml";

/// The files of a calibration.
#[derive(Clone, Debug)]
pub struct Calibration {
    pub diagnosis: Diagnosis,
    /// `diagnosis.json`.
    pub answer: PathBuf,
    /// `report.html`.
    pub report: PathBuf,
    /// `model.toml`; none where the residual is unexplained or the measurements cannot be used.
    pub model: Option<PathBuf>,
}

/// Read the sets at `paths`, find what the model lacks, and write diagnosis, report and model of each to its
/// folder of `outs`. Sessions of one plan share their simulations. `layouts` reads the layouts that the sets name.
///
/// # Errors
/// Every fault of a set at once, and all unknown names of effects; else if a cell cannot be solved, a file
/// cannot be written, or the user stopped it.
pub fn calibrate(
    paths: &[PathBuf],
    outs: &[PathBuf],
    settings: &Settings,
    layouts: &dyn PillarReader,
    outer: &dyn Progress,
) -> Result<Vec<Calibration>> {
    let sets = paths
        .iter()
        .map(|p| MeasuredSet::read(p, layouts, outer))
        .collect::<Result<Vec<_>>>()?;
    for set in &sets {
        check_effects(&effects::with_declared(set, &settings.declared)?, &settings.only)?;
    }
    let mut known: Option<(usize, Simulations)> = None;
    let mut done = Vec::new();
    for (place, (set, out)) in sets.iter().zip(outs).enumerate() {
        let session = Session::new(set, settings.clone())?;
        let (simulations, tables) = session.planned();
        let progress = &WholeProgress::new(outer, simulations + IN_A_SEARCH, tables);
        let shared = known.take().filter(|(other, _)| sets[*other].same_plan(set));
        let (other, simulations) = match shared {
            Some(known) => known,
            None => (place, session.simulate(progress)?),
        };
        session.simulator.work.restart();
        let conclude = |session: &Session<'_>, simulations: &Simulations, found| {
            conclude(session, simulations, found, out, progress)
        };
        done.push(search_about_boundaries(&session, &simulations, &conclude, progress)?);
        known = Some((other, simulations));
    }
    Ok(done)
}

/// Simulations of a search that finds an effect or two, about: for the progress alone.
const IN_A_SEARCH: usize = 100;

/// Rounds in which the residual is searched for further effects where these are adopted: a strong one hides a weak one.
const ADOPTIONS: usize = 2;

/// Propose effects for the residual, adopt them if that is wanted and explains more, and write the answer.
///
/// # Errors
/// As [`calibrate`].
fn conclude(
    session: &Session<'_>,
    simulations: &Simulations,
    (mut diagnosis, mut evidence): (Diagnosis, Option<Evidence>),
    out: &Path,
    progress: &dyn Progress,
) -> Result<Calibration> {
    let _turn = FolderLock::wait(out, progress, || {
        progress.warn("another run writes into this folder: waiting for it");
    })?;
    // This run may find none, and those of another must not stand beside its answer.
    AtomicFile::discard(&out.join(MODEL))?;
    let file = out.join(PROPOSAL);
    AtomicFile::discard(&file)?;
    let mut proposed: Vec<Proposed> = Vec::new();
    let mut adopted: Option<(Session<'_>, Simulations)> = None;
    let without = diagnosis.error.after.held_out;
    for _ in 0..ADOPTIONS {
        let (session, simulations) = adopted.as_ref().map_or((session, simulations), |(a, b)| (a, b));
        let next = match &evidence {
            Some(evidence) if diagnosis.verdict.leaves_a_residual() => propose(session, evidence, progress)?,
            _ => Vec::new(),
        };
        if next.is_empty() {
            break;
        }
        let effects: Vec<DeclaredEffect> = next.iter().map(|p| p.effect.clone()).collect();
        proposed.extend(next);
        if !session.settings.adopt || session.simulator.work.is_spent() {
            break;
        }
        let wider = session.adopting(effects)?;
        let about_found = evidence.as_ref().map(|e| &e.finding.surrogate);
        let wider_simulations = wider.simulate_beyond((session, simulations), about_found, progress)?;
        let found = wider.diagnose(&wider_simulations, progress)?;
        if found.0.error.after.held_out > diagnosis.error.after.held_out - LEAST_GAIN {
            break;
        }
        (diagnosis, evidence) = found;
        adopted = Some((wider, wider_simulations));
    }
    if !proposed.is_empty() {
        let effects: Vec<DeclaredEffect> = proposed.iter().map(|p| p.effect.clone()).collect();
        AtomicFile::write(&file, DeclaredEffect::text(&effects).as_bytes())?;
        let reason = |p: &Proposed| format!("`{}`: {}", p.effect.name, p.reason);
        diagnosis.proposal = Some(Proposal {
            file: file.display().to_string(),
            effects: effects.into_iter().map(|e| e.name).collect(),
            reasons: proposed.iter().map(reason).collect(),
            held_out_without: adopted.is_some().then_some(without),
        });
    }
    let (session, simulations) = adopted.as_ref().map_or((session, simulations), |(a, b)| (a, b));
    write(session, simulations, diagnosis, evidence, out)
}

/// Write diagnosis, report and model.
fn write(
    session: &Session<'_>,
    simulations: &Simulations,
    diagnosis: Diagnosis,
    evidence: Option<Evidence>,
    out: &Path,
) -> Result<Calibration> {
    let answer = out.join("diagnosis.json");
    let report = out.join("report.html");
    diagnosis.write(&answer)?;
    write_page(&report, session, simulations, &diagnosis, evidence.as_ref())?;
    let has_a_model = diagnosis.verdict.has_a_model();
    let model = match evidence.filter(|_| has_a_model) {
        None => None,
        Some(evidence) => {
            let perturbation = session.simulator.perturbation(&evidence.finding.after.theta);
            let path = out.join(MODEL);
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
