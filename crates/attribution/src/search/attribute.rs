//! Selection of effects for a residual: score every effect, fit the leaders, keep what predicts measurements that were not
//! fitted, and say which effects cannot be distinguished.

use metalith_core::{Progress, Result};

use super::alternatives::{Alternative, alternatives, drop_redundant};
use super::exchange::{find_exchange, much_alike};
use super::pairs::{FoundTogether, LEAST_LEFT, find_pair};
use super::recentred_leaders::follow_leaders_anew;
use super::residual::LEAST_GAIN;
use super::state::{EndsSearch, MORE_IS_LEFT, SearchState};
use super::stepwise::{Rejection, TriedEffect, step_forward};
use crate::fit::{Fit, FitProblem, HeldOutErrors, IntervalParts, half_widths, mean_error, sampling_half_widths};
use crate::index::PerMeasurement;
use crate::measurements::Measurements;
use crate::surrogate::Surrogate;

/// Most effects that are looked for at once.
const MOST_EFFECTS: usize = 4;

/// A single effect explains the residual if it gains this share of it; else something may that is not tried.
const MOST_OF_IT: f64 = 0.5;

/// The outcome of a search.
pub struct Finding<M: Measurements> {
    /// Effects, strongest first.
    pub chosen: Vec<usize>,
    /// Alternatives that explain as much, for each of them.
    pub alternatives: Vec<Vec<Alternative>>,
    pub before: Fit<M>,
    pub after: Fit<M>,
    pub held_before: HeldOutErrors,
    pub held_after: HeldOutErrors,
    /// The error that random smooth terms would leave on measurements left out.
    pub null_held_out: f64,
    pub ranking: Vec<TriedEffect>,
    /// Effects that were tried in addition to each effect that was taken.
    pub later: Vec<Vec<TriedEffect>>,
    /// 95 % half-widths of the active parameters of `after`.
    pub half_widths: Vec<IntervalParts>,
    /// The surrogate that `after` is based on, and its correction by a full simulation.
    pub surrogate: Surrogate<M>,
    pub correction: Option<PerMeasurement<M::Prediction>>,
    /// True if it was ended before all was tried.
    pub was_ended: bool,
}

/// The steps of a search so far.
struct SearchHistory<M: Measurements> {
    chosen: Vec<usize>,
    before: Fit<M>,
    held_before: HeldOutErrors,
    null_held_out: f64,
    ranking: Vec<TriedEffect>,
    later: Vec<Vec<TriedEffect>>,
    runners_up: Vec<Vec<usize>>,
    /// For each effect: those that gained nearly as much when it was taken.
    alike: Vec<Vec<TriedEffect>>,
    /// True if pairs were tried where nothing was found yet.
    pairs_tried_from_start: bool,
}

impl<M: Measurements> SearchHistory<M> {
    /// Start of the search, with no effect found.
    fn start(start: &SearchState<'_, M>) -> Self {
        Self {
            chosen: Vec::new(),
            before: start.fit.clone(),
            held_before: start.held_out.clone(),
            null_held_out: start.error(),
            ranking: Vec::new(),
            later: Vec::new(),
            runners_up: Vec::new(),
            alike: Vec::new(),
            pairs_tried_from_start: false,
        }
    }

    /// Keep what was tried in a step, at which random smooth terms gained `null_gain`.
    fn keep(&mut self, tried: Vec<TriedEffect>, null_gain: f64) {
        if self.chosen.is_empty() {
            self.null_held_out = mean_error(&self.held_before) - null_gain;
            self.ranking = tried;
        } else {
            self.later.push(tried);
        }
    }

    /// Take an effect; `runners_up` were fitted as well, and those in `alike` gained nearly as much.
    fn take(&mut self, tried: &TriedEffect, runners_up: Vec<usize>, alike: Vec<TriedEffect>) {
        if let Some(known) = self.ranking.iter_mut().find(|t| t.effect == tried.effect) {
            let score = known.score;
            *known = TriedEffect { score, ..tried.clone() };
        }
        self.chosen.push(tried.effect);
        self.runners_up.push(runners_up);
        self.alike.push(alike);
    }

    /// Take effects that explain more together in the place of all that were taken before.
    fn replace_all(&mut self, found: &FoundTogether<'_, M>) {
        for place in 0..self.chosen.len() {
            self.reject(self.chosen[place]);
        }
        (self.chosen, self.runners_up, self.alike) = Default::default();
        for tried in &found.tried {
            self.take(tried, found.runners_up.clone(), Vec::new());
        }
    }

    /// An effect that was taken is so no longer: others explain more.
    fn reject(&mut self, removed: usize) {
        for known in self.ranking.iter_mut().chain(self.later.iter_mut().flatten()) {
            if known.effect == removed && known.rejected.is_none() {
                known.rejected = Some(Rejection::Second);
            }
        }
    }

    /// Take an effect in the place of one that was taken before.
    fn replace(&mut self, place: usize, effect: usize) {
        let removed = std::mem::replace(&mut self.chosen[place], effect);
        self.reject(removed);
        for known in self.ranking.iter_mut().chain(self.later.iter_mut().flatten()) {
            if known.effect == effect && known.rejected == Some(Rejection::Second) {
                known.rejected = None;
            }
        }
    }
}

/// Attribute the residual of a problem to effects. With `full`, what is found is refined with full simulations, and
/// the search continues about it where a residual is left, unless `ends` says that it need not.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub(crate) fn attribute<M: Measurements>(
    problem: FitProblem<'_, M>,
    full: bool,
    ends: Option<&EndsSearch<'_, M>>,
    progress: &dyn Progress,
) -> Result<Finding<M>> {
    let nothing = problem.nuisance_fit();
    let start = SearchState::new(problem, nothing);
    let mut now = start.clone();
    let mut history = SearchHistory::start(&start);
    let was_ended = add_effects(&mut now, &mut history, full, ends, progress)?;
    let alternatives = if was_ended {
        vec![Vec::new(); history.chosen.len()]
    } else {
        try_pairs_from_start(&start, &mut now, &mut history, full, progress)?;
        let found = history.chosen.len();
        drop_redundant(&mut now, &mut history.chosen, &mut history.runners_up);
        if full && history.chosen.len() < found {
            now.refine(progress)?;
        }
        let (runners_up, before) = (&history.runners_up, &history.held_before);
        alternatives(&mut now, &mut history.chosen, runners_up, before, full, progress)?
    };
    let mut widths = half_widths(&now.problem, &now.fit);
    if full && let Some(sampling) = sampling_half_widths(&now.problem, &now.fit, progress)? {
        widths
            .iter_mut()
            .zip(sampling)
            .for_each(|(own, width)| own.sampling = width);
    }
    Ok(Finding {
        chosen: history.chosen,
        alternatives,
        before: history.before,
        after: now.fit,
        held_before: history.held_before,
        held_after: now.held_out,
        null_held_out: history.null_held_out,
        ranking: history.ranking,
        later: history.later,
        half_widths: widths,
        correction: now.problem.correction,
        surrogate: now.problem.surrogate,
        was_ended,
    })
}

/// Add single effects, and a pair where no single one helps, until nothing more is gained. Whether `ends` ended it.
fn add_effects<M: Measurements>(
    now: &mut SearchState<'_, M>,
    history: &mut SearchHistory<M>,
    full: bool,
    ends: Option<&EndsSearch<'_, M>>,
    progress: &dyn Progress,
) -> Result<bool> {
    while history.chosen.len() < MOST_EFFECTS && !now.problem.model.is_spent() {
        let step = step_forward(now, &history.chosen, full, progress)?;
        let explained = step
            .taken
            .as_ref()
            .and_then(|(tried, ..)| tried.gain)
            .map_or(0.0, |g| g.value);
        if let Some(ends) = ends
            && explained < MOST_OF_IT * (now.error() - 1.0)
            && now.leaves_a_residual()
            && ends(now)?
        {
            history.keep(step.tried, step.null_gain);
            return Ok(true);
        }
        if let Some((tried, fit, held)) = step.taken {
            let alike = much_alike(&step.tried, &tried);
            history.keep(step.tried, step.null_gain);
            history.take(&tried, step.leaders, alike);
            (now.fit, now.held_out) = (fit, held);
            if full {
                now.refine(progress)?;
            }
        } else {
            history.keep(step.tried, step.null_gain);
            if !now.leaves_a_residual() {
                break;
            }
            history.pairs_tried_from_start |= history.chosen.is_empty();
            let together = if history.chosen.len() + 2 <= MOST_EFFECTS {
                match find_pair(now, &history.chosen, full, progress)? {
                    None if full => follow_leaders_anew(now, &history.chosen, progress)?,
                    pair => pair,
                }
            } else {
                None
            };
            if let Some(found) = together {
                for tried in &found.tried {
                    history.take(tried, found.runners_up.clone(), Vec::new());
                }
                *now = found.state;
            } else {
                let (chosen, alike) = (&history.chosen, &history.alike);
                let Some(found) = find_exchange(now, chosen, alike, full, progress)? else {
                    break;
                };
                history.replace(found.place, found.effect);
                history.keep(found.tried, found.null_gain);
                history.take(&found.taken, found.leaders, Vec::new());
                *now = found.state;
            }
        }
        let awake = history.chosen.last().is_some_and(|&e| now.problem.model.dormant(e));
        if full && !now.problem.model.is_spent() && (awake || now.leaves_more_than(MORE_IS_LEFT)) {
            // Between what was simulated and what was found, polynomials err; what dormant parameters change depends on the others.
            now.settle(progress)?;
            if now.leaves_more_than(MORE_IS_LEFT) {
                // What other effects change depends on what was found.
                now.renew_others(progress)?;
            }
        }
        if now.error() < 1.0 + LEAST_GAIN {
            break;
        }
    }
    Ok(false)
}

/// Where effects that were added one by one leave something, the first may have been the wrong one: a pair that explains all but
/// little from the start, and surely more than they do, takes their place.
fn try_pairs_from_start<'a, M: Measurements>(
    start: &SearchState<'a, M>,
    now: &mut SearchState<'a, M>,
    history: &mut SearchHistory<M>,
    full: bool,
    progress: &dyn Progress,
) -> Result<()> {
    // Where no pair was found from the start, or all that was found stands on it, none takes its place.
    let is_spent = start.problem.model.is_spent();
    if history.chosen.is_empty() || is_spent || history.pairs_tried_from_start || !now.leaves_more_than(LEAST_LEFT) {
        return Ok(());
    }
    if let Some(found) = find_pair(start, &[], full, progress)?
        && found.state.surely_leaves_less_than(now)
    {
        history.replace_all(&found);
        *now = found.state;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_model::{LinearModel, Term, setups};
    use metalith_core::Silent;

    fn six_effects() -> LinearModel {
        let periods = [[2, 3], [5, 4], [3, 0], [0, 6], [7, 2], [4, 5]];
        LinearModel::new(periods.map(Term::linear).to_vec(), setups(2, 2, 2))
    }

    #[test]
    fn stepwise_selection_takes_the_true_regressors_strongest_first() {
        let model = six_effects();
        let truth = [0.0, 0.006, 0.0, 0.0, -0.012, 0.0];
        let data = model.data(|_| truth.to_vec(), Some(1));
        let found = attribute(model.problem(&data), false, None, &Silent).unwrap();
        assert_eq!(found.chosen, [4, 1]);
        assert!(found.alternatives.iter().all(Vec::is_empty));
        for effect in [4, 1] {
            let place = found.after.position(effect).unwrap();
            let error = found.after.theta[effect] - truth[effect];
            assert!(error.abs() < found.half_widths[place].half_width(), "{effect}: {error}");
        }
        assert!(mean_error(&found.held_after) < 1.0 + LEAST_GAIN);
    }

    #[test]
    fn stepwise_selection_takes_nothing_of_pure_noise() {
        let model = six_effects();
        for seed in 10..20 {
            let data = model.data(|_| vec![0.0; 6], Some(seed));
            let found = attribute(model.problem(&data), false, None, &Silent).unwrap();
            assert!(found.chosen.is_empty(), "{seed}: {:?}", found.chosen);
        }
    }

    /// Two effects with the same signature explain the same: one is found, the other is its alternative.
    #[test]
    fn an_effect_with_the_same_signature_is_an_alternative() {
        let twin = Term::linear([2, 3]);
        let model = LinearModel::new(vec![twin.clone(), twin, Term::linear([5, 4])], setups(2, 2, 2));
        let data = model.data(|_| vec![0.01, 0.0, 0.0], Some(3));
        let found = attribute(model.problem(&data), false, None, &Silent).unwrap();
        assert_eq!(found.chosen.len(), 1);
        let mut both = vec![found.chosen[0]];
        both.extend(found.alternatives[0].iter().map(|a| a.effect));
        both.sort_unstable();
        assert_eq!(both, [0, 1]);
    }

    /// The last two effects are each much like one of the first two, and were taken for them: the pair takes their place, and
    /// what is right is left alone.
    #[test]
    fn a_pair_takes_the_place_of_effects_that_leave_more() {
        let mixed = |own: [u32; 2], other: [u32; 2]| Term {
            patterns: vec![(own, 1.0), (other, 0.4)],
            ..Term::linear(own)
        };
        let [a, b] = [[2, 3], [5, 4]];
        let terms = vec![Term::linear(a), Term::linear(b), mixed(a, [3, 6]), mixed(b, [6, 2])];
        let model = LinearModel::new(terms, setups(2, 2, 2));
        let data = model.data(|_| vec![0.08, 0.04, 0.0, 0.0], Some(7));
        let start = SearchState::new(model.problem(&data), model.problem(&data).nuisance_fit());
        let found = |chosen: [usize; 2]| {
            let mut now = start.clone();
            now.move_to(now.problem.fit(&chosen, &now.fit));
            let mut history = SearchHistory::start(&start);
            history.chosen = chosen.to_vec();
            try_pairs_from_start(&start, &mut now, &mut history, false, &Silent).unwrap();
            assert!(!now.leaves_more_than(0.0), "{}", now.error());
            history.chosen
        };
        assert_eq!(found([2, 3]), [0, 1]);
        assert_eq!(found([1, 0]), [1, 0]);
    }

    /// One effect is taken for another that is much like it, because a third is hidden: with the third, the right one explains
    /// all. There is no room for both beside the wrong one.
    #[test]
    fn an_effect_is_exchanged_where_a_hidden_one_then_explains_the_rest() {
        let mixed = Term {
            patterns: vec![([2, 3], 1.0), ([5, 4], 0.5), ([3, 6], 0.2)],
            ..Term::linear([2, 3])
        };
        let clear = [[6, 2], [4, 5]].map(Term::linear);
        let terms = [&clear[..], &[Term::linear([2, 3]), mixed, Term::linear([5, 4])]].concat();
        let model = LinearModel::new(terms, setups(2, 2, 2));
        let data = model.data(|_| vec![0.08, 0.08, 0.04, 0.0, 0.02], Some(5));
        let mut found = attribute(model.problem(&data), false, None, &Silent).unwrap();
        found.chosen.sort_unstable();
        assert_eq!(found.chosen, [0, 1, 2, 4]);
        assert!(mean_error(&found.held_after) < 1.0 + LEAST_GAIN);
    }
}
