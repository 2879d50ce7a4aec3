//! The search on a set whose lab does not say where write fields meet: about a boundary too, where one would explain what effects
//! of the list leave.

use std::cell::{Cell, RefCell};

use crate::diagnosis::Diagnosis;
use crate::effects::StitchedFields;
use crate::proposal::{FieldBoundary, WORTH_PROPOSING, boundary_of_fields};
use crate::session::{Session, Simulations};
use crate::set::MeasuredSet;
use crate::statistics::{Evidence, SearchState, Surrogate};
use metalith_core::{Progress, Result};

/// Share of the error above noise that a boundary must remove for it to be tried before pairs of other effects are.
const ENDS_THE_SEARCH: f64 = 0.6;

/// Times that a boundary is looked for while effects of the list are added: it takes some forty simulations.
const MOST_ASKED: usize = 2;

/// Searches about the place of a boundary after the list was searched whole: the second about that which the first found, where
/// much is left.
const ROUNDS: usize = 2;

/// An answer, with its evidence where there was enough to search in.
pub(crate) type Found = (Diagnosis, Option<Evidence>);

/// Result that is made of an answer and of its session.
type Conclude<'c, T> = dyn Fn(&Session<'_>, &Simulations, Found) -> Result<T> + 'c;

/// Diagnose a session with its simulations, and conclude: about a boundary where one is found that nobody stated.
///
/// # Errors
/// If a cell cannot be solved, the user stopped it, or as `conclude` says.
pub(crate) fn search_about_boundaries<T>(
    session: &Session<'_>,
    simulations: &Simulations,
    conclude: &Conclude<'_, T>,
    progress: &dyn Progress,
) -> Result<T> {
    if session.set().field_boundary_um.is_some() || !session.settings.only.is_empty() {
        return conclude(session, simulations, session.diagnose(simulations, progress)?);
    }
    let (early, asked) = (RefCell::new(None), Cell::new(0));
    let ends = |now: &SearchState<'_>| -> Result<bool> {
        asked.set(asked.get() + 1);
        if asked.get() > MOST_ASKED || session.simulator.work.is_spent() {
            return Ok(false);
        }
        let boundary = boundary_of_fields(session, &now.problem, &now.fit, progress)?;
        tell(&boundary, progress);
        let ends = boundary.removes > ENDS_THE_SEARCH;
        if ends {
            early.replace(Some((boundary.at_um, now.problem.surrogate.clone())));
        }
        Ok(ends)
    };
    let mut found = session.diagnose_unless(Some(&ends), simulations, progress)?;
    if let Some((at_um, found_so_far)) = early.take() {
        let set = with_boundary(session.set(), at_um);
        let (wider, simulations_there, own) = search(&set, (session, simulations), Some(&found_so_far), progress)?;
        let explains = boundary_found(&own.0, &set).is_some() && !own.0.verdict.leaves_a_residual();
        // Where no more may be simulated it is the best that there is.
        if explains || wider.simulator.work.is_spent() {
            return conclude(&wider, &simulations_there, own);
        }
        // It does not explain all: what else may be is tried first.
        found = session.diagnose(simulations, progress)?;
    }
    let place = late_boundary(session, &found, progress)?;
    let start = (session, simulations);
    about(
        (place, ROUNDS),
        start,
        (session, simulations, found),
        conclude,
        progress,
    )
}

/// Search a set as stated about a place of a boundary, if there is one, at most so many times, and conclude by the last search that
/// found a boundary; by what was found before, if none did.
fn about<T>(
    (place, rounds): (Option<[f64; 2]>, usize),
    stated: (&Session<'_>, &Simulations),
    (session, simulations, found): (&Session<'_>, &Simulations, Found),
    conclude: &Conclude<'_, T>,
    progress: &dyn Progress,
) -> Result<T> {
    let Some(at_um) = place.filter(|_| rounds > 0 && !session.simulator.work.is_spent()) else {
        return conclude(session, simulations, found);
    };
    let set = with_boundary(session.set(), at_um);
    let (wider, simulations_there, own) = search(&set, stated, None, progress)?;
    let Some(place) = boundary_found(&own.0, &set) else {
        return conclude(session, simulations, found);
    };
    let next = own.0.verdict.leaves_a_residual().then_some(place);
    let found = (&wider, &simulations_there, own);
    about((next, rounds - 1), stated, found, conclude, progress)
}

/// Say what a boundary would do.
fn tell(boundary: &FieldBoundary, progress: &dyn Progress) {
    let [x, y] = boundary.at_um;
    progress.note(&format!(
        "write fields that meet at x = {x:.1} um or y = {y:.1} um of every lens would explain {:.0} % of the residual",
        100.0 * boundary.removes
    ));
}

/// A session on a set like another, but for the boundary, its simulations and its answer; with the surrogate of a search of the other
/// about what it found, if there is one.
fn search<'s>(
    set: &'s MeasuredSet,
    (like, known): (&Session<'_>, &Simulations),
    found: Option<&Surrogate>,
    progress: &dyn Progress,
) -> Result<(Session<'s>, Simulations, Found)> {
    let mut session = Session::new(set, like.settings.clone())?;
    session.simulator.work = like.simulator.work.clone();
    let simulations = session.simulate_beyond((like, known), found, progress)?;
    let found = session.diagnose(&simulations, progress)?;
    Ok((session, simulations, found))
}

/// The set, as if the lab said that write fields meet there.
fn with_boundary(set: &MeasuredSet, at_um: [f64; 2]) -> MeasuredSet {
    MeasuredSet {
        field_boundary_um: Some(at_um),
        ..set.clone()
    }
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

/// The place of a boundary that would explain much of what a whole search leaves.
fn late_boundary(
    session: &Session<'_>,
    (diagnosis, evidence): &Found,
    progress: &dyn Progress,
) -> Result<Option<[f64; 2]>> {
    let is_open = diagnosis.verdict.leaves_a_residual() && !session.simulator.work.is_spent();
    let Some(evidence) = evidence.as_ref().filter(|_| is_open) else {
        return Ok(None);
    };
    let problem = evidence.problem(&session.simulator);
    let boundary = boundary_of_fields(session, &problem, &evidence.finding.after, progress)?;
    tell(&boundary, progress);
    Ok((boundary.removes > WORTH_PROPOSING).then_some(boundary.at_um))
}
