//! Pair search: two effects at once, where no single one helps.
//!
//! Two effects that change the same phase, each with its own dependence on colour, can leave a residual that
//! neither predicts alone: a fit of one absorbs part of the other and fails on measurements left out. A pair is
//! taken only if both together leave next to nothing.

use metalith_core::{Progress, Result};

use super::residual::LEAST_GAIN;
use super::signatures::score_pairs;
use super::state::{MORE_IS_LEFT, SearchState};
use super::stepwise::{Candidate, TriedEffect, fit_with};
use crate::fit::{Fit, change_energy, held_out, mean_error, null_gain};
use crate::measurements::Measurements;

/// Pairs that are fitted on the surrogate.
const FITTED: usize = 16;

/// Those of them that are refined with full simulations.
const REFINED: usize = 4;

/// Share of the error above noise that a pair may leave on the surrogate, where effects merely add, to be refined.
const PROMISING: f64 = 0.25;

/// Share of the error above noise that it may leave in the end.
const MAY_LEAVE: f64 = 0.05;

/// And the reduced chi-square per point that it may leave where the error is small.
pub(crate) const LEAST_LEFT: f64 = 0.05;

/// Effects that explain a residual together, or one that only a surrogate about its own fit shows.
pub(crate) struct FoundTogether<'a, M: Measurements> {
    pub tried: Vec<TriedEffect>,
    pub state: SearchState<'a, M>,
    /// All effects that were fitted.
    pub runners_up: Vec<usize>,
}

/// The pair that explains most of the residual on top of those in `chosen`, if one explains all but little. With `full`, pairs are
/// refined with full simulations before they are compared.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub(crate) fn find_pair<'a, M: Measurements>(
    now: &SearchState<'a, M>,
    chosen: &[usize],
    full: bool,
    progress: &dyn Progress,
) -> Result<Option<FoundTogether<'a, M>>> {
    let problem = &now.problem;
    let above_noise = now.error() - 1.0;
    let mut fits = Vec::new();
    for (pair, score) in score_pairs(problem, &now.fit, chosen).into_iter().take(FITTED) {
        if let Some(fit) = fit_with(problem, &now.fit, chosen, &pair) {
            let held = held_out(problem, &fit.equations, &fit);
            fits.push((pair, score, fit, held));
        }
    }
    let mut runners_up: Vec<usize> = fits.iter().flat_map(|f| f.0).collect();
    runners_up.sort_unstable();
    runners_up.dedup();
    fits.sort_by(|a, b| mean_error(&a.3).total_cmp(&mean_error(&b.3)));
    fits.retain(|f| mean_error(&f.3) - 1.0 < PROMISING * above_noise);
    // On the surrogate, where effects merely add, the wrong pair may leave less: all are brought to rest before one is taken, the
    // dear ones last, and only if the others leave more than the model may err by.
    fits.truncate(REFINED);
    let is_dear = |pair: &[usize], fit: &Fit<M>| {
        let slots = problem.model.slots_of_all(pair);
        slots.iter().any(|&s| problem.model.is_dear_beside(&fit.theta, s))
    };
    fits.sort_by_key(|(pair, _, fit, _)| is_dear(pair, fit));
    let mut best: Option<FoundTogether<'a, M>> = None;
    for (pair, score, fit, held) in fits {
        if problem.model.is_spent() {
            break;
        }
        let may_leave = |found: &FoundTogether<'_, M>| {
            let FoundTogether { state, .. } = found;
            let of_model = change_energy(&state.problem, &state.fit) / state.problem.points().max(1.0);
            LEAST_GAIN + if is_dear(&pair, &fit) { of_model } else { 0.0 }
        };
        if best
            .as_ref()
            .is_some_and(|found| found.state.error() < 1.0 + may_leave(found))
        {
            break;
        }
        let problem = problem.clone();
        let mut state = SearchState {
            problem,
            fit,
            held_out: held,
        };
        if full {
            state.refine(progress)?;
            if state.leaves_more_than(MORE_IS_LEFT) {
                // What one changes beside the other: without it the fit rests where less may be left close by.
                state.recentre(progress)?;
                state.refine(progress)?;
            }
        }
        let is_better = best.as_ref().is_none_or(|b| state.error() < b.state.error());
        if is_better && let Some(tried) = sound(now, &state, &pair.map(|effect| (effect, score))) {
            best = Some(FoundTogether {
                tried,
                state,
                // Effects that explain as much in the place of either are found as alternatives.
                runners_up: runners_up.clone(),
            });
        }
    }
    Ok(best)
}

/// Effects as they were tried, each with its score, if all are sound and together leave next to nothing of what `now` leaves.
pub(crate) fn sound<M: Measurements>(
    now: &SearchState<'_, M>,
    state: &SearchState<'_, M>,
    effects: &[(usize, f64)],
) -> Option<Vec<TriedEffect>> {
    let SearchState { problem, fit, held_out } = state;
    let candidates = effects.iter().map(|(effect, score)| {
        let mut candidate = Candidate::new(*effect, *score);
        candidate.judge(problem, fit.clone(), held_out.clone(), &now.held_out);
        candidate
    });
    let candidates: Vec<Candidate<M>> = candidates.collect();
    let is_whole = state.error() - 1.0 < LEAST_LEFT.max(MAY_LEAVE * (now.error() - 1.0));
    let is_sound = candidates.iter().all(|c| c.fault(problem, &now.held_out).is_none());
    let parameters = fit.active.len() - now.fit.active.len();
    let gain = now.error() - state.error();
    let is_found = is_whole && is_sound && gain > null_gain(&now.problem, &now.fit, &now.held_out, parameters);
    is_found.then(|| {
        let tried = candidates.into_iter().map(|c| TriedEffect {
            rejected: None,
            ..c.tried
        });
        tried.collect()
    })
}
