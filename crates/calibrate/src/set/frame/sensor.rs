//! What the sensor itself adds to frames.

use ndarray::Array2;

use crate::set::{RelayCamera, SATURATED};

/// Frames without light and in even light: what the sensor adds by itself.
#[derive(Default)]
pub struct SensorFrames {
    /// Without light, black level included (DN).
    pub dark: Option<Array2<f32>>,
    /// In even light, dark frame included (DN).
    pub flat: Option<Array2<f32>>,
}

impl SensorFrames {
    /// Take both out of a frame: every pixel has the stated black level and the mean response after. Saturated pixels
    /// stay saturated.
    pub fn take_out(&self, dn: &mut Array2<f32>, camera: &RelayCamera) {
        if self.dark.is_none() && self.flat.is_none() {
            return;
        }
        let (black, full) = (camera.black_level_dn as f32, camera.saturation_dn as f32);
        let responses = self.responses(camera);
        for (at, v) in dn.indexed_iter_mut() {
            if f64::from(*v) >= SATURATED * camera.saturation_dn {
                *v = full;
                continue;
            }
            let response = responses.as_ref().map_or(1.0, |r| r[at]);
            // A dead pixel tells nothing: it is masked like a saturated one.
            *v = if response > LEAST_RESPONSE {
                black + (*v - self.dark_at(at, black)) / response
            } else {
                full
            };
        }
    }

    /// Response of each pixel, relative to the mean of all; none without a flat frame.
    pub fn responses(&self, camera: &RelayCamera) -> Option<Array2<f32>> {
        let flat = self.flat.as_ref()?;
        let black = camera.black_level_dn as f32;
        let mut lit = Array2::from_shape_fn(flat.dim(), |at| flat[at] - self.dark_at(at, black));
        let sum: f64 = lit.iter().map(|v| f64::from(*v)).sum();
        let mean = (sum / lit.len() as f64) as f32;
        lit.mapv_inplace(|v| v / mean);
        Some(lit)
    }

    fn dark_at(&self, at: (usize, usize), black: f32) -> f32 {
        self.dark.as_ref().map_or(black, |d| d[at])
    }
}

/// Response of a pixel, relative to the mean, below which it is dead.
const LEAST_RESPONSE: f32 = 0.1;

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn camera() -> RelayCamera {
        RelayCamera {
            pixel_um: 1.0,
            rows: 2,
            cols: 3,
            black_level_dn: 40.0,
            gain_e_per_dn: 1.0,
            read_noise_dn: 1.0,
            saturation_dn: 1000.0,
            registration_sigma_px: 0.5,
            flux_sigma: 0.01,
            relay_blur_um: 0.0,
            bayer: None,
        }
    }

    #[test]
    fn dark_and_flat_frames_are_taken_out() {
        let frames = SensorFrames {
            dark: Some(ndarray::arr2(&[[41.0, 40.0, 40.0], [40.0, 40.0, 40.0]])),
            // Responses of 0.5 and 1.5 of the mean, and a dead pixel.
            flat: Some(ndarray::arr2(&[[91.0, 190.0, 240.0], [240.0, 40.0, 240.0]])),
        };
        let mean: f32 = (50.0 + 150.0 + 200.0 + 200.0 + 0.0 + 200.0) / 6.0;
        let mut dn = ndarray::arr2(&[[66.0, 115.0, 999.0], [140.0, 50.0, 140.0]]);
        frames.take_out(&mut dn, &camera());
        // Single precision.
        const ROUNDING: f32 = 1e-3;
        for (at, want) in [
            ((0, 0), 40.0 + 25.0 * mean / 50.0),
            ((0, 1), 40.0 + 75.0 * mean / 150.0),
            ((0, 2), 1000.0),
            ((1, 0), 40.0 + 100.0 * mean / 200.0),
            ((1, 1), 1000.0),
        ] {
            assert!((dn[at] - want).abs() < ROUNDING, "{at:?}: {}", dn[at]);
        }
    }
}
