//! One step towards an explanation: every effect that is not yet taken is tried, and at most one is taken.

use crate::fit::cross_validation::{HeldOutErrors, gain, half_widths, held_out, mean};
use crate::fit::null_test::null_gain;
use crate::fit::problem::{Fit, Problem};
use crate::search::signatures::score_effects;
use crate::search::state::SearchState;
use metalith_core::{Progress, Result};

/// Candidates that are fitted in full at each step.
const LEADERS: usize = 6;

/// Less than this of chi-square a pixel is what the forward model itself may err by: two programs that share
/// nothing differ by 0.005 on a chip without effects.
pub const LEAST_GAIN: f64 = 0.006;

/// Share of the error above noise that a step must take away to be worth a name.
const LEAST_SHARE: f64 = 0.15;

/// Above this, chi-square a pixel says that something is there.
pub const RESIDUAL: f64 = 1.1;

/// A leader that wants to go where nothing was simulated is followed there if it gains this share of what the
/// best does, while the best leaves a residual.
const WORTH_FOLLOWING: f64 = 0.7;

/// And this share where the best leaves none.
const WORTH_COMPARING: f64 = 0.95;

/// A candidate as it was tried.
#[derive(Clone, Debug)]
pub struct TriedEffect {
    pub effect: usize,
    /// Share of the residual that its signature explains on its own, nuisances projected out.
    pub score: f64,
    /// What a full fit gains on captures left out, with its interval; none where it did not come so far.
    pub gain: Option<(f64, [f64; 2])>,
    /// Its numbers.
    pub values: Vec<f64>,
    /// Why it was not taken; none for what was.
    pub rejected: Option<Rejection>,
}

/// Why a candidate is not taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Others explain more; it was not fitted in full.
    Screened,
    /// Gains no more than the model itself may err by.
    Little(f64),
    /// The interval of its gain holds zero.
    Unsure,
    /// Share of what is above noise that it takes away.
    Part(f64),
    /// At the end of what physics allows.
    Unphysical,
    /// The interval of its value holds no effect.
    Nothing,
    /// Another explains more.
    Second,
    /// Random smooth terms do as well.
    Placebo,
}

impl Rejection {
    /// In a few words, for a drawing.
    pub fn remark(self) -> String {
        match self {
            Self::Screened => "not fitted".into(),
            Self::Little(_) => "within the model's own error".into(),
            Self::Unsure => "gain not sure".into(),
            Self::Part(share) => format!("explains {:.0} %", 100.0 * share),
            Self::Unphysical => "beyond physics".into(),
            Self::Nothing => "interval holds no effect".into(),
            Self::Second => "another explains more".into(),
            Self::Placebo => "random terms do as well".into(),
        }
    }

    /// In full.
    pub fn sentence(self) -> String {
        match self {
            Self::Screened => "explains less of the residual than others".into(),
            Self::Little(gain) => {
                format!("gains {gain:.4} of chi-square a pixel on captures left out; the model itself errs by as much")
            }
            Self::Unsure => "its gain on captures left out is not sure to be one".into(),
            Self::Part(share) => format!("explains {:.0} % of what is above noise", 100.0 * share),
            Self::Unphysical => "its value would lie at the end of what physics allows".into(),
            Self::Nothing => "its interval holds no effect".into(),
            Self::Second => "another explains more".into(),
            Self::Placebo => "a random smooth term with as many numbers explains as much".into(),
        }
    }
}

/// What a step came to.
pub struct Step {
    pub tried: Vec<TriedEffect>,
    /// Effects that were fitted in full.
    pub leaders: Vec<usize>,
    /// The effect that was taken, with the fit that it is part of.
    pub taken: Option<(TriedEffect, Fit, HeldOutErrors)>,
    /// What 95 % of random smooth terms with as many numbers as the best gain less than.
    pub placebo: f64,
}

/// An effect on trial.
pub struct Candidate {
    pub tried: TriedEffect,
    fitted: Option<(Fit, HeldOutErrors)>,
}

/// Try every effect on top of what is `chosen`. With `far`, fits may go where the atlas has yet to be simulated.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn step_forward(
    standing: &mut SearchState<'_>,
    chosen: &[usize],
    far: bool,
    progress: &dyn Progress,
) -> Result<Step> {
    let SearchState {
        problem,
        fit: now,
        held: held_now,
    } = standing;
    let mut candidates = Vec::new();
    for (rank, (effect, score)) in score_effects(problem, now, chosen).into_iter().enumerate() {
        let mut candidate = Candidate::new(effect, score);
        if rank < LEADERS
            && let Some(fit) = fit_with(problem, now, chosen, &[effect])
        {
            let held = held_out(problem, &fit.forms, &fit);
            candidate.judge(problem, fit, held, held_now);
        }
        candidates.push(candidate);
    }
    sort(&mut candidates);
    if far {
        for place in 0..LEADERS.min(candidates.len()) {
            let best = candidates[0].gain();
            let worth = if mean(held_now) - best > RESIDUAL {
                WORTH_FOLLOWING
            } else {
                WORTH_COMPARING
            };
            let candidate = &mut candidates[place];
            let wants = candidate.fitted.as_ref().is_some_and(|(fit, _)| problem.beyond(fit));
            if !wants || candidate.gain() < LEAST_GAIN.max(worth * best) {
                continue;
            }
            if let Some((fit, _)) = candidate.fitted.take() {
                let fit = problem.extend_and_fit(fit, progress)?;
                let held = held_out(problem, &fit.forms, &fit);
                candidate.judge(problem, fit, held, held_now);
            }
        }
        sort(&mut candidates);
    }
    let numbers = candidates.first().map_or(1, |c| c.tried.values.len().max(1));
    let mut placebo = None;
    let mut taken = None;
    for (place, candidate) in candidates.iter_mut().enumerate() {
        if candidate.fitted.is_none() {
            continue;
        }
        candidate.tried.rejected = if let Some(fault) = candidate.fault(problem, held_now) {
            Some(fault)
        } else if taken.is_some() {
            Some(Rejection::Second)
        } else {
            let numbers = candidate.tried.values.len();
            let chance = null_gain(problem, now, held_now, numbers);
            placebo.get_or_insert(chance);
            if candidate.gain() <= chance {
                Some(Rejection::Placebo)
            } else {
                taken = Some(place);
                None
            }
        };
    }
    let placebo = match placebo {
        Some(placebo) => placebo,
        None => null_gain(problem, now, held_now, numbers),
    };
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
    Ok(Step {
        tried,
        leaders,
        taken,
        placebo,
    })
}

/// Whether numbers lie within what physics allows, not at its ends.
pub fn physical(problem: &Problem<'_>, fit: &Fit, slots: &[usize]) -> bool {
    slots.iter().all(|&s| {
        let (a, b) = problem.simulator.slots[s].parameter.range;
        let room = 1e-6 * (b - a);
        fit.theta[s] > a + room && fit.theta[s] < b - room || fit.theta[s] == 0.0
    })
}

/// The best fit of some effects on top of what is `chosen`, from wherever fits of theirs begin.
pub fn fit_with(problem: &Problem<'_>, now: &Fit, chosen: &[usize], effects: &[usize]) -> Option<Fit> {
    let active = problem.simulator.slots_of_all(&[chosen, effects].concat());
    let begin = |from: Vec<Fit>, effect: &usize| from.iter().flat_map(|f| starts(problem, *effect, f)).collect();
    let fits = effects.iter().fold(vec![now.clone()], begin).into_iter();
    fits.map(|from| problem.fit(&active, &from))
        .min_by(|a, b| a.chi2.total_cmp(&b.chi2))
}

/// Where fits of an effect begin: where one is, or on each side of zero if those know nothing of one another.
fn starts(problem: &Problem<'_>, effect: usize, now: &Fit) -> Vec<Fit> {
    if !problem.simulator.effects[effect].kinked() {
        return vec![now.clone()];
    }
    let mut starts = vec![now.clone()];
    for slot in problem.simulator.slots_of(effect) {
        let typical = problem.simulator.slots[slot].parameter.typical;
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

fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| {
        let score = b.tried.score.total_cmp(&a.tried.score);
        b.gain().total_cmp(&a.gain()).then(score)
    });
}

impl Candidate {
    /// Not fitted yet.
    pub fn new(effect: usize, score: f64) -> Self {
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

    /// With a fit that it is part of, and the error of that on captures left out.
    pub fn judge(&mut self, problem: &Problem<'_>, fit: Fit, held: HeldOutErrors, held_now: &HeldOutErrors) {
        self.tried.gain = Some(gain(problem, held_now, &held));
        let slots = problem.simulator.slots_of(self.tried.effect);
        self.tried.values = slots.iter().map(|&s| fit.theta[s]).collect();
        self.fitted = Some((fit, held));
    }

    fn gain(&self) -> f64 {
        self.tried.gain.map_or(f64::MIN, |g| g.0)
    }

    /// Why it cannot be what is there, whatever others do.
    pub fn fault(&self, problem: &Problem<'_>, held_now: &HeldOutErrors) -> Option<Rejection> {
        let (value, [low, _]) = self.tried.gain?;
        let (fit, _) = self.fitted.as_ref()?;
        let above_noise = (mean(held_now) - 1.0).max(1e-6);
        let slots = problem.simulator.slots_of(self.tried.effect);
        if value < LEAST_GAIN {
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
        let widths = half_widths(problem, fit);
        let sure = slots
            .iter()
            .any(|&s| fit.place(s).is_some_and(|k| fit.theta[s].abs() > widths[k]));
        (!sure).then_some(Rejection::Nothing)
    }
}
