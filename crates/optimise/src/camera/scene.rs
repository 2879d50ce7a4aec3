//! Power of natural scenes at the sampling of a picture.

use metalith_restoration::{GREY_POWER, PHOTOGRAPH_PIXELS, SceneStatistics, natural_power};

/// Statistics of photographs in linear light at the sampling of a scene; those of [`SceneStatistics`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NaturalScene {
    /// Tangent from one pixel of the scene to the next.
    pub pixel: f64,
    /// Pixels of a photograph that a pixel of the scene averages along an axis.
    pub reduction: f64,
}

/// Standard deviation of the light of a colour.
pub(super) const DEVIATION: f64 = 0.14;

impl NaturalScene {
    /// A scene of so many pixels along an axis over a field (degrees).
    pub fn new(field_deg: f64, pixels: usize) -> Self {
        Self {
            pixel: 2.0 * (0.5 * field_deg).to_radians().tan() / pixels as f64,
            reduction: (PHOTOGRAPH_PIXELS as f64 / pixels as f64).max(1.0),
        }
    }

    /// Power of the grey plane at a frequency (cycles a pixel of the scene): variance over a square of frequency. The zeroth
    /// frequency counts as one of `least`.
    pub(super) fn power(&self, frequency: [f64; 2], least: f64) -> f64 {
        let sine = |f: f64| 4.0 * (std::f64::consts::PI * f / self.reduction).sin().powi(2);
        let s = frequency.map(sine).iter().sum::<f64>().max(sine(least));
        natural_power(GREY_POWER, s) / self.reduction.powi(2)
    }

    /// Inverse covariance of the planes at a frequency of grey power one: of three colours, or of planes that vary alone.
    pub(super) fn inverse_covariance(planes: usize, colours: bool) -> Vec<Vec<f64>> {
        let statistics = if colours {
            SceneStatistics::colours()
        } else {
            SceneStatistics::grey(planes)
        };
        let inverse = statistics.inverse_covariance();
        let row = |i: usize| (0..planes).map(|j| inverse[(i, j)]).collect();
        (0..planes).map(row).collect()
    }
}
