//! Alternatives: what else would explain as much, and what has become redundant.

use metalith_core::{Progress, Result};

use super::residual::LEAST_GAIN;
use super::state::SearchState;
use super::stepwise::physical;
use crate::fit::{Fit, Gain, HeldOutErrors, IntervalParts, gain, half_widths, held_out, mean_error};
use crate::measurements::Measurements;

/// Difference in the chi-square of the reference values that decides between two explanations: three sigma.
pub const REFERENCES_DECIDE: f64 = 9.0;

/// Errors on measurements left out that differ by more than this are not equal, however wide the interval.
const ALIKE_WITHIN: f64 = 0.02;

/// An explanation that leaves so much more on the surrogate, relative to what the effect removes in whose place it is, is not
/// refined for the comparison.
const WORTH_REFINING: f64 = 0.1;

/// Another effect that explains as much.
#[derive(Clone, Debug)]
pub struct Alternative {
    pub effect: usize,
    pub values: Vec<f64>,
    pub half_widths: Vec<IntervalParts>,
}

/// Drop effects that the others have made redundant, and those whose intervals include zero since all was refined, with their
/// runners-up.
pub(crate) fn drop_redundant<M: Measurements>(
    now: &mut SearchState<'_, M>,
    chosen: &mut Vec<usize>,
    runners_up: &mut Vec<Vec<usize>>,
) {
    let mut place = 0;
    while chosen.len() > 1 && place < chosen.len() {
        let rest: Vec<usize> = chosen.iter().copied().filter(|&e| e != chosen[place]).collect();
        let fit = refit(now, chosen[place], &rest);
        let held = held_out(&now.problem, &fit.equations, &fit);
        let Gain {
            value: loss,
            interval: [low, _],
        } = gain(&now.problem, &held, &now.held_out);
        if loss < LEAST_GAIN || low <= 0.0 || includes_zero(now, chosen[place]) {
            *chosen = rest;
            runners_up.remove(place);
            (now.fit, now.held_out) = (fit, held);
            place = 0;
        } else {
            place += 1;
        }
    }
}

/// True if the interval of each number of an effect includes zero.
fn includes_zero<M: Measurements>(now: &SearchState<'_, M>, effect: usize) -> bool {
    let widths = half_widths(&now.problem, &now.fit);
    let widths: Vec<f64> = widths.iter().map(IntervalParts::half_width).collect();
    !now.fit.clears_zero(&now.problem.model.slots_of(effect), &widths)
}

/// For each effect found: the others that explain as much in its place. Where one explains more, or the reference
/// values prefer it among those that measurements cannot distinguish, it takes the place. `before` is the error when
/// nothing was found; with `full`, all are refined with full simulations before they are compared.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub(crate) fn alternatives<M: Measurements>(
    now: &mut SearchState<'_, M>,
    chosen: &mut [usize],
    runners_up: &[Vec<usize>],
    before: &HeldOutErrors,
    full: bool,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Alternative>>> {
    let mut out = Vec::new();
    for place in 0..chosen.len() {
        // Where a residual is left, the true effect may have been screened out early.
        let all: Vec<usize> = (0..now.problem.model.effects()).collect();
        let runners_up = if now.leaves_more_than(ALIKE_WITHIN) {
            Some(&all)
        } else {
            runners_up.get(place)
        };
        let far = error_without(now, chosen, place, before) - now.error();
        let mut best = Substitute {
            effect: chosen[place],
            state: now.clone(),
        };
        let mut others = Vec::new();
        for &other in runners_up.into_iter().flatten().filter(|o| !chosen.contains(o)) {
            if now.problem.model.is_spent() {
                break;
            }
            let mut set = chosen.to_vec();
            set[place] = other;
            let mut substitute = Substitute::new(now, chosen[place], other, &set);
            let behind = substitute.state.error() - now.error();
            if behind > ALIKE_WITHIN.max(WORTH_REFINING * far) || !substitute.physical() {
                continue;
            }
            if full {
                substitute.state.refine(progress)?;
            }
            others.push(substitute);
        }
        for other in &mut others {
            if other.beats(&best) {
                std::mem::swap(other, &mut best);
            }
        }
        others.retain(|o| o.is_as_good(&best) && o.references_chi2() - best.references_chi2() <= REFERENCES_DECIDE);
        out.push(others.iter().map(Alternative::new).collect());
        chosen[place] = best.effect;
        *now = best.state;
    }
    Ok(out)
}

/// The error on measurements left out without the effect at `place`; `before` is that without any.
fn error_without<M: Measurements>(
    now: &SearchState<'_, M>,
    chosen: &[usize],
    place: usize,
    before: &HeldOutErrors,
) -> f64 {
    let rest: Vec<usize> = chosen.iter().copied().filter(|&e| e != chosen[place]).collect();
    if rest.is_empty() {
        return mean_error(before);
    }
    let fit = refit(now, chosen[place], &rest);
    mean_error(&held_out(&now.problem, &fit.equations, &fit)).min(mean_error(before))
}

/// The fit of a set of effects after one was `removed`.
fn refit<M: Measurements>(now: &SearchState<'_, M>, removed: usize, set: &[usize]) -> Fit<M> {
    let model = now.problem.model;
    let mut from = now.fit.clone();
    for s in model.slots_of(removed) {
        from.theta[s] = 0.0;
    }
    now.problem.fit(&model.slots_of_all(set), &from)
}

/// An explanation with a certain effect in the place of one that was found.
struct Substitute<'a, M: Measurements> {
    effect: usize,
    state: SearchState<'a, M>,
}

impl<'a, M: Measurements> Substitute<'a, M> {
    /// Fit with an effect in the place of one that is `removed`; `set` are all effects then.
    fn new(now: &SearchState<'a, M>, removed: usize, effect: usize, set: &[usize]) -> Self {
        Self {
            effect,
            state: SearchState::new(now.problem.clone(), refit(now, removed, set)),
        }
    }

    fn physical(&self) -> bool {
        let SearchState { problem, fit, .. } = &self.state;
        physical(problem, fit, &problem.model.slots_of(self.effect))
    }

    /// Chi-square of the reference values.
    fn references_chi2(&self) -> f64 {
        self.state.fit.equations.references_chi2()
    }

    /// True if measurements left out cannot distinguish it from the best.
    fn is_as_good(&self, best: &Self) -> bool {
        let (own, best) = (&self.state, &best.state);
        !best.surely_leaves_less_than(own) && own.error() < best.error() + ALIKE_WITHIN
    }

    fn beats(&self, best: &Self) -> bool {
        let by_references = best.references_chi2() - self.references_chi2();
        self.state.surely_leaves_less_than(&best.state) && by_references > -REFERENCES_DECIDE
            || self.is_as_good(best) && by_references > REFERENCES_DECIDE
    }
}

impl Alternative {
    fn new<M: Measurements>(substitute: &Substitute<'_, M>) -> Self {
        let SearchState { problem, fit, .. } = &substitute.state;
        let widths = half_widths(problem, fit);
        let own = problem.model.slots_of(substitute.effect);
        Self {
            effect: substitute.effect,
            values: own.iter().map(|&s| fit.theta[s]).collect(),
            half_widths: fit.pick(&own, &widths),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_model::{ERROR_PERIODS, LinearModel, Term, setups};

    /// Possible error of the model: clear of noise, and predicted in every measurement that is left out.
    #[test]
    fn an_effect_whose_interval_includes_zero_is_dropped() {
        const TRUTH: [f64; 2] = [0.0015, 0.02];
        let terms = vec![Term::linear(ERROR_PERIODS), Term::linear([2, 3])];
        let model = LinearModel::new(terms, setups(2, 2, 2));
        let data = model.data(|_| TRUTH.to_vec(), None);
        let problem = model.problem(&data);
        let alone = SearchState::new(problem.clone(), problem.fit(&[1], &problem.nuisance_fit()));
        let both = problem.fit(&[0, 1], &alone.fit);
        let mut now = SearchState::new(problem, both);
        let Gain { value, interval } = gain(&now.problem, &alone.held_out, &now.held_out);
        assert!(value > LEAST_GAIN && interval[0] > 0.0, "{value} {interval:?}");
        let (mut chosen, mut runners_up) = (vec![1, 0], vec![vec![0], vec![1]]);
        drop_redundant(&mut now, &mut chosen, &mut runners_up);
        assert_eq!((chosen, runners_up), (vec![1], vec![vec![0]]));
        assert_eq!(now.fit.active, [1]);
    }
}
