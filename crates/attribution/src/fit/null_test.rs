//! Null test: what random smooth terms, which stand for no effect, gain on measurements left out.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cross_validation::{HeldOutErrors, SEED, held_out, mean_error};
use super::normal_equations::NormalEquations;
use super::problem::{Fit, FitProblem};
use crate::index::MeasurementIndex;
use crate::measurements::{MeasurementEquations, Measurements};

/// Random smooth terms that an effect is compared with.
const DRAWS: usize = 60;

/// An effect must gain more than this percentage of them.
const PERCENTILE: usize = 95;

impl<M: Measurements> FitProblem<'_, M> {
    /// Normal equations with further columns after those of the active parameters; `more` gives the changes for
    /// a unit of each in a measurement, from its prediction.
    pub fn equations_with(
        &self,
        now: &Fit<M>,
        more: impl Fn(MeasurementIndex, &M::Prediction) -> Vec<M::Prediction> + Sync + Send,
    ) -> NormalEquations {
        let measurements = self.data.for_each(|c| {
            let prediction = self.prediction(&now.theta, c);
            let active = now.active.iter().map(|&s| self.surrogate.derivative(&now.theta, s, c));
            let columns: Vec<_> = active.chain(more(c, &prediction)).collect();
            self.data.equations(c, &now.nuisances, &prediction, &columns).reduced()
        });
        let size = measurements.first().map_or(0, DMatrix::nrows);
        // Reference values do not depend on the further columns: their rows stay empty.
        let own = self.reference_form(&now.active, &now.theta);
        let mut references = DMatrix::zeros(size, size);
        let last = own.nrows() - 1;
        let place = |i: usize| if i == last { size - 1 } else { i };
        for i in 0..=last {
            for j in 0..=last {
                references[(place(i), place(j))] = own[(i, j)];
            }
        }
        NormalEquations {
            measurements,
            references,
        }
    }
}

/// The gain on measurements left out that 95 % of random smooth terms with so many parameters stay below; zero if
/// no smooth terms were simulated.
pub fn null_gain<M: Measurements>(
    problem: &FitProblem<'_, M>,
    now: &Fit<M>,
    errors_now: &HeldOutErrors,
    parameters: usize,
) -> f64 {
    let mut gains = null_gains(problem, now, errors_now, parameters);
    if gains.is_empty() {
        return 0.0;
    }
    gains.sort_by(f64::total_cmp);
    gains[(gains.len() - 1) * PERCENTILE / 100].max(0.0)
}

/// The gain of each random term.
pub(super) fn null_gains<M: Measurements>(
    problem: &FitProblem<'_, M>,
    now: &Fit<M>,
    errors_now: &HeldOutErrors,
    parameters: usize,
) -> Vec<f64> {
    let null_terms = problem.surrogate.null_terms();
    if null_terms == 0 {
        return Vec::new();
    }
    let wide = problem.equations_with(now, |c, prediction| {
        let terms = 0..null_terms;
        terms.map(|t| problem.surrogate.smooth_term(t, c, prediction)).collect()
    });
    let size = wide.size();
    let first = size - 1 - null_terms;
    let all: Vec<MeasurementIndex> = problem.data.indices().collect();
    let total = wide.sum_of(&all);
    let kept = first + parameters + 1;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    (0..DRAWS)
        .map(|_| {
            let mut mix = DMatrix::zeros(size, kept);
            for i in 0..first {
                mix[(i, i)] = 1.0;
            }
            mix[(size - 1, kept - 1)] = 1.0;
            for k in 0..parameters {
                for t in 0..null_terms {
                    let scale = total[(first + t, first + t)].max(f64::MIN_POSITIVE).sqrt();
                    mix[(first + t, first + k)] = rng.random_range(-1.0..1.0) / scale;
                }
            }
            mean_error(errors_now) - mean_error(&held_out(problem, &wide.mixed(&mix), now))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_model::{LinearModel, NULL_TERMS, POINTS, Term, information, setups, smooth_periods};

    /// Relative: what place, gain and offset make of the closed forms.
    const TOLERANCE: f64 = 2e-2;

    /// A residual that is one smooth pattern: a random direction c explains c1^2 / |c|^2 of it, in every measurement
    /// alike. All directions together explain all of it.
    #[test]
    fn random_terms_gain_their_projection_on_the_residual() {
        const AMPLITUDE: f64 = 0.01;
        let hidden = smooth_periods(0);
        let model = LinearModel::new(vec![Term::linear(hidden)], setups(2, 1, 1));
        let data = model.data(|_| vec![AMPLITUDE], None);
        let problem = model.problem(&data);
        let now = problem.nuisance_fit();
        let errors = held_out(&problem, &now.equations, &now);
        let whole = AMPLITUDE.powi(2) * information() / (POINTS * POINTS) as f64;
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut expected: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let c: Vec<f64> = (0..NULL_TERMS).map(|_| rng.random_range(-1.0..1.0)).collect();
                whole * c[0] * c[0] / c.iter().map(|v| v * v).sum::<f64>()
            })
            .collect();
        for (found, expected) in null_gains(&problem, &now, &errors, 1).iter().zip(&expected) {
            assert!((found - expected).abs() < TOLERANCE * whole, "{found} {expected}");
        }
        expected.sort_by(f64::total_cmp);
        let quantile = null_gain(&problem, &now, &errors, 1);
        // Three of sixty draws are above 95 %.
        assert!((quantile - expected[DRAWS - 4]).abs() < TOLERANCE * whole, "{quantile}");
        let all = null_gain(&problem, &now, &errors, NULL_TERMS);
        assert!((all / whole - 1.0).abs() < TOLERANCE, "{all} {whole}");
    }

    /// Without smooth terms there is nothing to compare with.
    #[test]
    fn nothing_is_gained_by_no_terms() {
        let model = LinearModel::new(vec![Term::linear([2, 3])], setups(2, 1, 1));
        let data = model.data(|_| vec![0.01], None);
        let mut problem = model.problem(&data);
        problem.surrogate = crate::surrogate::Surrogate::constant((*problem.surrogate.base).clone());
        let now = problem.nuisance_fit();
        let errors = held_out(&problem, &now.equations, &now);
        assert_eq!(null_gain(&problem, &now, &errors, 1), 0.0);
    }
}
