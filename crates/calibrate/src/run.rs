//! A whole calibration: set in, diagnosis, report and model file out.

use std::path::{Path, PathBuf};

use crate::diagnosis::{Diagnosis, Proposal, SetVerdict};
use crate::effects::{self, DeclaredEffect, StitchedFields};
use crate::page::write_page;
use crate::proposal::{boundary_of_fields, propose};
use crate::search::Evidence;
use crate::session::{Session, Settings, Simulations, check_effects};
use crate::set::MeasuredSet;
use metalith_core::{FolderTurn, PillarReader, Progress, Result, WholeFile};
use metalith_made::CalibratedModel;

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
    /// `model.toml`; none where the residual is unexplained or the captures cannot be used.
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
    progress: &dyn Progress,
) -> Result<Vec<Calibration>> {
    let sets = paths
        .iter()
        .map(|p| MeasuredSet::read(p, layouts, progress))
        .collect::<Result<Vec<_>>>()?;
    for set in &sets {
        check_effects(&effects::with_declared(set, &settings.declared)?, &settings.only)?;
    }
    let mut known: Option<(usize, Simulations)> = None;
    let mut done = Vec::new();
    for (place, (set, out)) in sets.iter().zip(outs).enumerate() {
        let session = Session::new(set, settings.clone())?;
        let shared = known.take().filter(|(other, _)| sets[*other].same_plan(set));
        let (other, simulations) = match shared {
            Some(known) => known,
            None => (place, session.simulate(progress)?),
        };
        done.push(finish(&session, &simulations, out, progress)?);
        known = Some((other, simulations));
    }
    Ok(done)
}

/// Diagnose a session with its simulations, look for what the list leaves, and write the answer.
///
/// # Errors
/// As [`calibrate`].
fn finish(
    session: &Session<'_>,
    simulations: &Simulations,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Calibration> {
    let found = session.diagnose(simulations, progress)?;
    let set = with_boundary(session, &found, progress)?;
    about_boundary((session, simulations), found, (set, BOUNDARY_ROUNDS), out, progress)
}

/// Searches about the place of a boundary: the second about that which the first found, where much is left.
const BOUNDARY_ROUNDS: usize = 2;

/// Search a set with a place of a boundary, if there is one, at most so many times, and conclude by the last search that found
/// a boundary; by what was found before, if none did.
fn about_boundary(
    (session, simulations): (&Session<'_>, &Simulations),
    found: (Diagnosis, Option<Evidence>),
    (set, rounds): (Option<MeasuredSet>, usize),
    out: &Path,
    progress: &dyn Progress,
) -> Result<Calibration> {
    let Some(set) = set.filter(|_| rounds > 0) else {
        return conclude(session, simulations, found, out, progress);
    };
    let wider = Session::new(&set, session.settings.clone())?;
    let wider_simulations = wider.simulate(progress)?;
    let own = wider.diagnose(&wider_simulations, progress)?;
    let Some(place) = boundary_found(&own.0, &set) else {
        return conclude(session, simulations, found, out, progress);
    };
    let next = own.0.verdict.leaves_a_residual().then(|| MeasuredSet {
        field_boundary_um: Some(place),
        ..set.clone()
    });
    about_boundary((&wider, &wider_simulations), own, (next, rounds - 1), out, progress)
}

/// Where a diagnosis of a set found boundaries, across x and across y (um), that of the set where it found none; none if it found
/// neither.
fn boundary_found(diagnosis: &Diagnosis, set: &MeasuredSet) -> Option<[f64; 2]> {
    let own = |name| {
        let effect = diagnosis.effects.iter().find(|e| e.name == name)?;
        Some(effect.numbers().get(StitchedFields::PLACE)?.0)
    };
    let found = StitchedFields::NAMES.map(own);
    let stated = set.field_boundary_um?;
    let is_found = found.iter().any(Option::is_some);
    is_found.then(|| [0, 1].map(|axis| found[axis].unwrap_or(stated[axis])))
}

/// The set with a place of a boundary of write fields, where one would explain much of what the list leaves and the lab does not say
/// where such boundaries run.
fn with_boundary(
    session: &Session<'_>,
    (diagnosis, evidence): &(Diagnosis, Option<Evidence>),
    progress: &dyn Progress,
) -> Result<Option<MeasuredSet>> {
    let set = session.set();
    let is_open = diagnosis.verdict.leaves_a_residual() && set.field_boundary_um.is_none();
    let Some(evidence) = evidence
        .as_ref()
        .filter(|_| is_open && session.settings.only.is_empty())
    else {
        return Ok(None);
    };
    let place = boundary_of_fields(session, evidence, progress)?;
    Ok(place.map(|place| MeasuredSet {
        field_boundary_um: Some(place),
        ..set.clone()
    }))
}

/// Propose effects for what is left, adopt them if that is wanted, and write the answer.
///
/// # Errors
/// As [`calibrate`].
fn conclude(
    session: &Session<'_>,
    simulations: &Simulations,
    (mut diagnosis, evidence): (Diagnosis, Option<Evidence>),
    out: &Path,
    progress: &dyn Progress,
) -> Result<Calibration> {
    let _turn = FolderTurn::wait(out, progress, || {
        progress.note("waiting for another run in this folder")
    })?;
    // This run may find none, and those of another must not stand beside its answer.
    WholeFile::discard(&out.join(MODEL))?;
    let file = out.join(PROPOSAL);
    WholeFile::discard(&file)?;
    let proposed = match &evidence {
        Some(evidence) if diagnosis.verdict.leaves_a_residual() => propose(session, evidence, progress)?,
        _ => Vec::new(),
    };
    if proposed.is_empty() {
        return write(session, simulations, diagnosis, evidence, out);
    }
    let reasons: Vec<String> = proposed
        .iter()
        .map(|p| format!("`{}`: {}", p.effect.name, p.reason))
        .collect();
    let proposed: Vec<DeclaredEffect> = proposed.into_iter().map(|p| p.effect).collect();
    WholeFile::write(&file, DeclaredEffect::text(&proposed).as_bytes())?;
    let mut proposal = Proposal {
        file: file.display().to_string(),
        effects: proposed.iter().map(|e| e.name.clone()).collect(),
        reasons,
        held_out_without: None,
    };
    if !session.settings.adopt {
        diagnosis.proposal = Some(proposal);
        return write(session, simulations, diagnosis, evidence, out);
    }
    proposal.held_out_without = Some(diagnosis.error.after.held_out);
    let wider = session.adopting(proposed)?;
    let simulations = wider.simulate(progress)?;
    let (mut diagnosis, evidence) = wider.diagnose(&simulations, progress)?;
    diagnosis.proposal = Some(proposal);
    write(&wider, &simulations, diagnosis, evidence, out)
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
    let learned = matches!(
        diagnosis.verdict,
        SetVerdict::NoResidual | SetVerdict::Explained | SetVerdict::OneOf | SetVerdict::Partly
    );
    let model = match evidence.filter(|_| learned) {
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
