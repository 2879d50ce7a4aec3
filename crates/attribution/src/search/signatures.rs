//! Signatures: what each effect changes, compared with the residual and with one another.

use nalgebra::DMatrix;

use crate::fit::{Fit, FitProblem, minimise, projected};
use crate::measurements::Measurements;

/// Effects by the share of the residual that their signature explains, highest first; nuisances and what is
/// chosen are projected out.
pub(crate) fn score_effects<M: Measurements>(
    problem: &FitProblem<'_, M>,
    now: &Fit<M>,
    chosen: &[usize],
) -> Vec<(usize, f64)> {
    let sets = others(problem, chosen).into_iter().map(|e| [e]).collect();
    let scores = explained(problem, now, chosen, sets);
    scores.into_iter().map(|([e], score)| (e, score)).collect()
}

/// The same for all pairs of effects.
pub(crate) fn score_pairs<M: Measurements>(
    problem: &FitProblem<'_, M>,
    now: &Fit<M>,
    chosen: &[usize],
) -> Vec<([usize; 2], f64)> {
    let others = others(problem, chosen);
    let pairs = others
        .iter()
        .enumerate()
        .flat_map(|(k, &a)| others[k + 1..].iter().map(move |&b| [a, b]));
    explained(problem, now, chosen, pairs.collect())
}

fn others<M: Measurements>(problem: &FitProblem<'_, M>, chosen: &[usize]) -> Vec<usize> {
    (0..problem.model.effects()).filter(|e| !chosen.contains(e)).collect()
}

fn explained<M: Measurements, const N: usize>(
    problem: &FitProblem<'_, M>,
    now: &Fit<M>,
    chosen: &[usize],
    sets: Vec<[usize; N]>,
) -> Vec<([usize; N], f64)> {
    let form = form_of_all(problem, now);
    let shared = problem.shared();
    let base: Vec<usize> = (0..shared)
        .chain(problem.model.slots_of_all(chosen).into_iter().map(|s| shared + s))
        .collect();
    let (_, without) = minimise(&form, &base);
    let mut scores: Vec<([usize; N], f64)> = sets
        .into_iter()
        .map(|set| {
            let own = problem.model.slots_of_all(&set).into_iter();
            let free: Vec<usize> = base.iter().copied().chain(own.map(|s| shared + s)).collect();
            let (_, with) = minimise(&form, &free);
            (set, ((without - with) / without).max(0.0))
        })
        .collect();
    scores.sort_by(|a, b| b.1.total_cmp(&a.1));
    scores
}

/// Normal equations over all parameters of all effects.
fn form_of_all<M: Measurements>(problem: &FitProblem<'_, M>, now: &Fit<M>) -> DMatrix<f64> {
    let slots: Vec<usize> = (0..problem.model.slots().len()).collect();
    let wide = problem.at(&slots, now.theta.clone(), now.nuisances.clone());
    problem.total(&wide.equations, &wide.nuisances)
}

/// Cosines between the signatures of all parameters, nuisances projected out, weighted by the noise of this set.
pub fn cosines<M: Measurements>(problem: &FitProblem<'_, M>, at: &Fit<M>) -> DMatrix<f64> {
    let form = form_of_all(problem, at);
    let n = problem.model.slots().len();
    let g = projected(&form, problem.shared());
    DMatrix::from_fn(n, n, |i, j| {
        let size = (g[(i, i)] * g[(j, j)]).sqrt();
        if size > 0.0 { g[(i, j)] / size } else { 0.0 }
    })
}
