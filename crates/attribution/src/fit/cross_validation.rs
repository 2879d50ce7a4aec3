//! Cross-validation: how well a fit predicts measurements that it has not seen.
//!
//! Groups of measurements are left out in turn; the rest is fitted, and what was left out is predicted, with nothing but
//! its own nuisances and the shared ones adjusted.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::normal_equations::{NormalEquations, hold, minimise, projected};
use super::problem::{Fit, FitProblem};
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::Measurements;

/// Nothing is predicted from a training set that holds less than this share of the information on a parameter, or on any
/// combination of them.
const UNINFORMED: f64 = 1e-3;

/// Least share of what all measurements say of a parameter that they say of it beside the others (rounding of
/// single-precision predictions): combinations that no measurement distinguishes are no matter of which is left out.
const TOLD_APART: f64 = 1e-7;

/// Draws of a bootstrap; enough for the ends of a 95 % interval.
pub(super) const DRAWS: usize = 400;

/// Seed of all draws: every run gives the same answer.
pub(crate) const SEED: u64 = 0x6d65_7461;

/// Reduced chi-square per point of each measurement when it was left out with its group, in each way of leaving out; none for
/// measurements that do not count, and where nothing could be learned from the others.
pub type HeldOutErrors = PerMeasurement<Vec<Option<f64>>>;

/// Gain of one error over another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Mean difference of reduced chi-square per point; positive is better.
    pub value: f64,
    /// Ends of its 95 % confidence interval.
    pub interval: [f64; 2],
}

/// The group of each measurement in each of the ways in which measurements are left out. Where all are alike in these, each
/// measurement is a separate group.
fn partitions<M: Measurements>(data: &M) -> Vec<PerMeasurement<usize>> {
    let mut ways = data.folds();
    let differs = |way: &PerMeasurement<usize>| way.iter().min() != way.iter().max();
    if !ways.iter().any(differs)
        && let Some(last) = ways.last_mut()
    {
        *last = (0..data.count()).collect();
    }
    ways
}

/// The error on measurements left out, of a fit or of anything that has normal equations about it.
pub fn held_out<M: Measurements>(
    problem: &FitProblem<'_, M>,
    equations: &NormalEquations,
    fit: &Fit<M>,
) -> HeldOutErrors {
    let ways = partitions(problem.data);
    let mut errors: HeldOutErrors = vec![vec![None; ways.len()]; problem.used.len()].into();
    let whole = problem.total(equations, &fit.nuisances);
    for (way, partition) in ways.into_iter().enumerate() {
        let groups = partition.iter().max().map_or(0, |m| m + 1);
        if partition.iter().min() == partition.iter().max() {
            continue;
        }
        for group in 0..groups {
            let out = |c: &MeasurementIndex| problem.used[*c] && partition[*c] == group;
            let left: Vec<MeasurementIndex> = problem.data.indices().filter(out).collect();
            let Some(at) = predicted(problem, equations, fit, &whole, &left) else {
                continue;
            };
            for &c in &left {
                let chi2 = (&equations.measurements[c] * &at).dot(&at);
                errors[c][way] = Some(chi2 / problem.data.points(c).max(1) as f64);
            }
        }
    }
    errors
}

/// The mean of what is known of one measurement.
pub fn error_of_measurement(errors: &[Option<f64>]) -> Option<f64> {
    mean(errors.iter().flatten().copied())
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0), |(sum, n), v| (sum + v, n + 1));
    (n > 0).then(|| sum / f64::from(n))
}

/// The coefficients of all columns that predict the measurements in `left` from all others; one for the residual.
/// None if there is nothing to predict, or not enough to predict it from.
fn predicted<M: Measurements>(
    problem: &FitProblem<'_, M>,
    equations: &NormalEquations,
    fit: &Fit<M>,
    whole: &DMatrix<f64>,
    left: &[MeasurementIndex],
) -> Option<DVector<f64>> {
    if left.is_empty() {
        return None;
    }
    let (shared, size) = (problem.shared(), equations.size());
    let own = equations.sum_of(left);
    let test = &own + problem.data.prior(&fit.nuisances, size);
    let train = whole - own;
    if least_information(&train, whole, shared) < UNINFORMED {
        return None;
    }
    let at = trained(problem, fit, &train);
    let (nuisances, _) = minimise(&hold(&test, &at), &(0..shared).collect::<Vec<_>>());
    let mut all = DVector::zeros(size);
    all[size - 1] = 1.0;
    for k in 0..shared {
        all[k] = -nuisances[k];
    }
    for (k, v) in at {
        all[k] = -v;
    }
    Some(all)
}

/// The least share of the information of `whole` on any combination of the parameters that is in `train`, nuisances projected out.
fn least_information(train: &DMatrix<f64>, whole: &DMatrix<f64>, shared: usize) -> f64 {
    let (train, whole) = (projected(train, shared), projected(whole, shared));
    // Of a parameter that shows nowhere, everything is known.
    let shown: Vec<usize> = (0..whole.nrows()).filter(|&k| whole[(k, k)] > 0.0).collect();
    let n = shown.len();
    if n == 0 {
        return 1.0;
    }
    let scaled = |of: &DMatrix<f64>| {
        DMatrix::from_fn(n, n, |i, j| {
            let (i, j) = (shown[i], shown[j]);
            of[(i, j)] / (whole[(i, i)] * whole[(j, j)]).sqrt()
        })
    };
    // Relative to the whole, whose combinations are first made alike: train v = share whole v.
    let all = scaled(&whole).symmetric_eigen();
    let told: Vec<usize> = (0..n).filter(|&k| all.eigenvalues[k] > TOLD_APART).collect();
    let to_whole = DMatrix::from_fn(n, told.len(), |i, k| {
        all.eigenvectors[(i, told[k])] / all.eigenvalues[told[k]].sqrt()
    });
    let shares = (to_whole.transpose() * scaled(&train) * to_whole).symmetric_eigenvalues();
    shares.iter().copied().fold(1.0, f64::min)
}

/// The parameters that the training data ask for, as steps from the fit, none beyond what physics allows.
fn trained<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>, train: &DMatrix<f64>) -> Vec<(usize, f64)> {
    let shared = problem.shared();
    let count = train.nrows() - 1;
    let mut at: Vec<(usize, f64)> = Vec::new();
    loop {
        let free: Vec<usize> = (0..count).filter(|k| !at.iter().any(|(h, _)| h == k)).collect();
        let (step, _) = minimise(&hold(train, &at), &free);
        let mut more: Vec<(usize, f64)> = Vec::new();
        for (&k, &step) in free.iter().zip(step.iter()).filter(|(k, _)| **k >= shared) {
            let Some(&slot) = fit.active.get(k - shared) else {
                continue;
            };
            let (low, high) = problem.model.slots()[slot].parameter.range;
            let wanted = fit.theta[slot] + step;
            if !(low..=high).contains(&wanted) {
                more.push((k, wanted.clamp(low, high) - fit.theta[slot]));
            }
        }
        if more.is_empty() {
            let last = free.iter().zip(step.iter()).filter(|(k, _)| **k >= shared);
            at.extend(last.map(|(k, s)| (*k, *s)));
            at.sort_by_key(|a| a.0);
            return at;
        }
        at.extend(more);
    }
}

/// Mean over measurements.
pub fn mean_error(errors: &HeldOutErrors) -> f64 {
    mean(errors.iter().filter_map(|own| error_of_measurement(own))).unwrap_or(0.0)
}

/// Gain of the error `after` over the error `before`, of what both predict, with a 95 % interval by a bootstrap over
/// clusters: points are not independent, nor are measurements of one cluster.
pub fn gain<M: Measurements>(problem: &FitProblem<'_, M>, before: &HeldOutErrors, after: &HeldOutErrors) -> Gain {
    let differences: Vec<(f64, f64)> = cluster_groups(problem)
        .iter()
        .map(|g| {
            let own: Vec<f64> = g.iter().filter_map(|&c| difference(&before[c], &after[c])).collect();
            (own.iter().sum(), own.len() as f64)
        })
        .filter(|(_, n): &(f64, f64)| *n > 0.0)
        .collect();
    let mean = |picked: &mut dyn Iterator<Item = (f64, f64)>| {
        let (sum, n) = picked.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        if n > 0.0 { sum / n } else { 0.0 }
    };
    if differences.is_empty() {
        return Gain {
            value: 0.0,
            interval: [0.0, 0.0],
        };
    }
    let value = mean(&mut differences.iter().copied());
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut draws: Vec<f64> = (0..DRAWS)
        .map(|_| mean(&mut (0..differences.len()).map(|_| differences[rng.random_range(0..differences.len())])))
        .collect();
    Gain {
        value,
        interval: ends_95(&mut draws),
    }
}

/// Gain in the error of one measurement, in those ways of leaving it out that both fits know.
fn difference(before: &[Option<f64>], after: &[Option<f64>]) -> Option<f64> {
    mean(before.iter().zip(after).filter_map(|(b, a)| Some((*b)? - (*a)?)))
}

/// Least number of groups whose draws tell how sure something is.
const LEAST_GROUPS: usize = 3;

/// The measurements of each cluster that count; each measurement alone where there are too few clusters to draw from.
pub fn cluster_groups<M: Measurements>(problem: &FitProblem<'_, M>) -> Vec<Vec<MeasurementIndex>> {
    let cluster = problem.data.clusters();
    let counted = || problem.data.indices().filter(|&c| problem.used[c]);
    let mut groups: Vec<Vec<MeasurementIndex>> = Vec::new();
    for c in counted() {
        match groups.iter_mut().find(|g| cluster[g[0]] == cluster[c]) {
            Some(group) => group.push(c),
            None => groups.push(vec![c]),
        }
    }
    if groups.len() < LEAST_GROUPS {
        counted().map(|c| vec![c]).collect()
    } else {
        groups
    }
}

/// The ends of a 95 % interval of some draws.
pub(super) fn ends_95(draws: &mut [f64]) -> [f64; 2] {
    draws.sort_by(f64::total_cmp);
    let at = |share: f64| draws[((draws.len() - 1) as f64 * share).round() as usize];
    [at(0.025), at(0.975)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_model::{LinearModel, POINTS, Term, information, setups};

    const PERIODS: [u32; 2] = [2, 3];

    /// Relative: what place, gain and offset make of the closed forms.
    const TOLERANCE: f64 = 5e-3;

    fn model(gains: usize, objects: usize) -> LinearModel {
        LinearModel::new(vec![Term::linear(PERIODS)], setups(gains, objects, 1))
    }

    /// One group asks for a, the other for b: each is predicted with the other's, and errs by a - b.
    #[test]
    fn a_group_is_predicted_with_the_parameters_of_the_others() {
        let (a, b) = (0.01, 0.03);
        let model = model(2, 1);
        let data = model.data(|c| vec![[a, b][c]], None);
        let problem = model.problem(&data);
        let fit = problem.fit(&[0], &problem.nuisance_fit());
        assert!((fit.theta[0] / (0.5 * (a + b)) - 1.0).abs() < TOLERANCE);
        let expected = (a - b).powi(2) * information() / (POINTS * POINTS) as f64;
        for error in held_out(&problem, &fit.equations, &fit) {
            let error = error_of_measurement(&error).unwrap();
            assert!((error / expected - 1.0).abs() < TOLERANCE, "{error} {expected}");
        }
    }

    /// Two objects see two parameters as a + b and as a - b: either alone tells of both parameters, and of
    /// one combination nothing.
    #[test]
    fn a_combination_that_no_training_measurement_tells_of_is_not_predicted() {
        // One nuisance that no parameter is like, two parameters, the residual.
        let form = |a: f64, b: f64| {
            let column = DVector::from_vec(vec![0.0, a, b, 0.0]);
            let mut form = &column * column.transpose();
            (form[(0, 0)], form[(3, 3)]) = (1.0, 1.0);
            form
        };
        let (one, other) = (form(1.0, 1.0), form(1.0, -1.0));
        let whole = &one + &other;
        // Rounding.
        assert!(least_information(&one, &whole, 1).abs() < 1e-12);
        // Of the second combination a tenth is left.
        let train = one + other * 0.1;
        assert!((least_information(&train, &whole, 1) - 0.1).abs() < 1e-12);
    }

    /// Where all measurements agree, nothing is left; where nothing is fitted, the whole pattern is left.
    #[test]
    fn what_all_measurements_agree_on_is_predicted() {
        /// Reduced chi-square per point: rounding at a signal of 100 sigma.
        const ROUNDING: f64 = 1e-4;
        let theta = 0.02;
        let model = model(2, 2);
        let data = model.data(|_| vec![theta], None);
        let problem = model.problem(&data);
        let nothing = problem.nuisance_fit();
        let fit = problem.fit(&[0], &nothing);
        let before = held_out(&problem, &nothing.equations, &nothing);
        let after = held_out(&problem, &fit.equations, &fit);
        let expected = theta * theta * information() / (POINTS * POINTS) as f64;
        assert!((mean_error(&before) / expected - 1.0).abs() < TOLERANCE);
        assert!(mean_error(&after) < ROUNDING, "{}", mean_error(&after));
        // All measurements gain the same: no draw of the bootstrap differs.
        let gain = gain(&problem, &before, &after);
        for end in gain.interval {
            assert!((end / gain.value - 1.0).abs() < TOLERANCE, "{gain:?}");
        }
        assert!((gain.value / expected - 1.0).abs() < TOLERANCE);
    }

    #[test]
    fn the_bootstrap_of_two_groups_has_the_ends_of_these_groups() {
        let model = model(2, 1);
        let data = model.data(|_| vec![0.0], None);
        let problem = model.problem(&data);
        // What only one of them predicts is not compared.
        let before: HeldOutErrors = vec![vec![Some(9.0), Some(3.0), None], vec![None, Some(5.0), None]].into();
        let after: HeldOutErrors = vec![vec![None, Some(2.0), Some(0.0)], vec![None, Some(1.0), None]].into();
        // Differences 1 and 4: of two draws, both are the first in a quarter of the cases.
        let gain = gain(&problem, &before, &after);
        assert_eq!(
            gain,
            Gain {
                value: 2.5,
                interval: [1.0, 4.0]
            }
        );
        // A measurement that does not count takes no part.
        let mut problem = problem.clone();
        problem.used[MeasurementIndex::from(1)] = false;
        assert_eq!(super::gain(&problem, &before, &after).value, 1.0);
    }
}
