//! What else would explain as much, and what has become needless.

use crate::fit::cross_validation::{HeldOutErrors, gain, half_widths, held_out, mean};
use crate::fit::problem::Fit;
use crate::search::state::SearchState;
use crate::search::stepwise::{LEAST_GAIN, physical};
use metalith_core::{Progress, Result};

/// Chi-square of the SEM's widths by which one explanation must fit better to speak for it.
const SEM_SPEAKS: f64 = 9.0;

/// Errors on captures left out that differ by more than this are not alike, however wide the interval.
const ALIKE_WITHIN: f64 = 0.02;

/// An explanation that leaves so much more on the atlas, as a part of what the best takes away, is not brought
/// to rest to be compared.
const WORTH_SETTLING: f64 = 0.1;

/// Another effect that explains as much.
#[derive(Clone, Debug)]
pub struct Alternative {
    pub effect: usize,
    pub values: Vec<f64>,
    pub half_widths: Vec<f64>,
}

/// Drop what the others have made needless, with its runners.
pub fn drop_redundant(now: &mut SearchState<'_>, chosen: &mut Vec<usize>, runners: &mut Vec<Vec<usize>>) {
    let mut place = 0;
    while chosen.len() > 1 && place < chosen.len() {
        let rest: Vec<usize> = chosen.iter().copied().filter(|&e| e != chosen[place]).collect();
        let fit = refit(now, chosen[place], &rest);
        let held = held_out(&now.problem, &fit.forms, &fit);
        let (loss, [low, _]) = gain(&now.problem, &held, &now.held);
        if loss < LEAST_GAIN || low <= 0.0 {
            *chosen = rest;
            runners.remove(place);
            (now.fit, now.held) = (fit, held);
            place = 0;
        } else {
            place += 1;
        }
    }
}

/// For each effect found: the others that would do as well in its place. Where one does better, or the SEM's
/// widths prefer it among those that captures do not tell apart, it takes the place. `before` is the error when
/// nothing was found; with `exact`, rivals are brought to rest on exact simulations.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn alternatives(
    now: &mut SearchState<'_>,
    chosen: &mut [usize],
    runners: &[Vec<usize>],
    before: &HeldOutErrors,
    exact: bool,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Alternative>>> {
    let mut out = Vec::new();
    for place in 0..chosen.len() {
        // Where something is left, whoever was screened out early may be who was there.
        let all: Vec<usize> = (0..now.problem.simulator.effects.len()).collect();
        let runners = if now.error() > 1.0 + ALIKE_WITHIN {
            Some(&all)
        } else {
            runners.get(place)
        };
        let far = mean(before) - now.error();
        let mut best = Substitute {
            effect: chosen[place],
            standing: now.clone(),
        };
        let mut others = Vec::new();
        for &other in runners.into_iter().flatten().filter(|o| !chosen.contains(o)) {
            let mut set = chosen.to_vec();
            set[place] = other;
            let mut rival = Substitute::new(now, chosen[place], other, &set);
            let behind = rival.standing.error() - now.error();
            if behind > ALIKE_WITHIN.max(WORTH_SETTLING * far) || !rival.physical() {
                continue;
            }
            if exact {
                rival.standing.refine(progress)?;
            }
            others.push(rival);
        }
        for other in &mut others {
            if other.beats(&best) {
                std::mem::swap(other, &mut best);
            }
        }
        others.retain(|o| o.is_as_good(&best) && o.sem_chi2() - best.sem_chi2() <= SEM_SPEAKS);
        out.push(others.iter().map(Alternative::new).collect());
        chosen[place] = best.effect;
        *now = best.standing;
    }
    Ok(out)
}

/// The fit of a set of effects when one is `gone`.
fn refit(now: &SearchState<'_>, gone: usize, set: &[usize]) -> Fit {
    let simulator = now.problem.simulator;
    let mut from = now.fit.clone();
    for s in simulator.slots_of(gone) {
        from.theta[s] = 0.0;
    }
    now.problem.fit(&simulator.slots_of_all(set), &from)
}

/// An explanation with a certain effect in the place of one that was found.
struct Substitute<'a> {
    effect: usize,
    standing: SearchState<'a>,
}

impl<'a> Substitute<'a> {
    /// With an effect in the place of one that is `gone`, which makes `set` the whole.
    fn new(now: &SearchState<'a>, gone: usize, effect: usize, set: &[usize]) -> Self {
        Self {
            effect,
            standing: SearchState::new(now.problem.clone(), refit(now, gone, set)),
        }
    }

    fn physical(&self) -> bool {
        let SearchState { problem, fit, .. } = &self.standing;
        physical(problem, fit, &problem.simulator.slots_of(self.effect))
    }

    /// Chi-square of the SEM's widths.
    fn sem_chi2(&self) -> f64 {
        let form = &self.standing.fit.forms[self.standing.problem.used.len()];
        form[(form.nrows() - 1, form.nrows() - 1)]
    }

    /// Whether captures left out do not tell it apart from the best.
    fn is_as_good(&self, best: &Self) -> bool {
        let (own, best) = (&self.standing, &best.standing);
        let (worse, [low, _]) = gain(&own.problem, &own.held, &best.held);
        (worse < LEAST_GAIN || low <= 0.0) && own.error() < best.error() + ALIKE_WITHIN
    }

    fn beats(&self, best: &Self) -> bool {
        let problem = &self.standing.problem;
        let (better, [low, _]) = gain(problem, &best.standing.held, &self.standing.held);
        let by_sem = best.sem_chi2() - self.sem_chi2();
        better >= LEAST_GAIN && low > 0.0 && by_sem > -SEM_SPEAKS || self.is_as_good(best) && by_sem > SEM_SPEAKS
    }
}

impl Alternative {
    fn new(rival: &Substitute<'_>) -> Self {
        let SearchState { problem, fit, .. } = &rival.standing;
        let widths = half_widths(problem, fit);
        let own = problem.simulator.slots_of(rival.effect);
        Self {
            effect: rival.effect,
            values: own.iter().map(|&s| fit.theta[s]).collect(),
            half_widths: fit.pick(&own, &widths),
        }
    }
}
