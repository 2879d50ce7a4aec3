//! Two effects at once, where no single one helps.
//!
//! Two effects that pull the same phase about, each its own way over colours, can leave a residual that neither
//! of them predicts alone: a fit of one takes up part of the other, and fails on captures left out. Such a pair is
//! taken only if the two together leave next to nothing.

use crate::fit::cross_validation::{held_out, mean};
use crate::fit::null_test::null_gain;
use crate::search::signatures::score_pairs;
use crate::search::state::SearchState;
use crate::search::stepwise::{Candidate, TriedEffect, fit_with};
use metalith_core::{Progress, Result};

/// Pairs that are fitted on the atlas.
const FITTED: usize = 16;

/// Those of them that are brought to rest on exact simulations.
const SETTLED: usize = 4;

/// Share of what is above noise that a pair may leave on the atlas, where effects add as they do not quite in
/// life, to be looked at more closely.
const PROMISING: f64 = 0.25;

/// Share of what is above noise that it may leave in the end.
const MAY_LEAVE: f64 = 0.05;

/// And chi-square a pixel that it may leave where there is little.
const LEAST_LEFT: f64 = 0.05;

/// A pair that explains a residual.
pub struct FoundPair<'a> {
    pub tried: [TriedEffect; 2],
    pub standing: SearchState<'a>,
    /// Effects of all pairs that were fitted.
    pub runners: Vec<usize>,
}

/// A pair that explains what is left on top of `chosen`, if one does. With `exact`, it is brought to rest on exact
/// simulations.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn find_pair<'a>(
    now: &SearchState<'a>,
    chosen: &[usize],
    exact: bool,
    progress: &dyn Progress,
) -> Result<Option<FoundPair<'a>>> {
    let problem = &now.problem;
    let above_noise = now.error() - 1.0;
    let mut fits = Vec::new();
    for (pair, score) in score_pairs(problem, &now.fit, chosen).into_iter().take(FITTED) {
        if let Some(fit) = fit_with(problem, &now.fit, chosen, &pair) {
            let held = held_out(problem, &fit.forms, &fit);
            fits.push((pair, score, fit, held));
        }
    }
    let mut runners: Vec<usize> = fits.iter().flat_map(|f| f.0).collect();
    runners.sort_unstable();
    runners.dedup();
    fits.sort_by(|a, b| mean(&a.3).total_cmp(&mean(&b.3)));
    fits.retain(|f| mean(&f.3) - 1.0 < PROMISING * above_noise);
    for (pair, score, fit, held) in fits.into_iter().take(SETTLED) {
        let problem = problem.clone();
        let mut standing = SearchState { problem, fit, held };
        if exact {
            standing.refine(progress)?;
        }
        let both = pair.map(|effect| {
            let mut candidate = Candidate::new(effect, score);
            let SearchState { problem, fit, held } = &standing;
            candidate.judge(problem, fit.clone(), held.clone(), &now.held);
            candidate
        });
        let whole = standing.error() - 1.0 < LEAST_LEFT.max(MAY_LEAVE * above_noise);
        let sound = both.iter().all(|c| c.fault(&standing.problem, &now.held).is_none());
        let numbers = standing.fit.active.len() - now.fit.active.len();
        let gain = now.error() - standing.error();
        if whole && sound && gain > null_gain(&now.problem, &now.fit, &now.held, numbers) {
            // Others that do as well in the place of either are found by their rivalry.
            return Ok(Some(FoundPair {
                tried: both.map(|c| TriedEffect {
                    rejected: None,
                    ..c.tried
                }),
                standing,
                runners,
            }));
        }
    }
    Ok(None)
}
