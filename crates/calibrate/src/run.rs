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

/// The files of the answer and of its page, in the folder of the answers.
const ANSWER: &str = "diagnosis.json";
const REPORT: &str = "report.html";

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
    let mut proposal = None;
    if !proposed.is_empty() {
        let effects: Vec<DeclaredEffect> = proposed.iter().map(|p| p.effect.clone()).collect();
        proposal = Some(DeclaredEffect::text(&effects));
        let reason = |p: &Proposed| format!("`{}`: {}", p.effect.name, p.reason);
        diagnosis.proposal = Some(Proposal {
            file: out.join(PROPOSAL).display().to_string(),
            effects: effects.into_iter().map(|e| e.name).collect(),
            reasons: proposed.iter().map(reason).collect(),
            held_out_without: adopted.is_some().then_some(without),
        });
    }
    let (session, simulations) = adopted.as_ref().map_or((session, simulations), |(a, b)| (a, b));
    let turn = FolderLock::wait(out, progress, || {
        progress.warn("another run writes into this folder: waiting for it");
    })?;
    let inputs = session.set().inputs();
    let turn = turn.keeping(inputs.iter().map(PathBuf::as_path));
    write(session, simulations, diagnosis, (evidence, proposal), &turn)
}

/// Write diagnosis, report, model and proposal. There may be no model or no proposal, and those of an earlier run must not stand beside
/// the answer.
fn write(
    session: &Session<'_>,
    simulations: &Simulations,
    diagnosis: Diagnosis,
    (evidence, proposal): (Option<Evidence>, Option<String>),
    turn: &FolderLock,
) -> Result<Calibration> {
    let evidence = evidence.as_ref();
    let model = evidence.filter(|_| diagnosis.verdict.has_a_model()).map(|evidence| {
        let perturbation = session.simulator.perturbation(&evidence.finding.after.theta);
        CalibratedModel::new(diagnosis.set.clone(), diagnosis.sentence(), perturbation)
    });
    turn.publish("calibration", &[MODEL, PROPOSAL], |folder| {
        diagnosis.write(&folder.join(ANSWER))?;
        write_page(&folder.join(REPORT), session, simulations, &diagnosis, evidence)?;
        if let Some(text) = &proposal {
            AtomicFile::write(&folder.join(PROPOSAL), text.as_bytes())?;
        }
        model.as_ref().map_or(Ok(()), |model| model.write(&folder.join(MODEL)))
    })?;
    let out = turn.folder();
    Ok(Calibration {
        diagnosis,
        answer: out.join(ANSWER),
        report: out.join(REPORT),
        model: model.map(|_| out.join(MODEL)),
    })
}
