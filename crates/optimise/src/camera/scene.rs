//! Power of natural scenes at the sampling of a picture.

/// Statistics of photographs in linear light, those of the restoration: see `crates/restoration/src/scene_statistics.rs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NaturalScene {
    /// Tangent from one pixel of the scene to the next.
    pub pixel: f64,
    /// Pixels of a photograph that a pixel of the scene averages along an axis.
    pub reduction: f64,
}

/// Mean of the light.
pub(super) const MEAN: f64 = 0.2;
/// Power of the plane (red + green + blue) / sqrt(3).
const POWER: f64 = 0.08;
/// Deviations of the planes red against blue, and green against both, over that of the first.
const OPPONENTS: [f64; 2] = [0.29, 0.15];
/// Standard deviation of the light of a colour.
pub(super) const DEVIATION: f64 = 0.14;
/// Pixels along the longer side of the photographs.
const PHOTOGRAPH: f64 = 576.0;

impl NaturalScene {
    /// A scene of so many pixels along an axis over a field (degrees).
    pub fn new(field_deg: f64, pixels: usize) -> Self {
        Self {
            pixel: 2.0 * (0.5 * field_deg).to_radians().tan() / pixels as f64,
            reduction: (PHOTOGRAPH / pixels as f64).max(1.0),
        }
    }

    /// Power of the grey plane at a frequency (cycles a pixel of the scene): variance over a square of frequency. The zeroth
    /// frequency counts as one of `least`.
    pub(super) fn power(&self, frequency: [f64; 2], least: f64) -> f64 {
        let sine = |f: f64| 4.0 * (std::f64::consts::PI * f / self.reduction).sin().powi(2);
        let s = frequency.map(sine).iter().sum::<f64>().max(sine(least));
        POWER / (s + s * s) / self.reduction.powi(2)
    }

    /// Inverse covariance of the planes at a frequency of grey power one: of three colours, or of planes that vary alone.
    pub(super) fn inverse_covariance(planes: usize, colours: bool) -> Vec<Vec<f64>> {
        if !colours {
            let one = |i, j| if i == j { 3.0 } else { 0.0 };
            return (0..planes).map(|i| (0..planes).map(|j| one(i, j)).collect()).collect();
        }
        let [b, g] = OPPONENTS;
        let unit = [
            [3f64.sqrt().recip(); 3],
            [2f64.sqrt().recip(), 0.0, -2f64.sqrt().recip()],
            [6f64.sqrt().recip(), -2.0 * 6f64.sqrt().recip(), 6f64.sqrt().recip()],
        ];
        let inverse = [1.0, (b * b).recip(), (g * g).recip()];
        let entry = |i: usize, j: usize| (0..3).map(|k| unit[k][i] * unit[k][j] * inverse[k]).sum();
        (0..3).map(|i| (0..3).map(|j| entry(i, j)).collect()).collect()
    }
}
