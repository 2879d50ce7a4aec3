//! The field, and what brings it to a window.

use ndarray::Array2;
use num_complex::Complex32;

use super::aperture::Member;
use super::transfer::FadedColumn;
use super::{Accuracy, Aperture, ApertureSet, Fade, Otf, PlaneWave, Window};
use crate::error::{Result, WaveError};

/// The field on a window, and how it was come by.
#[derive(Clone, Debug)]
pub struct Field {
    /// Window of the samples.
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
    pub(crate) row: Vec<Complex32>,
    pub(crate) wave: [Vec<Complex32>; 2],
    pub(crate) tiles: Vec<Complex32>,
    pub(crate) columns: Vec<Complex32>,
    pub(crate) spectrum: Vec<Complex32>,
    pub(crate) sent: Vec<Complex32>,
    pub(crate) middle: Vec<Complex32>,
    pub(crate) fft: Vec<Complex32>,
    pub(crate) padded: Vec<Complex32>,
    pub(crate) turns: Vec<f64>,
    pub(crate) transfer: Vec<Complex32>,
    pub(crate) column: FadedColumn,
}

/// The way from a lattice of transmissions to the field on one window, at one wavelength.
///
/// A linear map and its adjoint: with the products <a, b> = sum conj(a) b over sites and over samples,
/// <g, field(t)> = <adjoint(g), t> for every t and g.
pub trait Propagator {
    /// Window in which the field is formed.
    fn window(&self) -> &Window;

    /// The field behind `aperture` in the light of `wave`.
    ///
    /// # Errors
    /// If the aperture's lattice or the wave's wavelength is not the one this propagator was made for.
    fn field(&self, aperture: &dyn Aperture, wave: &PlaneWave, scratch: &mut Scratch) -> Result<Field>;

    /// The field, and the transfer of all the light that `aperture` passes at `lp_mm` (line pairs a millimetre), where
    /// this propagator sees light outside of its window.
    ///
    /// # Errors
    /// As [`Propagator::field`].
    fn field_and_otf(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<(Field, Option<Otf>)> {
        let _ = lp_mm;
        Ok((self.field(aperture, wave, scratch)?, None))
    }

    /// [`Propagator::field_and_otf`] of each aperture of a set.
    ///
    /// # Errors
    /// As [`Propagator::field`].
    fn fields_and_otfs(
        &self,
        set: &dyn ApertureSet,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<(Field, Option<Otf>)>> {
        let of = |number| self.field_and_otf(&Member { set, number }, wave, lp_mm, scratch);
        (0..set.count()).map(of).collect()
    }

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
        return Err(WaveError::Wave {
            wave: *wave,
            planned_um: wavelength_um,
        });
    }
    Ok(())
}

pub(crate) fn check_shape<T>(values: &Array2<T>, window: &Window) -> Result<()> {
    if values.dim() == (window.samples, window.samples) {
        return Ok(());
    }
    Err(WaveError::Shape {
        what: "values",
        given: values.dim().into(),
        wanted: [window.samples; 2],
    })
}
