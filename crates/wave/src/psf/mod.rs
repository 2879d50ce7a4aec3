//! The point spread function, and what is measured of it.
//!
//! | question | file |
//! | --- | --- |
//! | the function, its peak and centroid | here |
//! | energy in squares, circles and pixels | `energy` |
//! | width at half maximum, power near the peak | `width` |
//! | planes along z, focal length | `through_focus` |
//! | contrast | `mtf` |
//! | all numbers that are reported | `metrics` |
//! | what the best element of the same shape would do | `ideal_psf` |
//! | how much two differ | `difference` |
//! | a band of wavelengths from one direction | `polychromatic` |
//! | shares of light in diffraction orders of a mapping | `orders` |
//! | its derivatives by transmissions, wedge and distance | `differentiable` |

mod difference;
mod differentiable;
mod energy;
mod ideal_psf;
mod metrics;
mod mtf;
mod orders;
mod polychromatic;
mod through_focus;
mod width;

use metalith_core::part;
use ndarray::{Array2, Axis};

use crate::error::Result;
use crate::propagation::{Aperture, ApertureSet, Field, Otf, PlaneWave, Propagator, Scratch, Window};

pub use differentiable::{DifferentiablePsf, PsfCotangents, PsfPullback, phase_cotangent};
pub use ideal_psf::IdealPsf;
pub use metrics::{FocusMetrics, PsfMetrics};
pub use mtf::{PixelFrequencies, pixel_mtf};
pub use orders::order_shares;
pub use polychromatic::{BandPart, BandSample, Polychromatic, band_otf, polychromatic};
pub use through_focus::{FOCUS_PLANES, FocusPlane, FocusPlanes, LEAST_STREHL, ThroughFocus, depth_of_focus_um};
pub use width::{AIRY_FWHM, FOCUS_FWHM};

/// |E|^2 / |E_inc|^2 on a window of the sensor's plane, E_inc in the medium of incidence.
///
/// Energies are integrals over the sensor's plane of the function through the samples that has no frequencies
/// beyond half their rate: exact where the step is at most wavelength / (4 NA).
#[derive(Clone, Debug, PartialEq)]
pub struct Psf {
    /// Window of the samples.
    pub window: Window,
    /// Shape `[samples, samples]`, row index along +y, column index along +x.
    pub values: Array2<f64>,
    /// The transfer of all the light that the element passes, at the frequencies that were asked for; without it,
    /// contrast can only be that of the light in the window.
    pub otf: Option<Otf>,
}

impl Psf {
    /// PSF from the field of a unit wave.
    pub fn of(field: &Field) -> Self {
        Self {
            window: field.window,
            values: field.values.map(|e| f64::from(e.re).powi(2) + f64::from(e.im).powi(2)),
            otf: None,
        }
    }

    /// PSF of an element in a unit wave, with the transfer of all its light at `lp_mm` (line pairs a millimetre) where
    /// the propagator knows it.
    ///
    /// # Errors
    /// As [`Propagator::field`].
    pub fn formed(
        propagator: &dyn Propagator,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Self> {
        let (field, otf) = propagator.field_and_otf(aperture, wave, lp_mm, scratch)?;
        Ok(Self {
            otf,
            ..Self::of(&field)
        })
    }

    /// [`Psf::formed`] of each aperture of a set.
    ///
    /// # Errors
    /// As [`Propagator::field`].
    pub fn formed_of_set(
        propagator: &dyn Propagator,
        set: &dyn ApertureSet,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<Self>> {
        let fields = propagator.fields_and_otfs(set, wave, lp_mm, scratch)?;
        let psf = |(field, otf)| Self {
            otf,
            ..Self::of(&field)
        };
        Ok(fields.into_iter().map(psf).collect())
    }

    /// Sum of PSFs on the same window that do not interfere, times a share: as of light that is not polarised.
    ///
    /// # Panics
    /// If there is none, or their windows are of different sizes.
    pub fn sum(psfs: Vec<Self>, share: f64) -> Self {
        let otfs: Option<Vec<Otf>> = psfs.iter().map(|p| p.otf.clone()).collect();
        let mut all = psfs.into_iter();
        let mut sum = all.next().expect("a PSF to take the sum of");
        for psf in all {
            sum.values += &psf.values;
        }
        if share != 1.0 {
            sum.values *= share;
        }
        sum.otf = otfs.map(|all| Otf::sum(&all, share));
        sum
    }

    /// The largest sample and its place from the element's centre (um); of equals the first in reading order.
    pub fn peak(&self) -> (f64, [f64; 2]) {
        let mut best = (f64::NEG_INFINITY, [0, 0]);
        for ((iy, ix), &v) in self.values.indexed_iter() {
            if v > best.0 {
                best = (v, [ix, iy]);
            }
        }
        let (value, [ix, iy]) = best;
        (
            value,
            [self.window.coordinate_um(0, ix), self.window.coordinate_um(1, iy)],
        )
    }

    /// Centre of gravity from the element's centre, x and y (um), of the samples on both sides of sample
    /// `samples / 2`. An even number of them has a row and a column more below it than above, which would draw the
    /// centre of a symmetric PSF there.
    pub fn centroid_um(&self) -> [f64; 2] {
        let n = self.window.samples;
        let both_sides = usize::from(n.is_multiple_of(2))..n;
        let values = part(self.values.view(), both_sides.clone(), both_sides.clone());
        let total = values.sum();
        [0, 1].map(|axis| {
            let line = values.sum_axis(Axis(axis));
            let moments = both_sides.clone().zip(&line);
            moments
                .map(|(i, v)| v * self.window.coordinate_um(axis, i))
                .sum::<f64>()
                / total
        })
    }

    /// Sum over the other axis, the image of a line. Axis 0 is x.
    pub fn line_spread(&self, axis: usize) -> Vec<f64> {
        self.values.sum_axis(Axis(axis)).to_vec()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The spectrum of the Gaussian at half the sampling rate is exp(-2 (pi sigma / 2 step)^2) = 1e-17, times the
    /// number of samples and a margin.
    pub(crate) const BAND: f64 = 1e-9;

    pub(crate) fn gaussian(sigma_um: f64, at_um: [f64; 2]) -> Psf {
        let window = Window {
            centre_um: [100.0, -40.0],
            step_um: 0.5,
            samples: 64,
            distance_um: 100.0,
        };
        let values = Array2::from_shape_fn((64, 64), |(iy, ix)| {
            let x = window.coordinate_um(0, ix) - at_um[0];
            let y = window.coordinate_um(1, iy) - at_um[1];
            (-(x * x + y * y) / (2.0 * sigma_um * sigma_um)).exp()
        });
        Psf {
            window,
            values,
            otf: None,
        }
    }

    pub(crate) const AT: [f64; 2] = [100.3, -41.2];
    pub(crate) const SIGMA: f64 = 1.4;

    /// Light that goes on beyond the window, with its middle on a sample.
    #[test]
    fn the_centroid_of_a_symmetric_psf_is_its_middle() {
        // Rounding of sums over 4096 samples, times places of 100 um.
        const ROUNDING_UM: f64 = 1e-10;
        let at = [3.0, -7.0];
        for samples in [63, 64] {
            let window = Window::about(at, 0.5, samples, 100.0);
            let values = Array2::from_shape_fn((samples, samples), |(iy, ix)| {
                let [x, y] = [window.coordinate_um(0, ix) - at[0], window.coordinate_um(1, iy) - at[1]];
                1.0 / (1.0 + x * x + 0.2 * y * y)
            });
            let centroid = Psf {
                window,
                values,
                otf: None,
            }
            .centroid_um();
            assert!(
                (0..2).all(|a| (centroid[a] - at[a]).abs() < ROUNDING_UM),
                "{centroid:?}"
            );
        }
    }

    #[test]
    fn the_centroid_of_a_gaussian_is_its_middle() {
        let psf = gaussian(SIGMA, AT);
        let centroid = psf.centroid_um();
        assert!((0..2).all(|a| (centroid[a] - AT[a]).abs() < BAND));
    }
}
