//! 95 % intervals of what a fit finds: noise, clusters of measurements that do not agree, and the error of the model.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cross_validation::{DRAWS, SEED, cluster_groups, ends_95};
use super::model_error::{IntervalParts, model_half_widths};
use super::normal_equations::{SIGMAS_95, covariance, minimise};
use super::problem::{Fit, FitProblem};
use crate::forward_model::ModelError;
use crate::measurements::Measurements;

/// 95 % half-widths of the active parameters of a fit: by a bootstrap over clusters of measurements, never less than the
/// noise alone gives, and wider by the error of the model. What each is made of.
pub fn half_widths<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>) -> Vec<IntervalParts> {
    widths_with(problem, fit, &problem.model.model_error())
}

/// The same by which a claim is judged: the model may err by as much as could be.
pub fn cautious_half_widths<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>) -> Vec<f64> {
    let own = widths_with(problem, fit, &problem.model.cautious_model_error()).into_iter();
    own.map(|parts| parts.half_width()).collect()
}

fn widths_with<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>, error: &ModelError) -> Vec<IntervalParts> {
    let slots = problem.model.slots();
    let sampled = sampled_half_widths(problem, fit).into_iter();
    let both = sampled.zip(model_half_widths(problem, fit, error)).zip(&fit.active);
    both.map(|((noise, of_model), &s)| {
        let (least, most) = slots[s].parameter.range;
        // A parameter that changes nothing here may have any value.
        IntervalParts { noise, ..of_model }.at_most(most - least)
    })
    .collect()
}

/// Covariance by the bootstrap and the noise.
fn sampled_half_widths<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>) -> Vec<f64> {
    let shared = problem.shared();
    let all: Vec<usize> = (0..fit.equations.size() - 1).collect();
    let groups = cluster_groups(problem);
    let of_group: Vec<DMatrix<f64>> = groups.iter().map(|g| fit.equations.sum_of(g)).collect();
    let rest = problem.data.prior(&fit.nuisances, fit.equations.size()) + &fit.equations.references;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut draws: Vec<Vec<f64>> = vec![Vec::new(); fit.active.len()];
    for _ in 0..DRAWS {
        let mut form = rest.clone();
        for _ in 0..of_group.len() {
            form += &of_group[rng.random_range(0..of_group.len())];
        }
        let (step, _) = minimise(&form, &all);
        for (k, d) in draws.iter_mut().enumerate() {
            d.push(step[shared + k]);
        }
    }
    let whole = problem.total(&fit.equations, &fit.nuisances);
    let covariance = covariance(&whole, &all);
    let excess = (fit.chi2 / problem.points()).max(1.0);
    draws
        .iter_mut()
        .enumerate()
        .map(|(k, d)| {
            let [low, high] = ends_95(d);
            let noise = SIGMAS_95 * (covariance[(shared + k, shared + k)] * excess).sqrt();
            (0.5 * (high - low)).max(low.abs()).max(high.abs()).max(noise)
        })
        .collect()
}
