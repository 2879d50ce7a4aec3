//! The search on all measurements, repeated where an effect that strikes at random adds noise.

use std::sync::OnceLock;

use metalith_core::{Progress, Result};

use super::attribute::{Finding, attribute};
use super::patterns::{Pattern, patterns};
use super::residual::may_leave;
use super::state::EndsSearch;
use crate::fit::{Fit, FitProblem, mean_error};
use crate::forward_model::Model;
use crate::index::PerMeasurement;
use crate::measurements::Measurements;

/// Times that effects and the noise of a random effect are fitted in turn.
const ROUNDS: usize = 4;

/// They have converged when the amount of the random effect changes by less than this, relative.
const AMOUNT_CONVERGED: f64 = 0.05;

/// Before other effects are known, the amounts by mean and by noise may differ by this factor.
const AMOUNTS_ALIKE: f64 = 4.0;

/// The amounts by mean and by noise agree if they differ by less than this, relative: the noise is known from a few draws,
/// and the mean is seen through the noise.
const AMOUNTS_AGREE: f64 = 0.3;

/// The noise of an effect that strikes at random places: its mean is an effect like any other, its scatter is noise whose
/// variance follows from the amount of the effect.
pub trait RandomNoise<M: Measurements> {
    /// The amount that the residual of a fit asks for.
    fn amount(&self, problem: &FitProblem<'_, M>, fit: &Fit<M>) -> f64;

    /// True if an amount is an estimate, and not the end of what was searched.
    fn is_estimate(&self, amount: f64) -> bool;

    /// The data with the noise of an amount of the effect added to theirs.
    fn added_to(&self, problem: &FitProblem<'_, M>, fit: &Fit<M>, amount: f64) -> M;
}

/// A finding, and the data that it was judged by.
pub struct Evidence<M: Measurements> {
    pub finding: Finding<M>,
    /// With the noise of a random effect, if there is any.
    pub data: M,
    /// True if each measurement counts.
    pub used: PerMeasurement<bool>,
    /// Amount of the random effect by its noise, where that counts as noise.
    pub amount_by_noise: Option<f64>,
    /// Made when first asked for.
    patterns: OnceLock<Vec<Pattern>>,
}

impl<M: Measurements> Evidence<M> {
    /// The problem that the finding solves.
    pub fn problem<'a>(&'a self, model: &'a Model<'a, M>) -> FitProblem<'a, M> {
        problem_of(model, &self.data, &self.used, &self.finding)
    }

    /// Quantities that remove most of the residual if they are free in each group of measurements; best first.
    pub fn patterns(&self, model: &Model<'_, M>) -> &[Pattern] {
        let made = || patterns(&self.problem(model), &self.finding.after);
        self.patterns.get_or_init(made)
    }
}

fn problem_of<'a, M: Measurements>(
    model: &'a Model<'a, M>,
    data: &'a M,
    used: &PerMeasurement<bool>,
    finding: &Finding<M>,
) -> FitProblem<'a, M> {
    FitProblem {
        model,
        surrogate: finding.surrogate.clone(),
        data,
        used: used.clone(),
        correction: finding.correction.clone(),
    }
}

fn leaves_a_residual<M: Measurements>(problem: &FitProblem<'_, M>, finding: &Finding<M>) -> bool {
    mean_error(&finding.held_after) > may_leave(problem, &finding.after)
}

/// Attribute the residual of a problem. With `full`, findings are refined with full simulations. `random` is
/// the effect that strikes at random places, with its noise; `ends` may end the search before all is tried.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub fn attribute_set<M: Measurements>(
    problem: &FitProblem<'_, M>,
    full: bool,
    random: Option<(usize, &dyn RandomNoise<M>)>,
    ends: Option<&EndsSearch<'_, M>>,
    progress: &dyn Progress,
) -> Result<Evidence<M>> {
    let plain = attribute(problem.clone(), full, ends, progress)?;
    let of_plain = problem_of(problem.model, problem.data, &problem.used, &plain);
    let is_open = !plain.was_ended && leaves_a_residual(&of_plain, &plain);
    let with_noise = match random {
        Some((effect, noise)) if is_open => attribute_with_noise(problem, full, effect, noise, &plain, progress)?,
        _ => None,
    };
    Ok(with_noise.unwrap_or_else(|| Evidence {
        finding: plain,
        data: problem.data.clone(),
        used: problem.used.clone(),
        amount_by_noise: None,
        patterns: OnceLock::new(),
    }))
}

/// The finding with the scatter of a random effect treated as noise, if this explains the residual and the mean of the
/// effect agrees with it.
fn attribute_with_noise<M: Measurements>(
    problem: &FitProblem<'_, M>,
    full: bool,
    effect: usize,
    noise: &dyn RandomNoise<M>,
    plain: &Finding<M>,
    progress: &dyn Progress,
) -> Result<Option<Evidence<M>>> {
    let (model, plain_data) = (problem.model, problem.data);
    let Some(&slot) = model.slots_of(effect).first() else {
        return Ok(None);
    };
    let of_plain = problem_of(model, plain_data, &problem.used, plain);
    let mut active = plain.after.active.clone();
    if !active.contains(&slot) {
        active.push(slot);
    }
    let fit = of_plain.fit(&active, &plain.after);
    let mut amount = noise.amount(&of_plain, &fit);
    // Whatever else is there, the mean must show about this amount before the search is repeated.
    if fit.theta[slot] < amount / AMOUNTS_ALIKE {
        return Ok(None);
    }
    let mut data = noise.added_to(&of_plain, &fit, amount);
    for _ in 0..ROUNDS {
        if !noise.is_estimate(amount) || model.is_spent() {
            break;
        }
        let with_noise = FitProblem {
            data: &data,
            ..problem.clone()
        };
        let mut found = attribute(with_noise, full, None, progress)?;
        // The scatter is estimated against the stated noise alone.
        let bare = problem_of(model, plain_data, &problem.used, &found);
        let next = noise.amount(&bare, &found.after);
        if (next / amount - 1.0).abs() >= AMOUNT_CONVERGED {
            amount = next;
            data = noise.added_to(&bare, &found.after, amount);
            continue;
        }
        let by_mean = found.after.theta[slot];
        let agree = (by_mean - amount).abs() <= AMOUNTS_AGREE * amount.max(by_mean);
        if !(found.chosen.contains(&effect) && agree && !leaves_a_residual(&bare, &found)) {
            break;
        }
        // There are two estimates of one amount: the interval includes both.
        if let Some(k) = found.after.position(slot) {
            let least = &mut found.half_widths[k].least;
            *least = least.max((by_mean - amount).abs());
        }
        found.before = plain.before.clone();
        found.held_before.clone_from(&plain.held_before);
        return Ok(Some(Evidence {
            finding: found,
            data,
            used: problem.used.clone(),
            amount_by_noise: Some(amount),
            patterns: OnceLock::new(),
        }));
    }
    Ok(None)
}
