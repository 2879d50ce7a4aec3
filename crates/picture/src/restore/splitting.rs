//! Half-quadratic splitting with any denoiser:
//!
//! I = argmin 1/2 |A I - S|^2 + mu/2 |I - z|^2, z = denoised(I), with mu growing from round to round.

use metalith_core::{Progress, Result};
use ndarray::Array2;

use super::normal::{NormalSystem, Planes, Terms, slopes, slopes_adjoint};
use super::tikhonov;
use super::total_variation::shrunk;

/// What takes noise out of a picture: a plane in linear light, white being one.
pub trait Denoiser: Sync {
    /// The plane without noise of this standard deviation.
    fn denoise(&self, plane: &Array2<f32>, deviation: f64) -> Array2<f32>;
}

/// The picture of least total variation near another one, by gradients of its dual (Chambolle, J. Math. Imaging Vis. 20,
/// 89 (2004)).
#[derive(Clone, Copy, Debug)]
pub struct SlopeDenoiser {
    /// Strength, in standard deviations of the noise.
    pub strength: f64,
    pub rounds: usize,
}

impl Default for SlopeDenoiser {
    fn default() -> Self {
        Self {
            strength: 1.0,
            rounds: 20,
        }
    }
}

impl Denoiser for SlopeDenoiser {
    fn denoise(&self, plane: &Array2<f32>, deviation: f64) -> Array2<f32> {
        let strength = (self.strength * deviation) as f32;
        if strength <= 0.0 {
            return plane.clone();
        }
        let mut dual = [Array2::<f32>::zeros(plane.dim()), Array2::zeros(plane.dim())];
        for _ in 0..self.rounds {
            let now = plane - &slopes_adjoint(&dual);
            let step = slopes(&now);
            for a in 0..2 {
                dual[a].scaled_add(0.125, &step[a]);
            }
            // Onto vectors no longer than the strength: what shrinking takes off.
            let off = shrunk(&dual, strength);
            for a in 0..2 {
                dual[a] -= &off[a];
            }
        }
        plane - &slopes_adjoint(&dual)
    }
}

/// Rounds, and steps of conjugate gradients in each.
const ROUNDS: usize = 6;
const STEPS: usize = 2;
/// Weight of the denoised picture in the first round, of the largest weight of the data, and how it grows.
const FIRST: f64 = 0.1;
const GROWS: f64 = 1.6;
/// Deviation of the noise that is left in the first picture.
const FIRST_DEVIATION: f64 = 0.03;

/// By rounds of both steps.
pub fn restore(system: &NormalSystem<'_>, denoiser: &dyn Denoiser, progress: &dyn Progress) -> Result<Planes> {
    use rayon::prelude::*;
    let mut x = tikhonov::restore(system, progress)?;
    progress.begin("restoring by splitting", (ROUNDS * STEPS) as u64);
    let mut weight = FIRST * system.mean_share;
    let mut deviation = FIRST_DEVIATION;
    for _ in 0..ROUNDS {
        let clean: Planes = x.par_iter().map(|p| denoiser.denoise(p, deviation)).collect();
        let mut right = system.data.clone();
        for (r, z) in right.iter_mut().zip(&clean) {
            r.scaled_add(weight as f32, z);
        }
        let terms = Terms {
            slopes: 0.0,
            bends: 0.0,
            identity: weight,
        };
        x = system.solve(clean, &right, terms, STEPS, progress)?;
        weight *= GROWS;
        deviation /= GROWS.sqrt();
    }
    Ok(x.par_iter().map(|p| denoiser.denoise(p, deviation)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_goes_and_edges_stay() {
        let clean = Array2::from_shape_fn((40, 40), |(_, x)| if x < 20 { 0.2f32 } else { 0.8 });
        let noisy = Array2::from_shape_fn((40, 40), |(y, x)| {
            clean[[y, x]] + if (x + y * 3) % 2 == 0 { 0.05 } else { -0.05 }
        });
        let got = SlopeDenoiser::default().denoise(&noisy, 0.05);
        let error = |a: &Array2<f32>| (a - &clean).mapv(|v| v * v).mean().unwrap().sqrt();
        assert!(error(&got) < 0.4 * error(&noisy), "{} {}", error(&got), error(&noisy));
        assert!(got[[20, 22]] - got[[20, 17]] > 0.5);
        assert_eq!(SlopeDenoiser::default().denoise(&noisy, 0.0), noisy);
    }
}
