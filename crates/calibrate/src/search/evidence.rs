//! The search on a whole set, repeated with defect noise where pillars are missing.

use std::sync::OnceLock;

use metalith_core::{Progress, Result};

use super::attribution::{Finding, attribute};
use super::defect_noise::DefectNoise;
use super::patterns::{Pattern, patterns};
use super::residual::may_leave;
use super::state::EndsSearch;
use crate::fit::{Data, FitProblem, mean_error};
use crate::forward_model::ForwardModel;
use crate::set::PerCapture;

/// Times that effects and defect noise are fitted in turn.
const ROUNDS: usize = 4;

/// They have converged when the share of missing pillars changes by less than this, relative.
const SHARE_CONVERGED: f64 = 0.05;

/// Before other effects are known, the shares by mean and by speckle may differ by this factor.
const SHARES_ALIKE: f64 = 4.0;

/// The shares by mean and by speckle agree if they differ by less than this, relative: the speckle is known from
/// a few draws, and the mean is seen through the speckle.
const SHARES_AGREE: f64 = 0.3;

/// A finding, and the data that it was judged by.
pub struct Evidence {
    pub finding: Finding,
    /// With defect noise, if there is any.
    pub data: Data,
    /// Whether each capture counts.
    pub used: PerCapture<bool>,
    /// Share of missing pillars by their speckle, where that counts as noise.
    pub missing_by_speckle: Option<f64>,
    /// Made when first asked for.
    patterns: OnceLock<Vec<Pattern>>,
}

impl Evidence {
    /// The problem that the finding solves.
    pub fn problem<'a>(&'a self, model: &'a dyn ForwardModel) -> FitProblem<'a> {
        problem_of(model, &self.data, &self.used, &self.finding)
    }

    /// Quantities that remove most of what is left if they are free for each element, colour, distance or angle; best first.
    pub fn patterns(&self, model: &dyn ForwardModel) -> &[Pattern] {
        let made = || patterns(&self.problem(model), &self.finding.after);
        self.patterns.get_or_init(made)
    }
}

fn problem_of<'a>(
    model: &'a dyn ForwardModel,
    data: &'a Data,
    used: &PerCapture<bool>,
    finding: &Finding,
) -> FitProblem<'a> {
    FitProblem {
        model,
        surrogate: finding.surrogate.clone(),
        data,
        used: used.clone(),
        correction: finding.correction.clone(),
    }
}

fn leaves_a_residual(problem: &FitProblem<'_>, finding: &Finding) -> bool {
    mean_error(&finding.held_after) > may_leave(problem, &finding.after)
}

/// Attribute the residual of a problem. With `full`, findings are refined with full simulations. `defects` is
/// the effect that strikes single pillars at random, with its noise; `ends` may end the search before all is tried.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub fn attribute_set(
    problem: &FitProblem<'_>,
    full: bool,
    defects: Option<(usize, &DefectNoise)>,
    ends: Option<&EndsSearch<'_>>,
    progress: &dyn Progress,
) -> Result<Evidence> {
    let plain = attribute(problem.clone(), full, ends, progress)?;
    let of_plain = problem_of(problem.model, problem.data, &problem.used, &plain);
    let is_open = !plain.was_ended && leaves_a_residual(&of_plain, &plain);
    let with_noise = match defects {
        Some((effect, noise)) if is_open => attribute_with_defects(problem, full, effect, noise, &plain, progress)?,
        _ => None,
    };
    Ok(with_noise.unwrap_or_else(|| Evidence {
        finding: plain,
        data: problem.data.clone(),
        used: problem.used.clone(),
        missing_by_speckle: None,
        patterns: OnceLock::new(),
    }))
}

/// The finding with the speckle of missing pillars treated as noise, if this explains what is left and the mean
/// of missing pillars agrees with it.
fn attribute_with_defects(
    problem: &FitProblem<'_>,
    full: bool,
    effect: usize,
    noise: &DefectNoise,
    plain: &Finding,
    progress: &dyn Progress,
) -> Result<Option<Evidence>> {
    let (model, camera_noise) = (problem.model, problem.data);
    let Some(&slot) = model.slots_of(effect).first() else {
        return Ok(None);
    };
    let of_plain = problem_of(model, camera_noise, &problem.used, plain);
    let mut active = plain.after.active.clone();
    if !active.contains(&slot) {
        active.push(slot);
    }
    let fit = of_plain.fit(&active, &plain.after);
    let mut share = noise.share(&of_plain, &fit);
    // Whatever else is there, the mean must show about this share before the search is repeated.
    if fit.theta[slot] < share / SHARES_ALIKE {
        return Ok(None);
    }
    let mut data = noise.added_to(&of_plain, &fit, share);
    for _ in 0..ROUNDS {
        if !DefectNoise::is_inside(share) {
            break;
        }
        let with_noise = FitProblem {
            data: &data,
            ..problem.clone()
        };
        let mut found = attribute(with_noise, full, None, progress)?;
        // The speckle is estimated against the noise of the camera alone.
        let bare = problem_of(model, camera_noise, &problem.used, &found);
        let next = noise.share(&bare, &found.after);
        if (next / share - 1.0).abs() >= SHARE_CONVERGED {
            share = next;
            data = noise.added_to(&bare, &found.after, share);
            continue;
        }
        let by_mean = found.after.theta[slot];
        let agree = (by_mean - share).abs() <= SHARES_AGREE * share.max(by_mean);
        if !(found.chosen.contains(&effect) && agree && !leaves_a_residual(&bare, &found)) {
            break;
        }
        // There are two estimates of one share: the interval includes both.
        if let Some(k) = found.after.position(slot) {
            let least = &mut found.half_widths[k].least;
            *least = least.max((by_mean - share).abs());
        }
        found.before = plain.before.clone();
        found.held_before.clone_from(&plain.held_before);
        return Ok(Some(Evidence {
            finding: found,
            data,
            used: problem.used.clone(),
            missing_by_speckle: Some(share),
            patterns: OnceLock::new(),
        }));
    }
    Ok(None)
}
