//! The mask and its shadow along one axis.

use metalith_core::{Error, Result};
use nalgebra::DMatrix;
use num_complex::Complex64;

/// A mask before a sensor, open where both of two sequences are.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MaskSpec {
    /// Width of one member of a sequence (um).
    pub feature_um: f64,
    /// Distance from the mask to the sensor (um).
    pub distance_um: f64,
}

impl MaskSpec {
    /// Mask as published: openings of 30 um, half a millimetre before the sensor.
    pub fn standard() -> Self {
        Self {
            feature_um: 30.0,
            distance_um: 500.0,
        }
    }

    /// Mask with openings of this width, at this distance (um).
    ///
    /// # Errors
    /// If one of them is not from 1 to 100 000 um.
    pub fn new(feature_um: f64, distance_um: f64) -> Result<Self> {
        if [feature_um, distance_um].iter().all(|um| (1.0..=1e5).contains(um)) {
            Ok(Self {
                feature_um,
                distance_um,
            })
        } else {
            Err(Error::refused(
                "flatcam/geometry-out-of-range",
                format!(
                    "the mask has openings of {feature_um} um at a distance of {distance_um} um: one is out of range"
                ),
                "give lengths from 1 to 100000 um",
            ))
        }
    }

    /// Samples of a shadow over at least `reach_um`: a power of two. What goes around in the transform stays beyond the reach.
    fn samples(&self, reach_um: f64) -> usize {
        let count = (1.5 * reach_um * f64::from(SAMPLES) / self.feature_um).ceil() as usize;
        count.next_power_of_two()
    }

    /// Refuse shadows that would take gigabytes.
    ///
    /// # Errors
    /// With the number of samples, and what takes fewer.
    pub fn check_reach(&self, reach_um: f64) -> Result<()> {
        match self.samples(reach_um) {
            count if count <= MOST_SAMPLES => Ok(()),
            count => Err(Error::refused(
                "flatcam/too-large",
                format!("the shadow of the mask needs {count} samples along an axis, more than {MOST_SAMPLES}"),
                "give wider openings, a nearer mask or a narrower field",
            )),
        }
    }

    /// The shadow along one axis at a wavelength (um), over at least `reach_um` about the middle.
    pub fn shadow(&self, wavelength_um: f64, reach_um: f64) -> Shadow {
        let step_um = self.feature_um / f64::from(SAMPLES);
        let count = self.samples(reach_um);
        let sequence = maximum_length_sequence();
        let middle = 0.5 * count as f64;
        let mut field: Vec<Complex64> = (0..count)
            .map(|i| {
                let member = ((i as f64 + 0.5 - middle) * step_um / self.feature_um).floor() as i64;
                let open = sequence[member.rem_euclid(sequence.len() as i64) as usize];
                Complex64::new(f64::from(u8::from(open)), 0.0)
            })
            .collect();
        metalith_fourier::forward(count).process(&mut field);
        let k = std::f64::consts::TAU / wavelength_um;
        for (i, v) in field.iter_mut().enumerate() {
            let turns = if 2 * i < count {
                i as f64
            } else {
                i as f64 - count as f64
            };
            let kx = std::f64::consts::TAU * turns / (count as f64 * step_um);
            let kz2 = k * k - kx * kx;
            *v *= if kz2 > 0.0 {
                Complex64::from_polar(1.0 / count as f64, kz2.sqrt() * self.distance_um)
            } else {
                Complex64::ZERO
            };
        }
        metalith_fourier::inverse(count).process(&mut field);
        let mut sums = vec![0.0];
        for v in &field {
            sums.push(sums[sums.len() - 1] + v.norm_sqr() * step_um);
        }
        Shadow {
            step_um,
            distance_um: self.distance_um,
            sums,
        }
    }
}

/// Most samples of a shadow: 64 MB, for each wavelength at a time.
const MOST_SAMPLES: usize = 1 << 22;
/// Samples of a member of a sequence.
const SAMPLES: u32 = 40;
/// Bits of the register that makes the sequence: 511 members.
const BITS: u32 = 9;

/// A sequence of maximum length, of the polynomial x^9 + x^5 + 1.
fn maximum_length_sequence() -> Vec<bool> {
    let mut register: u32 = 1;
    (0..(1 << BITS) - 1)
        .map(|_| {
            let out = register & 1 == 1;
            let next = (register ^ (register >> 4)) & 1;
            register = (register >> 1) | (next << (BITS - 1));
            out
        })
        .collect()
}

/// Light behind one axis of a mask, that of an open place being one, as its integral from the first sample on.
pub struct Shadow {
    step_um: f64,
    distance_um: f64,
    sums: Vec<f64>,
}

impl Shadow {
    /// The mean of shadows of one mask.
    pub fn mean(all: &[Self], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let sum = |i: usize| all.iter().zip(weights).map(|(s, w)| s.sums[i] * w / total).sum();
        Self {
            step_um: all[0].step_um,
            distance_um: all[0].distance_um,
            sums: (0..all[0].sums.len()).map(sum).collect(),
        }
    }

    /// Light up to a place from the middle (um).
    fn up_to(&self, x_um: f64) -> f64 {
        let last = self.sums.len() - 1;
        let place = (x_um / self.step_um + 0.5 * last as f64).clamp(0.0, last as f64);
        let (i, s) = ((place as usize).min(last - 1), place - place.floor());
        let s = if place >= last as f64 { 1.0 } else { s };
        self.sums[i] + s * (self.sums[i + 1] - self.sums[i])
    }

    /// Light in each pixel (row) that comes from each place of the scene (column), a pixel of the scene wide, by its tangent.
    pub fn on_pixels(&self, pixels: usize, pixel_um: f64, tangents: &[f64], wide: f64) -> DMatrix<f64> {
        let middle = 0.5 * (pixels as f64 - 1.0);
        DMatrix::from_fn(pixels, tangents.len(), |j, k| {
            // Two halves of a pixel of the scene.
            let parts = [-0.25, 0.25].map(|o| {
                let x = (j as f64 - middle) * pixel_um - self.distance_um * (tangents[k] + o * wide);
                self.up_to(x + 0.5 * pixel_um) - self.up_to(x - 0.5 * pixel_um)
            });
            0.5 * (parts[0] + parts[1]) / pixel_um
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_has_two_levels_of_correlation() {
        let sequence = maximum_length_sequence();
        assert_eq!(sequence.len(), 511);
        assert_eq!(sequence.iter().filter(|b| **b).count(), 256);
        let sign = |i: usize| if sequence[i % 511] { 1 } else { -1 };
        for shift in [1, 2, 40, 255] {
            assert_eq!((0..511).map(|i| sign(i) * sign(i + shift)).sum::<i32>(), -1);
        }
    }

    #[test]
    fn near_the_mask_the_shadow_is_the_mask_and_moves_with_the_light() {
        /// Diffraction over 1 um at openings of 30 um.
        const BLUR: f64 = 0.1;
        let mask = MaskSpec {
            feature_um: 30.0,
            distance_um: 1.0,
        };
        let shadow = mask.shadow(0.5, 3000.0);
        let sequence = maximum_length_sequence();
        let seen = shadow.on_pixels(100, 30.0, &[0.0], 0.0);
        for j in 0..100usize {
            let open = f64::from(u8::from(sequence[(j as i64 - 50).rem_euclid(511) as usize]));
            assert!((seen[(j, 0)] - open).abs() < BLUR, "{j}: {}", seen[(j, 0)]);
        }
        let far = MaskSpec {
            feature_um: 30.0,
            distance_um: 600.0,
        };
        let moved = far.shadow(0.5, 3000.0).on_pixels(100, 30.0, &[0.0, 0.1], 0.0);
        // 0.1 times 600 um is two pixels.
        assert!((2..100).all(|j| (moved[(j, 1)] - moved[(j - 2, 0)]).abs() < 1e-9));
        // No light is lost.
        let light: f64 = (0..100).map(|j| moved[(j, 0)]).sum();
        let open: f64 = (0..100).map(|j| seen[(j, 0)]).sum();
        assert!((light / open - 1.0).abs() < 0.05, "{light} {open}");
    }
}
