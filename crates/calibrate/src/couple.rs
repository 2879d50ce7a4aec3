//! Two effects at once, where no single one helps.
//!
//! Two effects that pull the same phase about, each its own way over colours, can leave a residual that neither
//! of them predicts alone: a fit of one takes up part of the other, and fails on captures left out. Such a pair is
//! taken only if the two together leave next to nothing.

use super::forward::{Candidate, Tried, fit_with};
use super::heldout::{held_out, mean};
use super::placebo::placebo_gain;
use super::signature::screen_pairs;
use super::standing::Standing;
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
pub struct Couple<'a> {
    pub tried: [Tried; 2],
    pub standing: Standing<'a>,
    /// Effects of all pairs that were fitted.
    pub runners: Vec<usize>,
}

/// A pair that explains what is left on top of `chosen`, if one does. With `exact`, it is brought to rest on exact
/// simulations.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn couple<'a>(
    now: &Standing<'a>,
    chosen: &[usize],
    exact: bool,
    progress: &dyn Progress,
) -> Result<Option<Couple<'a>>> {
    let problem = &now.problem;
    let above_noise = now.error() - 1.0;
    let mut fits = Vec::new();
    for (pair, score) in screen_pairs(problem, &now.fit, chosen).into_iter().take(FITTED) {
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
        let mut standing = Standing { problem, fit, held };
        if exact {
            standing.settle(progress)?;
        }
        let both = pair.map(|effect| {
            let mut candidate = Candidate::new(effect, score);
            let Standing { problem, fit, held } = &standing;
            candidate.judge(problem, fit.clone(), held.clone(), &now.held);
            candidate
        });
        let whole = standing.error() - 1.0 < LEAST_LEFT.max(MAY_LEAVE * above_noise);
        let sound = both.iter().all(|c| c.fault(&standing.problem, &now.held).is_none());
        let numbers = standing.fit.active.len() - now.fit.active.len();
        let gain = now.error() - standing.error();
        if whole && sound && gain > placebo_gain(&now.problem, &now.fit, &now.held, numbers) {
            // Others that do as well in the place of either are found by their rivalry.
            return Ok(Some(Couple {
                tried: both.map(|c| Tried {
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
