//! Stepwise selection: every effect that is not yet chosen is tried, and at most one is taken.

use metalith_core::{Progress, Result};

use super::residual::{EXPLAINED, LEAST_GAIN};
use super::signatures::score_effects;
use super::state::SearchState;
use crate::effect::Parameter;
use crate::fit::{
    Fit, FitProblem, Gain, HeldOutErrors, cautious_half_widths, change_energy, gain, held_out, mean_error, null_gain,
};
use crate::measurements::Measurements;

/// Candidates that are fitted in full at each step.
pub(crate) const LEADERS: usize = 6;

/// Share of the error above noise that an effect must remove.
const LEAST_SHARE: f64 = 0.15;

/// A leader that leaves the simulated range is followed if it gains this share of what the best gains, while
/// the best leaves a residual.
const WORTH_FOLLOWING: f64 = 0.7;

/// And this share where the best leaves none.
const WORTH_COMPARING: f64 = 0.95;

/// A candidate as it was tried.
#[derive(Clone, Debug)]
pub struct TriedEffect {
    pub effect: usize,
    /// Share of the residual that its signature alone explains, nuisances projected out.
    pub score: f64,
    /// Gain of a full fit on measurements left out; none where it was not fitted.
    pub gain: Option<Gain>,
    /// Parameters.
    pub values: Vec<f64>,
    /// Reason why it was not taken; none if it was.
    pub rejected: Option<Rejection>,
}

/// Reason why a candidate is not taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Others explain more; it was not fitted.
    Screened,
    /// Gain is within the error of the forward model.
    Little(f64),
    /// The confidence interval of its gain includes zero.
    Unsure,
    /// It removes only this share of the error above noise.
    Part(f64),
    /// Value is at the end of the physical range.
    Unphysical,
    /// The confidence interval of its value includes zero.
    Nothing,
    /// Another explains more.
    Second,
    /// Random smooth terms gain as much.
    NullTest,
}

impl Rejection {
    /// Reason in a few words, for a chart.
    pub fn remark(self) -> String {
        match self {
            Self::Screened => "not fitted".into(),
            Self::Little(_) => "within model error".into(),
            Self::Unsure => "gain not significant".into(),
            Self::Part(share) => format!("explains {:.0} %", 100.0 * share),
            Self::Unphysical => "not physical".into(),
            Self::Nothing => "interval includes zero".into(),
            Self::Second => "another explains more".into(),
            Self::NullTest => "random terms gain as much".into(),
        }
    }

    /// Reason in full.
    pub fn sentence(self) -> String {
        match self {
            Self::Screened => "explains less of the residual than others".into(),
            Self::Little(gain) => {
                format!(
                    "its gain of {gain:.4} in reduced chi-square per point is within the error of the forward model"
                )
            }
            Self::Unsure => "the 95 % confidence interval of its gain on measurements left out includes zero".into(),
            Self::Part(share) => format!("explains only {:.0} % of the error above noise", 100.0 * share),
            Self::Unphysical => "its fitted value is at the end of its physical range".into(),
            Self::Nothing => "the 95 % confidence interval of its value includes zero".into(),
            Self::Second => "another explains more".into(),
            Self::NullTest => "random smooth terms with as many parameters gain as much".into(),
        }
    }
}

/// The outcome of a step.
pub(crate) struct SelectionStep<M: Measurements> {
    pub tried: Vec<TriedEffect>,
    /// Effects that were fitted in full.
    pub leaders: Vec<usize>,
    /// The effect that was taken, with the fit that it is part of.
    pub taken: Option<(TriedEffect, Fit<M>, HeldOutErrors)>,
    /// Gain that 95 % of random smooth terms with as many parameters as the best stay below.
    pub null_gain: f64,
}

/// An effect that is being tried.
pub(crate) struct Candidate<M: Measurements> {
    pub tried: TriedEffect,
    fitted: Option<(Fit<M>, HeldOutErrors)>,
}

/// Try every effect on top of those in `chosen`. With `extend`, fits may leave the simulated range, and the
/// surrogate is extended.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub(crate) fn step_forward<M: Measurements>(
    state: &mut SearchState<'_, M>,
    chosen: &[usize],
    extend: bool,
    progress: &dyn Progress,
) -> Result<SelectionStep<M>> {
    let mut candidates = fitted_candidates(state, chosen);
    let tried: Vec<String> = candidates
        .iter()
        .filter(|c| c.fitted.is_some())
        .map(|c| state.problem.model.effect_name(c.tried.effect))
        .collect();
    progress.note(&format!("trying {}", tried.join(", ")));
    if extend {
        follow_leaders(state, &mut candidates, progress)?;
    }
    let (taken, null_gain) = select(state, &mut candidates);
    let leaders = candidates
        .iter()
        .filter(|c| c.fitted.is_some())
        .map(|c| c.tried.effect)
        .collect();
    let tried = candidates.iter().map(|c| c.tried.clone()).collect();
    let taken = taken.and_then(|place| {
        let Candidate { tried, fitted } = candidates.swap_remove(place);
        fitted.map(|(fit, held)| (tried, fit, held))
    });
    Ok(SelectionStep {
        tried,
        leaders,
        taken,
        null_gain,
    })
}

/// All effects that are not chosen, those with the highest scores fitted; best first.
fn fitted_candidates<M: Measurements>(state: &SearchState<'_, M>, chosen: &[usize]) -> Vec<Candidate<M>> {
    let SearchState { problem, fit: now, .. } = state;
    let mut candidates = Vec::new();
    for (rank, (effect, score)) in score_effects(problem, now, chosen).into_iter().enumerate() {
        let mut candidate = Candidate::new(effect, score);
        if rank < LEADERS
            && let Some(fit) = fit_with(problem, now, chosen, &[effect])
        {
            let held = held_out(problem, &fit.equations, &fit);
            candidate.judge(problem, fit, held, &state.held_out);
        }
        candidates.push(candidate);
    }
    sort(&mut candidates);
    candidates
}

/// Follow leaders that left the simulated range, where that may change which one is best.
fn follow_leaders<M: Measurements>(
    state: &mut SearchState<'_, M>,
    candidates: &mut [Candidate<M>],
    progress: &dyn Progress,
) -> Result<()> {
    let SearchState {
        problem,
        held_out: errors_now,
        ..
    } = state;
    for place in 0..LEADERS.min(candidates.len()) {
        let best = candidates[0].gain();
        let worth = if mean_error(errors_now) - best > EXPLAINED {
            WORTH_FOLLOWING
        } else {
            WORTH_COMPARING
        };
        let candidate = &mut candidates[place];
        let leaves = candidate
            .fitted
            .as_ref()
            .is_some_and(|(fit, _)| problem.extrapolates(fit));
        if !leaves || candidate.gain() < LEAST_GAIN.max(worth * best) {
            continue;
        }
        if let Some((fit, _)) = candidate.fitted.take() {
            let fit = problem.extend_and_fit(fit, progress)?;
            let held = held_out(problem, &fit.equations, &fit);
            candidate.judge(problem, fit, held, errors_now);
        }
    }
    sort(candidates);
    Ok(())
}

/// The position of the candidate that is taken, if any, and the gain of random smooth terms. Every candidate is
/// told why it is not taken.
fn select<M: Measurements>(state: &SearchState<'_, M>, candidates: &mut [Candidate<M>]) -> (Option<usize>, f64) {
    let SearchState {
        problem,
        fit: now,
        held_out: errors_now,
    } = state;
    let null = |parameters: usize| null_gain(problem, now, errors_now, parameters);
    let mut first_null = None;
    let mut taken = None;
    for (place, candidate) in candidates.iter_mut().enumerate() {
        if candidate.fitted.is_none() {
            continue;
        }
        candidate.tried.rejected = if let Some(fault) = candidate.fault(problem, errors_now) {
            Some(fault)
        } else if taken.is_some() {
            Some(Rejection::Second)
        } else {
            let chance = null(candidate.tried.values.len());
            first_null.get_or_insert(chance);
            if candidate.gain() <= chance {
                Some(Rejection::NullTest)
            } else {
                taken = Some(place);
                None
            }
        };
    }
    let of_best = || null(candidates.first().map_or(1, |c| c.tried.values.len().max(1)));
    (taken, first_null.unwrap_or_else(of_best))
}

/// Least error above noise that shares are relative to, where there is none.
const LEAST_ERROR: f64 = 1e-6;

/// A parameter this near to an end of its range, relative to the range, is at the end.
const AT_END: f64 = 1e-6;

/// True if the parameters lie within their physical ranges, not at the ends; an end that is a sound value counts as within.
pub(crate) fn physical<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>, slots: &[usize]) -> bool {
    slots.iter().all(|&s| {
        let Parameter {
            range: (a, b),
            sound_end,
            ..
        } = problem.model.slots()[s].parameter;
        let room = AT_END * (b - a);
        fit.theta[s] > a + room && fit.theta[s] < b - room || (fit.theta[s] - sound_end).abs() <= room
    })
}

/// The best fit of some effects on top of those in `chosen`, over all starting points.
pub(crate) fn fit_with<M: Measurements>(
    problem: &FitProblem<'_, M>,
    now: &Fit<M>,
    chosen: &[usize],
    effects: &[usize],
) -> Option<Fit<M>> {
    let active = problem.model.slots_of_all(&[chosen, effects].concat());
    let begin = |from: Vec<Fit<M>>, effect: &usize| from.iter().flat_map(|f| starts(problem, *effect, f)).collect();
    let fits = effects.iter().fold(vec![now.clone()], begin).into_iter();
    fits.map(|from| problem.fit(&active, &from))
        .min_by(|a, b| a.chi2.total_cmp(&b.chi2))
}

/// Fit some effects and no others, all of which there is. With `full`, they are refined with full simulations, twice as often as in a
/// search: its surrogate is not centred on them.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub fn fit_of<'a, M: Measurements>(
    problem: FitProblem<'a, M>,
    effects: &[usize],
    full: bool,
    progress: &dyn Progress,
) -> Result<SearchState<'a, M>> {
    let nothing = problem.nuisance_fit();
    let fit = fit_with(&problem, &nothing, &[], effects).unwrap_or(nothing);
    let mut state = SearchState::new(problem, fit);
    if full {
        state.refine(progress)?;
        state.refine(progress)?;
    }
    Ok(state)
}

/// Starting points for fits of an effect: the present fit, or both sides of a kink at zero.
fn starts<M: Measurements>(problem: &FitProblem<'_, M>, effect: usize, now: &Fit<M>) -> Vec<Fit<M>> {
    if !problem.model.kinked(effect) {
        return vec![now.clone()];
    }
    let mut starts = vec![now.clone()];
    for slot in problem.model.slots_of(effect) {
        let typical = problem.model.slots()[slot].parameter.typical;
        starts = starts
            .into_iter()
            .flat_map(|start| {
                [typical, -typical].map(|value| {
                    let mut start = start.clone();
                    start.theta[slot] = 0.5 * value;
                    start
                })
            })
            .collect();
    }
    starts
}

fn sort<M: Measurements>(candidates: &mut [Candidate<M>]) {
    candidates.sort_by(|a, b| {
        let score = b.tried.score.total_cmp(&a.tried.score);
        b.gain().total_cmp(&a.gain()).then(score)
    });
}

impl<M: Measurements> Candidate<M> {
    /// Not fitted yet.
    pub(crate) fn new(effect: usize, score: f64) -> Self {
        Self {
            tried: TriedEffect {
                effect,
                score,
                gain: None,
                values: Vec::new(),
                rejected: Some(Rejection::Screened),
            },
            fitted: None,
        }
    }

    /// Value by a fit that it is part of, and the error of this fit on measurements left out.
    pub(crate) fn judge(
        &mut self,
        problem: &FitProblem<'_, M>,
        fit: Fit<M>,
        held: HeldOutErrors,
        errors_now: &HeldOutErrors,
    ) {
        self.tried.gain = Some(gain(problem, errors_now, &held));
        let slots = problem.model.slots_of(self.tried.effect);
        self.tried.values = slots.iter().map(|&s| fit.theta[s]).collect();
        self.fitted = Some((fit, held));
    }

    fn gain(&self) -> f64 {
        self.tried.gain.map_or(f64::MIN, |g| g.value)
    }

    /// Reason why it cannot be taken, whatever others do.
    pub(crate) fn fault(&self, problem: &FitProblem<'_, M>, errors_now: &HeldOutErrors) -> Option<Rejection> {
        let Gain {
            value,
            interval: [low, _],
        } = self.tried.gain?;
        let (fit, _) = self.fitted.as_ref()?;
        let above_noise = (mean_error(errors_now) - 1.0).max(LEAST_ERROR);
        let slots = problem.model.slots_of(self.tried.effect);
        // What was found, and what is tried, may each be wrong by a share of what it changes.
        if value < LEAST_GAIN + change_energy(problem, fit) / problem.points().max(1.0) {
            return Some(Rejection::Little(value));
        }
        if low <= 0.0 {
            return Some(Rejection::Unsure);
        }
        if value < LEAST_SHARE * above_noise {
            return Some(Rejection::Part(value / above_noise));
        }
        if !physical(problem, fit, &slots) {
            return Some(Rejection::Unphysical);
        }
        let widths = cautious_half_widths(problem, fit);
        (!fit.clears_zero(&slots, &widths)).then_some(Rejection::Nothing)
    }
}
