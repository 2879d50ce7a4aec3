//! Nonlinear least squares (Levenberg-Marquardt) over any of the parameters, with the nuisances alongside.

use metalith_core::{Progress, Result};
use nalgebra::{DMatrix, DVector};

use super::normal_equations::{NormalEquations, hold, minimise};
use crate::forward_model::{Model, ParameterPoint};
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::{MeasurementEquations, Measurements};
use crate::surrogate::Surrogate;

/// Most steps of a fit.
const STEPS: usize = 12;

/// A fit has converged when a step lowers chi-square by less than this share.
const CONVERGED: f64 = 1e-5;

/// Damping at the start, relative to the diagonal of the normal equations; its factors after a good and after
/// a bad step; its bounds.
const DAMPING: f64 = 1e-4;
const EASE: f64 = 0.2;
const STIFFEN: f64 = 20.0;
const LEAST_DAMPING: f64 = 1e-9;
const LEAST_AFTER_FAILURE: f64 = 1e-2;
const MOST_DAMPING: f64 = 1e6;

/// Measurements with a model of them.
#[derive(Clone)]
pub struct FitProblem<'a, M: Measurements> {
    pub model: &'a Model<'a, M>,
    pub surrogate: Surrogate<M>,
    pub data: &'a M,
    /// True if each measurement counts.
    pub used: PerMeasurement<bool>,
    /// Difference of a full simulation from the surrogate; none where the surrogate is used alone.
    pub correction: Option<PerMeasurement<M::Prediction>>,
}

/// A fit of some parameters.
#[derive(Clone)]
pub struct Fit<M: Measurements> {
    /// Slots of the parameters that were free.
    pub active: Vec<usize>,
    /// All parameters, by slot.
    pub theta: Vec<f64>,
    pub nuisances: M::Nuisances,
    /// Of each measurement, from which its own nuisances follow.
    measurements: PerMeasurement<M::Equations>,
    /// Over the shared nuisances and the active parameters, at the fit.
    pub equations: NormalEquations,
    /// Chi-square of all data that count, priors included.
    pub chi2: f64,
}

impl<M: Measurements> Fit<M> {
    /// Position of a slot among the active ones.
    pub fn position(&self, slot: usize) -> Option<usize> {
        self.active.iter().position(|s| *s == slot)
    }

    /// Of `values`, one for each active parameter, those of some slots.
    pub fn pick<T: Clone>(&self, slots: &[usize], values: &[T]) -> Vec<T> {
        let places = slots.iter().filter_map(|&s| self.position(s));
        places.map(|k| values[k].clone()).collect()
    }

    /// True if one of some parameters is farther from zero than its half-width; these are given for all active parameters.
    pub fn clears_zero(&self, slots: &[usize], half_widths: &[f64]) -> bool {
        let mut places = slots.iter().filter_map(|&s| Some((s, self.position(s)?)));
        places.any(|(s, k)| self.theta[s].abs() > half_widths[k])
    }
}

impl<'a, M: Measurements> FitProblem<'a, M> {
    /// All measurements count, and the surrogate is used alone.
    pub fn new(model: &'a Model<'a, M>, surrogate: Surrogate<M>, data: &'a M) -> Self {
        Self {
            model,
            surrogate,
            data,
            used: vec![true; data.count()].into(),
            correction: None,
        }
    }
}

impl<M: Measurements> FitProblem<'_, M> {
    /// Number of shared nuisances.
    pub fn shared(&self) -> usize {
        self.data.shared()
    }

    /// A fit of the nuisances alone.
    pub fn nuisance_fit(&self) -> Fit<M> {
        let theta = self.surrogate.about.clone();
        let predictions = self.data.for_each(|m| self.prediction(&theta, m));
        let nuisances = self.data.fitted_nuisances(&predictions, &self.used);
        self.at(&[], theta, nuisances)
    }

    /// The normal equations at given parameters.
    pub fn at(&self, active: &[usize], theta: Vec<f64>, nuisances: M::Nuisances) -> Fit<M> {
        let measurements = self.data.for_each(|c| {
            let prediction = self.prediction(&theta, c);
            let derivatives: Vec<_> = active
                .iter()
                .map(|&s| self.surrogate.derivative(&theta, s, c))
                .collect();
            self.data.equations(c, &nuisances, &prediction, &derivatives)
        });
        let equations = NormalEquations {
            measurements: measurements.iter().map(MeasurementEquations::reduced).collect(),
            references: self.reference_form(active, &theta),
        };
        let free: Vec<usize> = (0..self.shared()).collect();
        let (_, chi2) = minimise(&self.total(&equations, &nuisances), &free);
        Fit {
            active: active.to_vec(),
            theta,
            nuisances,
            measurements,
            equations,
            chi2,
        }
    }

    /// Fit the parameters in `active`, starting from another fit.
    pub fn fit(&self, active: &[usize], from: &Fit<M>) -> Fit<M> {
        let mut now = self.at(active, from.theta.clone(), from.nuisances.clone());
        let mut damping = DAMPING;
        for _ in 0..STEPS {
            let theta = self.damped_step(&now, damping);
            let moved: Vec<f64> = active.iter().map(|&s| theta[s] - now.theta[s]).collect();
            let nuisances = self.follow(&now, &moved);
            let next = self.at(active, theta, nuisances);
            if next.chi2 < now.chi2 {
                let gain = now.chi2 - next.chi2;
                now = next;
                damping = (damping * EASE).max(LEAST_DAMPING);
                if gain < CONVERGED * now.chi2 {
                    break;
                }
            } else {
                damping = (damping * STIFFEN).max(LEAST_AFTER_FAILURE);
                if damping > MOST_DAMPING {
                    break;
                }
            }
        }
        now
    }

    /// All parameters after one damped step, within the search range and what physics allows.
    fn damped_step(&self, now: &Fit<M>, damping: f64) -> Vec<f64> {
        let mut form = self.total(&now.equations, &now.nuisances);
        let (size, shared) = (form.nrows(), self.shared());
        for k in shared..size - 1 {
            form[(k, k)] *= 1.0 + damping;
        }
        let free: Vec<usize> = (0..size - 1).collect();
        let (step, _) = minimise(&form, &free);
        let mut theta = now.theta.clone();
        for (i, &slot) in now.active.iter().enumerate() {
            let (low, high) = self.surrogate.search_range(slot);
            let range = self.model.slots()[slot].parameter.range;
            theta[slot] = (theta[slot] + step[shared + i]).clamp(low.max(range.0), high.min(range.1));
        }
        theta
    }

    /// Nuisances after the parameters have moved: shared ones refitted for this move, then those of each measurement.
    fn follow(&self, now: &Fit<M>, moved: &[f64]) -> M::Nuisances {
        let shared = self.shared();
        let at: Vec<(usize, f64)> = moved.iter().enumerate().map(|(i, m)| (shared + i, *m)).collect();
        let form = hold(&self.total(&now.equations, &now.nuisances), &at);
        let (step, _) = minimise(&form, &(0..shared).collect::<Vec<_>>());
        let all = step.iter().copied().chain(moved.iter().copied());
        let all = DVector::from_iterator(shared + moved.len(), all);
        let mut out = now.nuisances.clone();
        self.data.advance(&mut out, &now.measurements, &all);
        out
    }

    /// The normal equations of each measurement over the shared nuisances and one parameter, where this has a value of its
    /// own in each measurement; and the nuisances that fit it.
    pub fn with_own_values(
        &self,
        fit: &Fit<M>,
        slot: usize,
        nuisances: &M::Nuisances,
        value: impl Fn(MeasurementIndex) -> Option<f64> + Sync,
    ) -> (PerMeasurement<DMatrix<f64>>, M::Nuisances) {
        let measurements = self.data.for_each(|c| {
            let mut theta = fit.theta.clone();
            theta[slot] = value(c).unwrap_or(theta[slot]);
            let derivative = self.surrogate.derivative(&theta, slot, c);
            self.data
                .equations(c, nuisances, &self.prediction(&theta, c), &[derivative])
        });
        let mut after = nuisances.clone();
        self.data
            .advance(&mut after, &measurements, &DVector::zeros(self.shared() + 1));
        (measurements.iter().map(MeasurementEquations::reduced).collect(), after)
    }

    /// The prediction of a measurement.
    pub fn prediction(&self, theta: &[f64], measurement: MeasurementIndex) -> M::Prediction {
        let prediction = self.surrogate.prediction(theta, measurement);
        match &self.correction {
            None => prediction,
            Some(correction) => M::combine(&[(&prediction, 1.0), (&correction[measurement], 1.0)]),
        }
    }

    /// Predictions of all measurements by the surrogate alone.
    pub fn surrogate_predictions(&self, theta: &[f64]) -> PerMeasurement<M::Prediction> {
        self.data
            .indices()
            .map(|c| self.surrogate.prediction(theta, c))
            .collect()
    }

    /// Correct the surrogate by a full simulation at these parameters.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn correct_at(&mut self, theta: &[f64], progress: &dyn Progress) -> Result<()> {
        let simulated = self
            .model
            .predictions(&[ParameterPoint::new(theta.to_vec())], progress)?
            .remove(0);
        let interpolated = self.surrogate_predictions(theta);
        let pairs = simulated.iter().zip(&interpolated);
        let difference = pairs.map(|(s, i)| M::combine(&[(s, 1.0), (i, -1.0)]));
        self.correction = Some(difference.collect());
        Ok(())
    }

    /// Sum of all that counts, with the prior of the shared nuisances.
    pub fn total(&self, equations: &NormalEquations, nuisances: &M::Nuisances) -> DMatrix<f64> {
        equations.sum(&self.used) + self.data.prior(nuisances, equations.size())
    }

    /// Points of the measurements that count.
    pub fn points(&self) -> f64 {
        let counted = self.data.indices().filter(|&c| self.used[c]);
        counted.map(|c| self.data.points(c) as f64).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{covariance, half_widths};
    use crate::fit::SIGMAS_95;
    use crate::measurements::Measurements;
    use crate::test_model::{LinearModel, SCALE, SIGMA, Term, Waves, information, setups};

    /// Measurements of two gains, two objects and two runs.
    const MEASUREMENTS: f64 = 8.0;

    /// Relative: what place, gain and offset make of the closed forms.
    const TOLERANCE: f64 = 1e-3;

    /// With orthogonal columns, an estimate is the product of its pattern with the residual over that with
    /// itself, whatever else is fitted.
    #[test]
    fn estimates_of_orthogonal_columns_are_projections() {
        let periods = [[2, 3], [5, 4], [3, 0]];
        let model = LinearModel::new(periods.map(Term::linear).to_vec(), setups(2, 2, 2));
        let data = model.data(|_| vec![0.01, -0.02, 0.0], Some(5));
        let problem = model.problem(&data);
        let start = problem.nuisance_fit();
        let fit = problem.fit(&[0, 1, 2], &start);
        let form = problem.total(&fit.equations, &fit.nuisances);
        let sigmas = covariance(&form, &(0..form.nrows() - 1).collect::<Vec<_>>());
        for (k, p) in periods.into_iter().enumerate() {
            let pattern = Waves::new(0.0, &[(p, 1.0)]).points([0.0; 2]);
            let projected: f64 = data
                .indices()
                .map(|c| {
                    let pairs = data.signal[c].iter().zip(&pattern);
                    pairs.map(|(s, p)| s * SCALE * p / SIGMA.powi(2)).sum::<f64>()
                })
                .sum();
            let expected = projected / (MEASUREMENTS * information());
            let sigma = (MEASUREMENTS * information()).sqrt().recip();
            // Gain and place change the size of a pattern in second order: by their noise.
            assert!(
                (fit.theta[k] - expected).abs() < TOLERANCE * expected.abs() + 0.02 * sigma,
                "{k}"
            );
            let own = sigmas[(problem.shared() + k, problem.shared() + k)].sqrt();
            assert!((own / sigma - 1.0).abs() < 3.0 * TOLERANCE, "{k}: {own} {sigma}");
        }
    }

    /// Two patterns with a correlation of rho: half-widths are wider by 1 / sqrt(1 - rho^2). Without noise, the
    /// bootstrap adds nothing.
    #[test]
    fn half_widths_of_correlated_columns_are_those_of_the_closed_form() {
        const RHO: f64 = 0.8;
        let (own, other) = ([5, 4], [4, 5]);
        let correlated = Term {
            amplitude: |theta| theta,
            patterns: vec![(own, RHO), (other, (1.0 - RHO * RHO).sqrt())],
        };
        let model = LinearModel::new(vec![Term::linear(own), correlated], setups(2, 2, 2));
        let data = model.data(|_| vec![0.01, 0.03], None);
        let problem = model.problem(&data);
        let fit = problem.fit(&[0, 1], &problem.nuisance_fit());
        let sigma = (MEASUREMENTS * information() * (1.0 - RHO * RHO)).sqrt().recip();
        for (k, parts) in half_widths(&problem, &fit).into_iter().enumerate() {
            let width = parts.half_width();
            let expected = SIGMAS_95 * sigma;
            assert!(
                (width / expected - 1.0).abs() < 10.0 * TOLERANCE,
                "{k}: {width} {expected}"
            );
        }
        for (found, truth) in fit.theta.iter().zip([0.01, 0.03]) {
            assert!((found / truth - 1.0).abs() < TOLERANCE, "{found} {truth}");
        }
    }
}
