//! Window in which a field is formed.

use metalith_core::numerical_aperture;

use crate::error::{Result, WaveError};

/// Most samples of a window an axis: beyond it memory is the fault that shows.
const MOST_SAMPLES: usize = 1 << 13;

/// A square of sample points on a plane behind the element, parallel to it.
///
/// Sample `i` of an axis is at `centre + (i - (samples - 1) / 2) * step`; row index along +y, column
/// index along +x, as in a camera's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Middle of the window from the element's centre, x and y (um).
    pub centre_um: [f64; 2],
    /// Distance of neighbouring samples (um).
    pub step_um: f64,
    /// Samples an axis.
    pub samples: usize,
    /// Distance of the plane from the pillar tops (um).
    pub distance_um: f64,
}

impl Window {
    /// A window with a sample, of index `samples / 2` on both axes, exactly at `point_um`.
    pub fn about(point_um: [f64; 2], step_um: f64, samples: usize, distance_um: f64) -> Self {
        let off = if samples.is_multiple_of(2) { 0.5 * step_um } else { 0.0 };
        Self {
            centre_um: point_um.map(|c| c - off),
            step_um,
            samples,
            distance_um,
        }
    }

    /// Window of a PSF, as wide as `pitches` pitches of the lattice, with a sample exactly at `point_um`, for light of an aperture
    /// of this radius (um). The step is a pitch, or an equal part of one: the intensity has frequencies up to 2 NA / lambda, and
    /// is known between samples only if these are at most lambda / (4 NA) apart (sampling theorem).
    pub fn of_psf(
        point_um: [f64; 2],
        (pitch_um, pitches): (f64, usize),
        (radius_um, distance_um): (f64, f64),
        wavelength_um: f64,
    ) -> Self {
        let parts = (4.0 * numerical_aperture(radius_um, distance_um) * pitch_um / wavelength_um)
            .ceil()
            .max(1.0);
        Self::about(point_um, pitch_um / parts, pitches * parts as usize, distance_um)
    }

    /// This window on a plane at another distance (um), about the same point.
    #[must_use]
    pub fn at_distance(self, distance_um: f64) -> Self {
        Self { distance_um, ..self }
    }

    /// Place of sample `i` of an axis (0 for x, 1 for y) from the element's centre (um).
    pub fn coordinate_um(&self, axis: usize, i: usize) -> f64 {
        self.centre_um[axis] + (i as f64 - 0.5 * (self.samples as f64 - 1.0)) * self.step_um
    }

    /// Sample nearest to a place from the element's centre (um) along an axis; the first or the last for one beyond the window.
    pub fn sample_at(&self, axis: usize, place_um: f64) -> usize {
        let last = self.samples as f64 - 1.0;
        ((place_um - self.centre_um[axis]) / self.step_um + 0.5 * last)
            .round()
            .clamp(0.0, last) as usize
    }

    /// Distance from the middle to the outermost sample of an axis (um).
    pub fn half_width_um(&self) -> f64 {
        0.5 * (self.samples as f64 - 1.0) * self.step_um
    }

    pub(crate) fn check(&self, wavelength_um: f64) -> Result<()> {
        let finite = self.centre_um.iter().all(|c| c.is_finite());
        let positive = [self.step_um, self.distance_um, wavelength_um]
            .iter()
            .all(|v| v.is_finite() && *v > 0.0);
        if finite && positive && (1..=MOST_SAMPLES).contains(&self.samples) {
            return Ok(());
        }
        Err(WaveError::Window {
            wavelength_um,
            window: *self,
        })
    }
}
