//! Patterns: one quantity, fitted free in each group of measurements.
//!
//! What no effect explains may be a known quantity that is not the same everywhere. Each parameter is fitted with a value
//! in each group of measurements, on top of what was found, linear about it; the best patterns are then fitted
//! with the surrogate itself. Where one removes much of the residual, its values say which effect is missing.

use nalgebra::DMatrix;

use crate::fit::{Fit, FitProblem, covariance, minimise};
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::Measurements;

/// A pattern is reported if it removes this share of the chi-square above noise.
const WORTH_SAYING: f64 = 0.5;

/// Most patterns that are reported, and that are fitted with the surrogate.
const REPORTED: usize = 3;

/// Gauss-Newton steps of a pattern.
const STEPS: usize = 6;

/// A quantity with its own value in each group.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// Parameter.
    pub slot: usize,
    /// The number of the grouping in [`Measurements::groupings`].
    pub by: usize,
    /// One measurement of each group.
    pub groups: Vec<MeasurementIndex>,
    /// Value and standard deviation in each.
    pub values: Vec<(f64, f64)>,
    /// Reduced chi-square per point with and without it.
    pub chi2: (f64, f64),
}

/// Patterns that remove most of what a fit leaves, the best first.
pub(crate) fn patterns<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>) -> Vec<Pattern> {
    let slots: Vec<usize> = (0..problem.model.slots().len()).collect();
    let wide = problem.at(&slots, fit.theta.clone(), fit.nuisances.clone());
    let points = problem.points();
    let shared = problem.shared();
    let mut found: Vec<(f64, usize, usize)> = Vec::new();
    let groupings = problem.data.groupings();
    for (by, grouping) in groupings.iter().enumerate() {
        let group = groups(problem, grouping);
        let count = group.iter().flatten().max().map_or(0, |m| m + 1);
        if count < 2 {
            continue;
        }
        for &slot in &slots {
            // Shared nuisances, what was found, the quantity in each group, the residual.
            let kept: Vec<usize> = (0..shared).chain(fit.active.iter().map(|s| shared + s)).collect();
            let size = kept.len() + count + 1;
            let mut form = DMatrix::zeros(size, size);
            for (c, own) in group.iter_enumerated() {
                let Some(own) = own else { continue };
                let from = &wide.equations.measurements[c];
                let columns: Vec<(usize, usize)> = kept
                    .iter()
                    .copied()
                    .enumerate()
                    .chain([(kept.len() + own, shared + slot), (size - 1, from.nrows() - 1)])
                    .collect();
                for &(i, a) in &columns {
                    for &(j, b) in &columns {
                        form[(i, j)] += from[(a, b)];
                    }
                }
            }
            form += problem.data.prior(&fit.nuisances, size);
            let (_, chi2) = minimise(&form, &(0..size - 1).collect::<Vec<_>>());
            found.push((chi2, slot, by));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let above = |chi2: f64| (chi2 / points - 1.0).max(0.0);
    let mut out: Vec<Pattern> = Vec::new();
    for (_, slot, by) in found.into_iter().take(REPORTED) {
        let pattern = fitted(problem, fit, slot, (by, &groupings[by]));
        if above(pattern.chi2.0 * points) <= (1.0 - WORTH_SAYING) * above(fit.chi2) {
            out.push(pattern);
        }
    }
    out.sort_by(|a, b| a.chi2.0.total_cmp(&b.chi2.0));
    out
}

/// The group of each measurement that counts.
fn groups<M: Measurements>(
    problem: &FitProblem<'_, M>,
    grouping: &PerMeasurement<usize>,
) -> PerMeasurement<Option<usize>> {
    let mut firsts: Vec<MeasurementIndex> = Vec::new();
    problem
        .data
        .indices()
        .map(|c| {
            if !problem.used[c] {
                return None;
            }
            let known = firsts.iter().position(|f| grouping[*f] == grouping[c]);
            Some(known.unwrap_or_else(|| {
                firsts.push(c);
                firsts.len() - 1
            }))
        })
        .collect()
}

/// A pattern fitted with the surrogate; what was found stays as it is.
fn fitted<M: Measurements>(
    problem: &FitProblem<'_, M>,
    fit: &Fit<M>,
    slot: usize,
    (by, grouping): (usize, &PerMeasurement<usize>),
) -> Pattern {
    let group = groups(problem, grouping);
    let count = group.iter().flatten().max().map_or(0, |m| m + 1);
    let (shared, points) = (problem.shared(), problem.points());
    let (low, high) = problem.surrogate.search_range(slot);
    let mut values = vec![fit.theta[slot]; count];
    let mut nuisances = fit.nuisances.clone();
    let mut sigmas = vec![0.0; count];
    let mut chi2 = fit.chi2;
    let mut best = values.clone();
    for step in 0..=STEPS {
        let (of_measurements, after) = problem.with_own_values(fit, slot, &nuisances, |c| group[c].map(|g| values[g]));
        let size = shared + count + 1;
        let mut form = problem.data.prior(&fit.nuisances, size);
        for (c, own) in group.iter_enumerated() {
            let Some(own) = own else { continue };
            let columns: Vec<(usize, usize)> = (0..shared)
                .map(|k| (k, k))
                .chain([(shared + own, shared), (size - 1, shared + 1)])
                .collect();
            for &(i, a) in &columns {
                for &(j, b) in &columns {
                    form[(i, j)] += of_measurements[c][(a, b)];
                }
            }
        }
        let free: Vec<usize> = (0..shared).collect();
        let (_, here) = minimise(&form, &free);
        if here < chi2 {
            chi2 = here;
            best.clone_from(&values);
            let all: Vec<usize> = (0..size - 1).collect();
            let covariance = covariance(&form, &all);
            let excess = (here / points).max(1.0);
            for (k, s) in sigmas.iter_mut().enumerate() {
                *s = (covariance[(shared + k, shared + k)] * excess).sqrt();
            }
        }
        if step < STEPS {
            let (move_by, _) = minimise(&form, &(0..size - 1).collect::<Vec<_>>());
            for (k, v) in values.iter_mut().enumerate() {
                *v = (*v + move_by[shared + k]).clamp(low, high);
            }
            nuisances = after;
        }
    }
    let firsts = (0..count).filter_map(|g| group.iter_enumerated().find(|(_, own)| **own == Some(g)).map(|f| f.0));
    Pattern {
        slot,
        by,
        groups: firsts.collect(),
        values: best.into_iter().zip(sigmas).collect(),
        chi2: (chi2 / points, fit.chi2 / points),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_model::{LinearModel, PARAMETER, Term, setups};

    /// One pattern of another size in each object: no single value explains it, and the free values are those of the
    /// objects.
    #[test]
    fn a_quantity_that_differs_by_object_is_read_in_each() {
        let truth = [0.6, -1.2, 1.0].map(|size| size * PARAMETER.typical);
        let model = LinearModel::new(
            vec![Term::linear([2, 3]), Term::linear([5, 4])],
            setups(2, truth.len(), 2),
        );
        // Measurements are by gain, object and run.
        let data = model.data(|c| vec![truth[(c / 2) % truth.len()], 0.0], Some(3));
        let problem = model.problem(&data);
        let fit = problem.nuisance_fit();
        let found = patterns(&problem, &fit);
        let best = found.first().expect("it explains all that is left");
        assert_eq!((best.slot, best.by), (0, 0));
        assert!(best.chi2.0 < 1.01, "{:?}", best.chi2);
        for ((value, sigma), truth) in best.values.iter().zip(truth) {
            // Five standard deviations: three draws.
            assert!((value - truth).abs() < 5.0 * sigma, "{value} {sigma} {truth}");
        }
    }
}
