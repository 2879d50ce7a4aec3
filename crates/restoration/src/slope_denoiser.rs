//! The picture of least total variation near another one.

use metalith_core::Result;
use ndarray::Array2;
use rayon::prelude::*;

use crate::denoiser::{Denoiser, Schedule};
use crate::frame_model::Planes;
use crate::scene_statistics::SceneStatistics;
use crate::slope_split::{SlopeBorder, shrunk, slopes, slopes_adjoint};

/// Denoiser by gradients of its dual (Chambolle, J. Math. Imaging Vis. 20, 89 (2004)), for each of the planes that vary
/// independently.
#[derive(Clone, Debug)]
pub struct SlopeDenoiser {
    /// Statistics of the planes.
    pub statistics: SceneStatistics,
    /// Strength, in standard deviations of the noise.
    pub strength: f64,
    pub rounds: usize,
}

impl SlopeDenoiser {
    /// Denoiser for pictures of these statistics.
    pub fn new(statistics: &SceneStatistics) -> Self {
        Self {
            statistics: statistics.clone(),
            strength: 1.0,
            rounds: 20,
        }
    }

    /// One plane.
    fn plane(&self, plane: &Array2<f32>, deviation: f64) -> Array2<f32> {
        let strength = (self.strength * deviation) as f32;
        if strength <= 0.0 {
            return plane.clone();
        }
        let mut dual = [Array2::<f32>::zeros(plane.dim()), Array2::zeros(plane.dim())];
        for _ in 0..self.rounds {
            let now = plane - &slopes_adjoint(&dual, SlopeBorder::Even);
            let step = slopes(&now, SlopeBorder::Even);
            for a in 0..2 {
                dual[a].scaled_add(0.125, &step[a]);
            }
            // Onto vectors no longer than the strength: what shrinking takes off.
            let off = shrunk(&dual, strength);
            for a in 0..2 {
                dual[a] -= &off[a];
            }
        }
        plane - &slopes_adjoint(&dual, SlopeBorder::Even)
    }
}

impl Denoiser for SlopeDenoiser {
    fn denoise(&self, picture: &[Array2<f32>], _near: Option<&[Array2<f32>]>, deviation: f64) -> Result<Planes> {
        let independent = self.statistics.independent(picture);
        let sizes = self.statistics.sizes();
        let clean: Planes = independent
            .par_iter()
            .zip(&sizes)
            .map(|(p, size)| self.plane(p, deviation / size.sqrt()))
            .collect();
        Ok(self.statistics.picture(&clean))
    }

    fn schedule(&self) -> Schedule {
        Schedule {
            deviations: [0.03, 0.007],
            rounds: 6,
            steps: 2,
            weight: 0.25,
        }
    }
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
        let denoiser = SlopeDenoiser::new(&SceneStatistics::grey(1));
        let denoised = |deviation: f64| {
            denoiser
                .denoise(std::slice::from_ref(&noisy), None, deviation)
                .unwrap()
                .remove(0)
        };
        let got = denoised(0.05);
        let error = |a: &Array2<f32>| (a - &clean).mapv(|v| v * v).mean().unwrap().sqrt();
        assert!(error(&got) < 0.4 * error(&noisy), "{} {}", error(&got), error(&noisy));
        assert!(got[[20, 22]] - got[[20, 17]] > 0.5);
        assert_eq!(denoised(0.0), noisy);
    }
}
