//! Defect noise: the speckle of pillars that are missing at random places.
//!
//! The mean of missing pillars is an effect like any other. The scatter of single ones is no function of a few
//! parameters: no fit finds their places. Its variance is known, though. It grows with the light that it
//! interferes with, by a factor that depends on the coherence of each measurement and is estimated from a few draws
//! of the places. Treated as noise, it lets everything else be judged as before, and it gives a second estimate
//! of the share of missing pillars.

use metalith_attribution::RandomNoise;
use metalith_core::{Progress, Result};
use ndarray::Array2;
use rayon::prelude::*;

use crate::data::Data;
use crate::set::{MeasurementIndex, PerMeasurement};
use crate::simulator::Simulator;
use crate::statistics::{Fit, FitProblem, Measurements};

/// Draws of the places: each has thousands of speckles in every measurement.
const DRAWS: u64 = 4;

/// First seed of the draws and distance of their seeds; elements take the numbers after each.
const SEED: u64 = 5000;
const SEEDS_APART: u64 = 64;

/// Range of shares that is searched, and relative precision of the search.
const SHARES: (f64, f64) = (1e-4, 0.3);
const PRECISION: f64 = 1e-4;

/// Variance of the intensity at a pixel that should show `i`, for a unit of p (1 - p): `by_light * i + floor`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Speckle {
    by_light: f64,
    floor: f64,
}

/// The variance of the speckle of each measurement.
#[derive(Clone)]
pub struct DefectNoise {
    measurements: PerMeasurement<Speckle>,
}

impl DefectNoise {
    /// Speckle from draws of the places of missing pillars, whose share is parameter `slot`, about the values `about`.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn of(simulator: &Simulator<'_>, about: &[f64], slot: usize, progress: &dyn Progress) -> Result<Self> {
        let share = simulator.slots[slot].parameter.typical;
        let mut theta = about.to_vec();
        theta[slot] = share;
        let perturbation = simulator.perturbation(&theta);
        let mean = simulator
            .expose(std::slice::from_ref(&perturbation), progress)?
            .remove(0);
        let mut drawn = Vec::new();
        for k in 0..DRAWS {
            drawn.push(simulator.expose_drawn(&perturbation, SEED + k * SEEDS_APART, progress)?);
        }
        let measurements: Vec<Speckle> = (0..mean.len())
            .into_par_iter()
            .map(|c| {
                let light = mean[c].pixels([0.0; 2]);
                let own: Vec<Array2<f32>> = drawn.iter().map(|grids| grids[c].pixels([0.0; 2])).collect();
                Speckle::between(&light, &own, share * (1.0 - share))
            })
            .collect();
        Ok(Self {
            measurements: measurements.into(),
        })
    }

    /// Of each pixel that counts: the square of the residual, the variance of the camera, that of a unit of
    /// speckle (DN^2).
    fn spread(&self, problem: &FitProblem<'_>, fit: &Fit, c: MeasurementIndex) -> Vec<[f32; 3]> {
        let data = problem.data;
        let grid = problem.prediction(&fit.theta, c);
        let light = grid.pixels(fit.nuisances.shift_um[c]);
        let residual = fit.nuisances.residual(data, &grid, c);
        let scale = fit.nuisances.dn(data, c) as f32;
        let Speckle { by_light, floor } = self.measurements[c];
        let pixels = light.iter().zip(&residual).zip(&data.weight[c]);
        pixels
            .filter(|(_, w)| **w > 0.0)
            .map(|((i, r), w)| {
                let speckle = by_light as f32 * i.max(0.0) + floor as f32;
                [(r / w).powi(2), w.powi(-2), scale * scale * speckle]
            })
            .collect()
    }
}

impl RandomNoise<Data> for DefectNoise {
    /// Maximum-likelihood estimate of the share of missing pillars from the residual of a fit.
    fn amount(&self, problem: &FitProblem<'_>, fit: &Fit) -> f64 {
        let used: Vec<MeasurementIndex> = problem.data.indices().filter(|&c| problem.used[c]).collect();
        let measurements: Vec<Vec<[f32; 3]>> = used.par_iter().map(|&c| self.spread(problem, fit, c)).collect();
        let minus_log_likelihood = |share: f64| {
            let p = (share * (1.0 - share)) as f32;
            let sums: Vec<f64> = measurements
                .par_iter()
                .map(|pixels| {
                    let one = |[square, noise, speckle]: &[f32; 3]| {
                        let variance = noise + p * speckle;
                        f64::from(square / variance + variance.ln())
                    };
                    pixels.iter().map(one).sum()
                })
                .collect();
            sums.iter().sum::<f64>()
        };
        // Golden-section search over the logarithm: one of the two inner points is known from the step before.
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let (mut low, mut high) = (SHARES.0.ln(), SHARES.1.ln());
        let at = |x: f64| (x, minus_log_likelihood(x.exp()));
        let (mut a, mut b) = (at(high - golden * (high - low)), at(low + golden * (high - low)));
        while high - low >= PRECISION {
            if a.1 < b.1 {
                (high, b) = (b.0, a);
                a = at(high - golden * (high - low));
            } else {
                (low, a) = (a.0, b);
                b = at(low + golden * (high - low));
            }
        }
        (0.5 * (low + high)).exp()
    }

    fn is_estimate(&self, share: f64) -> bool {
        share > 2.0 * SHARES.0 && share < 0.9 * SHARES.1
    }

    /// The data with the speckle of a share of missing pillars added to the noise.
    fn added_to(&self, problem: &FitProblem<'_>, fit: &Fit, share: f64) -> Data {
        let p = (share * (1.0 - share)) as f32;
        let mut data = problem.data.clone();
        data.weight = problem.data.for_each(|c| {
            let pixels = self.spread(problem, fit, c);
            let mut pixels = pixels.iter();
            problem.data.weight[c].mapv(|w| match (w > 0.0).then(|| pixels.next()).flatten() {
                Some([_, noise, speckle]) => (noise + p * speckle).sqrt().recip(),
                None => 0.0,
            })
        });
        data
    }
}

impl Speckle {
    /// Maximum likelihood of the draws: least squares of squared deviations on the light, iteratively weighted by
    /// their own variance.
    fn between(light: &Array2<f32>, drawn: &[Array2<f32>], unit: f64) -> Self {
        let mut now = Self {
            by_light: 1.0,
            floor: f64::from(light.mean().unwrap_or(0.0)).max(1e-6),
        };
        for _ in 0..ITERATIONS {
            let mut sums = [0.0; 5];
            for own in drawn {
                for (i, d) in light.iter().zip(own) {
                    let i = f64::from(*i).max(0.0);
                    let square = (f64::from(*d) - i).powi(2) / unit;
                    let weight = (now.by_light * i + now.floor).powi(-2);
                    let terms = [i * i, i, 1.0, i * square, square];
                    sums.iter_mut().zip(terms).for_each(|(s, t)| *s += weight * t);
                }
            }
            let [ii, i, one, is, s] = sums;
            let by_light = ((is * one - i * s) / (ii * one - i * i)).max(0.0);
            // A lower bound, so that dark pixels do not outweigh all others.
            let floor = ((s - by_light * i) / one).max(FLOOR * (s / one));
            if !(by_light.is_finite() && floor.is_finite()) {
                break;
            }
            now = Self { by_light, floor };
        }
        now
    }
}

/// Iterations in which the weights of the pixels converge.
const ITERATIONS: usize = 5;

/// Least share of the mean variance that a pixel without light has.
const FLOOR: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_variance_of_drawn_speckle_is_recovered() {
        /// Of 4 x 4096 squares of uniform numbers, twice over.
        const TOLERANCE: f64 = 0.06;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let light = Array2::from_shape_fn((64, 64), |(y, x)| 0.2 + ((x * y) % 37) as f32);
        let truth = Speckle {
            by_light: 0.3,
            floor: 0.5,
        };
        let drawn: Vec<Array2<f32>> = (0..4)
            .map(|_| {
                light.mapv(|i| {
                    let sigma = (0.02 * (truth.by_light * f64::from(i) + truth.floor)).sqrt();
                    i + (sigma * 12f64.sqrt() * (rng.random::<f64>() - 0.5)) as f32
                })
            })
            .collect();
        let found = Speckle::between(&light, &drawn, 0.02);
        assert!((found.by_light / truth.by_light - 1.0).abs() < TOLERANCE, "{found:?}");
        assert!((found.floor / truth.floor - 1.0).abs() < TOLERANCE, "{found:?}");
    }
}
