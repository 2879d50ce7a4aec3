//! What arrives at an element, where its field is wanted, and who brings it there.

use ndarray::Array2;
use num_complex::Complex32;

use super::{Accuracy, Aperture, Fade};
use metalith_core::{Error, Result};

/// A plane wave of unit amplitude in the plane of the pillar tops: exp(i k (x sin_x + y sin_y)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneWave {
    /// Vacuum wavelength [um].
    pub wavelength_um: f64,
    /// Sine of the angle of incidence in the x-z plane, as seen in air.
    pub sin_x: f64,
    /// Sine of the angle of incidence in the y-z plane, as seen in air.
    pub sin_y: f64,
}

impl PlaneWave {
    /// Along the normal of the chip.
    pub fn normal(wavelength_um: f64) -> Self {
        Self {
            wavelength_um,
            sin_x: 0.0,
            sin_y: 0.0,
        }
    }

    /// Phase at a place of the aperture [turns].
    pub fn turns(&self, x_um: f64, y_um: f64) -> f64 {
        (x_um * self.sin_x + y_um * self.sin_y) / self.wavelength_um
    }
}

/// A square of sample points on a plane behind the element, parallel to it.
///
/// Sample `i` of an axis is at `centre + (i - (samples - 1) / 2) * step`; row index along +y, column
/// index along +x, as in a camera's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Middle of the window from the element's centre, x and y [um].
    pub centre_um: [f64; 2],
    /// Distance of neighbouring samples [um].
    pub step_um: f64,
    /// Samples an axis.
    pub samples: usize,
    /// Distance of the plane from the pillar tops [um].
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

    /// Place of sample `i` of an axis (0 for x, 1 for y) from the element's centre [um].
    pub fn coordinate_um(&self, axis: usize, i: usize) -> f64 {
        self.centre_um[axis] + (i as f64 - 0.5 * (self.samples as f64 - 1.0)) * self.step_um
    }

    /// From the middle to the outermost sample of an axis [um].
    pub fn half_width_um(&self) -> f64 {
        0.5 * (self.samples as f64 - 1.0) * self.step_um
    }

    pub(super) fn check(&self, wavelength_um: f64) -> Result<()> {
        let finite = self.centre_um.iter().all(|c| c.is_finite());
        let positive = [self.step_um, self.distance_um, wavelength_um]
            .iter()
            .all(|v| v.is_finite() && *v > 0.0);
        if finite && positive && (1..=1 << 13).contains(&self.samples) {
            return Ok(());
        }
        Err(Error::invalid(
            format!(
                "no field can be had at {wavelength_um} um on {} x {} samples of {} um about {:?} um, {} um away",
                self.samples, self.samples, self.step_um, self.centre_um, self.distance_um
            ),
            "use a positive wavelength, step and distance, a finite place, and 1 to 8192 samples",
        ))
    }
}

/// The field on a window, and how it was come by.
#[derive(Clone, Debug)]
pub struct Field {
    /// Where the samples are.
    pub window: Window,
    /// The wave that arrived at the element.
    pub wave: PlaneWave,
    /// Complex amplitude, for a unit wave at the aperture. Shape `[samples, samples]`, row index along
    /// +y, column index along +x.
    pub values: Array2<Complex32>,
    /// Period and fade, where the field came through frequencies; none for a direct sum.
    pub fade: Option<Fade>,
    /// Accuracy asked for; none for a direct sum, which is limited by rounding alone.
    pub accuracy: Option<Accuracy>,
}

/// Working memory of a propagator, owned by the caller: made once a thread with `Scratch::default()`,
/// grown by the first call, used by any number of calls after it.
#[derive(Default)]
pub struct Scratch {
    pub(super) row: Vec<Complex32>,
    pub(super) wave: [Vec<Complex32>; 2],
    pub(super) tiles: Vec<Complex32>,
    pub(super) columns: Vec<Complex32>,
    pub(super) spectrum: Vec<Complex32>,
    pub(super) middle: Vec<Complex32>,
    pub(super) fft: Vec<Complex32>,
    pub(super) padded: Vec<Complex32>,
    pub(super) turns: Vec<f64>,
    pub(super) transfer: Vec<Complex32>,
}

/// The way from a lattice of transmissions to the field on one window, at one wavelength.
///
/// A linear map and its adjoint: with the products <a, b> = sum conj(a) b over sites and over samples,
/// <g, field(t)> = <adjoint(g), t> for every t and g.
pub trait Propagator {
    /// Where the field is formed.
    fn window(&self) -> &Window;

    /// The field behind `aperture` in the light of `wave`.
    ///
    /// # Errors
    /// If the aperture's lattice or the wave's wavelength is not the one this propagator was made for.
    fn field(&self, aperture: &dyn Aperture, wave: &PlaneWave, scratch: &mut Scratch) -> Result<Field>;

    /// The adjoint of [`Propagator::field`]: from values on the window to values on the lattice, shape
    /// `[sites, sites]`, before the aperture and including the wave.
    ///
    /// # Errors
    /// As [`Propagator::field`], and if `values` has not the window's shape.
    fn adjoint(&self, values: &Array2<Complex32>, wave: &PlaneWave, scratch: &mut Scratch)
    -> Result<Array2<Complex32>>;
}

pub(super) fn check_wave(wave: &PlaneWave, wavelength_um: f64) -> Result<()> {
    if wave.wavelength_um != wavelength_um || wave.sin_x.hypot(wave.sin_y) >= 1.0 {
        return Err(Error::invalid(
            format!(
                "a wave of {} um with sines {}, {} meets a propagator planned for {wavelength_um} um",
                wave.wavelength_um, wave.sin_x, wave.sin_y
            ),
            "plan one propagator a wavelength, and keep the sine of the angle below one",
        ));
    }
    Ok(())
}

pub(super) fn check_shape(values: &Array2<Complex32>, window: &Window) -> Result<()> {
    if values.dim() == (window.samples, window.samples) {
        return Ok(());
    }
    Err(Error::invalid(
        format!(
            "values of shape {:?} for a window of {} samples an axis",
            values.dim(),
            window.samples
        ),
        "give one value for each sample of the window",
    ))
}
