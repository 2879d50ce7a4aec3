//! Two effects at once, where no single one helps.
//!
//! Two effects that pull the same phase about, each its own way over colours, can leave a residual that neither
//! of them predicts alone: a fit of one takes up part of the other, and fails on captures left out. Such a pair is
//! taken only if the two together leave next to nothing.

use super::fit::{Fit, Problem};
use super::forward::{Candidate, Tried, starts};
use super::heldout::{HeldOut, held_out, mean};
use super::placebo::placebo_gain;
use super::signature::screen_pairs;
use crate::error::Result;
use crate::progress::Progress;

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
    pub fit: Fit,
    pub held: HeldOut,
    /// The problem where the fit rests.
    pub problem: Problem<'a>,
    /// Effects of all pairs that were fitted.
    pub runners: Vec<usize>,
}

/// A pair that explains what is left on top of `chosen`, if one does. With `exact`, it is brought to rest on exact
/// simulations.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn couple<'a>(
    problem: &Problem<'a>,
    chosen: &[usize],
    now: &Fit,
    held_now: &HeldOut,
    exact: bool,
    progress: &dyn Progress,
) -> Result<Option<Couple<'a>>> {
    let above_noise = mean(held_now) - 1.0;
    let mut fits = Vec::new();
    for (pair, score) in screen_pairs(problem, now, chosen).into_iter().take(FITTED) {
        let both = chosen.iter().chain(&pair);
        let active: Vec<usize> = both.flat_map(|&e| problem.simulator.slots_of(e)).collect();
        let firsts = starts(problem, pair[0], now);
        let all = firsts.iter().flat_map(|start| starts(problem, pair[1], start));
        let fit = all
            .map(|from| problem.fit(&active, &from))
            .min_by(|a, b| a.chi2.total_cmp(&b.chi2));
        if let Some(fit) = fit {
            let held = held_out(problem, &fit.forms, &fit);
            fits.push((pair, score, fit, mean(&held)));
        }
    }
    let mut runners: Vec<usize> = fits.iter().flat_map(|f| f.0).collect();
    runners.sort_unstable();
    runners.dedup();
    fits.sort_by(|a, b| a.3.total_cmp(&b.3));
    fits.retain(|f| f.3 - 1.0 < PROMISING * above_noise);
    for (pair, score, mut fit, _) in fits.into_iter().take(SETTLED) {
        let mut own = problem.branch();
        if exact {
            fit = own.stretch(fit, progress)?;
            fit = own.settle(fit, progress)?;
        }
        let held = held_out(&own, &fit.forms, &fit);
        let both = pair.map(|effect| {
            let mut candidate = Candidate::new(effect, score);
            candidate.judge(&own, fit.clone(), held_now);
            candidate
        });
        let whole = mean(&held) - 1.0 < LEAST_LEFT.max(MAY_LEAVE * above_noise);
        let sound = both.iter().all(|c| c.fault(&own, held_now).is_none());
        let numbers = fit.active.len() - now.active.len();
        let gain = mean(held_now) - mean(&held);
        if whole && sound && gain > placebo_gain(problem, now, held_now, numbers) {
            // Others that do as well in the place of either are found by their rivalry.
            return Ok(Some(Couple {
                tried: both.map(|c| Tried {
                    rejected: None,
                    ..c.tried
                }),
                fit,
                held,
                problem: own,
                runners,
            }));
        }
    }
    Ok(None)
}
