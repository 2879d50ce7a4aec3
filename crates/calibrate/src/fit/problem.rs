//! Nonlinear least squares (Levenberg-Marquardt) over any of the parameters, with the nuisances alongside.

use metalith_core::{Progress, Result};
use nalgebra::{DMatrix, DVector};

use super::capture_equations::CaptureEquations;
use super::data::Data;
use super::normal_equations::{NormalEquations, hold, minimise};
use super::nuisances::Nuisances;
use super::registration::whole_pixel_shift;
use crate::forward_model::{ForwardModel, ParameterPoint};
use crate::optics::PixelGrid;
use crate::set::{CaptureIndex, PerCapture};
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

/// A set of captures with a model of them.
#[derive(Clone)]
pub struct FitProblem<'a> {
    pub model: &'a dyn ForwardModel,
    pub surrogate: Surrogate,
    pub data: &'a Data,
    /// Whether each capture counts.
    pub used: PerCapture<bool>,
    /// What a full simulation adds to the surrogate; none where the surrogate is used alone.
    pub correction: Option<PerCapture<PixelGrid>>,
}

/// A fit of some parameters.
#[derive(Clone)]
pub struct Fit {
    /// Slots of the parameters that were free.
    pub active: Vec<usize>,
    /// All parameters, by slot.
    pub theta: Vec<f64>,
    pub nuisances: Nuisances,
    /// Of each capture, from which its registration follows.
    captures: PerCapture<CaptureEquations>,
    /// Over flux, black level and the active parameters, at the fit.
    pub equations: NormalEquations,
    /// Chi-square of all data that count, priors included.
    pub chi2: f64,
}

impl Fit {
    /// Position of a slot among the active ones.
    pub fn position(&self, slot: usize) -> Option<usize> {
        self.active.iter().position(|s| *s == slot)
    }

    /// Of `values`, one for each active parameter, those of some slots.
    pub fn pick<T: Copy>(&self, slots: &[usize], values: &[T]) -> Vec<T> {
        let places = slots.iter().filter_map(|&s| self.position(s));
        places.map(|k| values[k]).collect()
    }

    /// Whether one of some parameters is farther from zero than its half-width; these are given for all active parameters.
    pub fn clears_zero(&self, slots: &[usize], half_widths: &[f64]) -> bool {
        let mut places = slots.iter().filter_map(|&s| Some((s, self.position(s)?)));
        places.any(|(s, k)| self.theta[s].abs() > half_widths[k])
    }
}

impl<'a> FitProblem<'a> {
    /// All captures count, and the surrogate is used alone.
    pub fn new(model: &'a dyn ForwardModel, surrogate: Surrogate, data: &'a Data) -> Self {
        Self {
            model,
            surrogate,
            data,
            used: vec![true; data.signal.len()].into(),
            correction: None,
        }
    }
}

impl FitProblem<'_> {
    /// Number of shared nuisances: flux of each LED, and black level.
    pub fn shared(&self) -> usize {
        self.data.leds + 1
    }

    /// A fit of the nuisances alone.
    pub fn nuisance_fit(&self) -> Fit {
        let theta = self.surrogate.about.clone();
        let images = self.data.for_captures(|c| self.image(&theta, c));
        let mut nuisances = Nuisances::stated(self.data);
        nuisances.shift_um = self.data.for_captures(|c| {
            let shift = whole_pixel_shift(&self.data.signal[c], &images[c].pixels([0.0; 2]));
            shift.map(|pixels| pixels * self.data.pixel_um)
        });
        let nuisances = nuisances.fit(self.data, &images, &self.used);
        self.at(&[], theta, nuisances)
    }

    /// The normal equations at given parameters.
    pub fn at(&self, active: &[usize], theta: Vec<f64>, nuisances: Nuisances) -> Fit {
        let captures = self.data.for_captures(|c| {
            let image = self.image(&theta, c);
            let slopes: Vec<_> = active.iter().map(|&s| self.surrogate.slope(&theta, s, c)).collect();
            CaptureEquations::new(self.data, c, &nuisances, &image, &slopes)
        });
        let equations = NormalEquations {
            captures: captures.iter().map(CaptureEquations::reduced).collect(),
            widths: self.width_form(active, &theta),
        };
        let free: Vec<usize> = (0..self.shared()).collect();
        let (_, chi2) = minimise(&self.total(&equations, &nuisances), &free);
        Fit {
            active: active.to_vec(),
            theta,
            nuisances,
            captures,
            equations,
            chi2,
        }
    }

    /// Fit the parameters in `active`, starting from another fit.
    pub fn fit(&self, active: &[usize], from: &Fit) -> Fit {
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
    fn damped_step(&self, now: &Fit, damping: f64) -> Vec<f64> {
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

    /// Nuisances after the parameters have moved: shared ones refitted for this move, then registration.
    fn follow(&self, now: &Fit, moved: &[f64]) -> Nuisances {
        let shared = self.shared();
        let at: Vec<(usize, f64)> = moved.iter().enumerate().map(|(i, m)| (shared + i, *m)).collect();
        let form = hold(&self.total(&now.equations, &now.nuisances), &at);
        let (step, _) = minimise(&form, &(0..shared).collect::<Vec<_>>());
        let all = step.iter().copied().chain(moved.iter().copied());
        let all = DVector::from_iterator(shared + moved.len(), all);
        let mut out = now.nuisances.clone();
        out.advance(self.data, &now.captures, &all);
        out
    }

    /// The normal equations of each capture over flux, black level and one parameter, where this has a value of its own in
    /// each capture; and the nuisances with the registration that fits it.
    pub fn with_own_values(
        &self,
        fit: &Fit,
        slot: usize,
        nuisances: &Nuisances,
        value: impl Fn(CaptureIndex) -> Option<f64> + Sync,
    ) -> (PerCapture<DMatrix<f64>>, Nuisances) {
        let captures = self.data.for_captures(|c| {
            let mut theta = fit.theta.clone();
            theta[slot] = value(c).unwrap_or(theta[slot]);
            let slope = self.surrogate.slope(&theta, slot, c);
            CaptureEquations::new(self.data, c, nuisances, &self.image(&theta, c), &[slope])
        });
        let mut after = nuisances.clone();
        after.advance(self.data, &captures, &DVector::zeros(self.shared() + 1));
        (captures.iter().map(CaptureEquations::reduced).collect(), after)
    }

    /// Predicted image of a capture.
    pub fn image(&self, theta: &[f64], capture: CaptureIndex) -> PixelGrid {
        let image = self.surrogate.image(theta, capture);
        match &self.correction {
            None => image,
            Some(correction) => PixelGrid::combine(&[(&image, 1.0), (&correction[capture], 1.0)]),
        }
    }

    /// Images of all captures by the surrogate alone.
    pub fn surrogate_images(&self, theta: &[f64]) -> PerCapture<PixelGrid> {
        self.data.captures().map(|c| self.surrogate.image(theta, c)).collect()
    }

    /// Correct the surrogate by a full simulation at these parameters.
    ///
    /// # Errors
    /// As [`ForwardModel::images`].
    pub fn correct_at(&mut self, theta: &[f64], progress: &dyn Progress) -> Result<()> {
        let simulated = self
            .model
            .images(&[ParameterPoint::new(theta.to_vec())], progress)?
            .remove(0);
        let interpolated = self.surrogate_images(theta);
        let pairs = simulated.iter().zip(&interpolated);
        let difference = pairs.map(|(s, i)| PixelGrid::combine(&[(s, 1.0), (i, -1.0)]));
        self.correction = Some(difference.collect());
        Ok(())
    }

    /// Sum of all that counts, with the prior of the shared nuisances.
    pub fn total(&self, equations: &NormalEquations, nuisances: &Nuisances) -> DMatrix<f64> {
        equations.sum(&self.used) + nuisances.prior(self.data, equations.size())
    }

    /// Pixels of the captures that count.
    pub fn pixels(&self) -> f64 {
        let counted = self.data.captures().filter(|&c| self.used[c]);
        counted.map(|c| self.data.pixels(c) as f64).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{covariance, half_widths};
    use crate::fit::SIGMAS_95;
    use crate::linear_model::{LinearModel, Term, beams, image, information};

    /// Captures of two LEDs, two elements and two distances.
    const CAPTURES: f64 = 8.0;

    /// Relative: what the faded border of the samples of the test images leaves of their closed forms.
    const TOLERANCE: f64 = 1e-3;

    /// With orthogonal columns, an estimate is the product of its pattern with the residual over that with
    /// itself, whatever else is fitted.
    #[test]
    fn estimates_of_orthogonal_columns_are_projections() {
        let periods = [[2, 3], [5, 4], [3, 0]];
        let model = LinearModel::new(periods.map(Term::linear).to_vec(), beams(2, 2, 2));
        let data = model.data(|_| vec![0.01, -0.02, 0.0], Some(5));
        let problem = model.problem(&data);
        let start = problem.nuisance_fit();
        let fit = problem.fit(&[0, 1, 2], &start);
        let form = problem.total(&fit.equations, &fit.nuisances);
        let sigmas = covariance(&form, &(0..form.nrows() - 1).collect::<Vec<_>>());
        for (k, p) in periods.into_iter().enumerate() {
            let pattern = image(0.0, &[(p, 1.0)]).pixels([0.0; 2]);
            let projected: f64 = data
                .captures()
                .map(|c| {
                    let pairs = data.signal[c].iter().zip(&pattern).zip(&data.weight[c]);
                    let scale = data.scale[c];
                    pairs
                        .map(|((s, p), w)| f64::from(*s) * scale * f64::from(*p) * f64::from(*w).powi(2))
                        .sum::<f64>()
                })
                .sum();
            let expected = projected / (CAPTURES * information(p));
            let sigma = (CAPTURES * information(p)).sqrt().recip();
            // Flux and registration change the size of a pattern in second order: by their noise.
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
        // Swapped periods: both patterns have the same size on the pixels.
        let (own, other) = ([5, 4], [4, 5]);
        let correlated = Term {
            amplitude: |theta| theta,
            patterns: vec![(own, RHO), (other, (1.0 - RHO * RHO).sqrt())],
        };
        let model = LinearModel::new(vec![Term::linear(own), correlated], beams(2, 2, 2));
        let data = model.data(|_| vec![0.01, 0.03], None);
        let problem = model.problem(&data);
        let fit = problem.fit(&[0, 1], &problem.nuisance_fit());
        let sigma = (CAPTURES * information(own) * (1.0 - RHO * RHO)).sqrt().recip();
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
