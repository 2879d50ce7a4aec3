//! The field through frequencies, on a period no longer than the window needs.
//!
//! Samples of the aperture are added up modulo the period and transformed; each frequency goes its way to
//! the sensor, weighed by a fade of where its ray lands; the window alone is formed, by chirps.
//! A lattice of point samples is periodic in frequency with 1 / step of its grid: each frequency that lands near the
//! window takes the bin it is equal to modulo 1 / step, so a steep wedge needs no finer lattice. A hexagonal lattice is
//! a grid of which every other place passes nothing: its orders are among the frequencies of the grid.
//!
//! Folding and the fade are exact but for light that leaves the window's neighbourhood; a hard band limit
//! (Matsushima and Shimobaba, Opt. Express 17, 19662 (2009)) would ring instead.

mod adjoint;
mod forward;
mod otf;
mod planes;

use std::ops::Range;
use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use metalith_pillars::Lattice;
use ndarray::{Array2, ArrayViewMut2};
use num_complex::Complex32;

use super::aperture::Together;
use super::band::FrequencyBand;
use super::chirp_transform::Zoom;
use super::propagator::check_wave;
use super::transfer::{FadedColumn, FrequencyColumn, Transfer};
use super::{Accuracy, Aperture, ApertureSet, Fade, Field, LANES, PlaneWave, Propagator, Scratch, Window};
use crate::error::{Result, WaveError};
use crate::kernels::cis_all;
use planes::Plane;

pub use otf::Otf;

/// A plan for one lattice, wavelength and window; made once, used for any number of apertures and angles.
pub struct FoldedPropagator {
    lattice: Lattice,
    wavelength_um: f64,
    window: Window,
    accuracy: Accuracy,
    band: FrequencyBand,
    forward: [Arc<dyn Fft<f32>>; 2],
    inverse: [Arc<dyn Fft<f32>>; 2],
    zoom: [Zoom; 2],
    /// Blocks of columns whose spectra are held at a time; the rows of the aperture are asked for and transformed once for
    /// each such part.
    blocks_at_once: usize,
}

impl FoldedPropagator {
    /// Plan for apertures on `lattice` that pass nothing outside `radius_um` of their centre. Period and fade follow
    /// from lens, window, distance and the accuracy asked for.
    ///
    /// # Errors
    /// If the window is not one, or so large that the transform would not fit into memory.
    pub fn plan(
        lattice: Lattice,
        radius_um: f64,
        wavelength_um: f64,
        window: Window,
        accuracy: Accuracy,
    ) -> Result<Self> {
        window.check(wavelength_um)?;
        let band = FrequencyBand::choose(lattice, radius_um, wavelength_um, &window, accuracy)?;
        Ok(Self::with_band(lattice, wavelength_um, window, accuracy, band))
    }

    /// Plan with a period of `bins` places of the lattice's grid along x and y and a fade of the caller's, from
    /// `fade_um[0]` to `fade_um[1]`: for those who study the method.
    ///
    /// # Errors
    /// As [`FoldedPropagator::plan`], and if the fade does not end after it begins.
    pub fn with_fade(
        lattice: Lattice,
        wavelength_um: f64,
        window: Window,
        bins: [usize; 2],
        fade_um: [f64; 2],
    ) -> Result<Self> {
        let band = FrequencyBand::new(lattice, wavelength_um, &window, bins, fade_um)?;
        Ok(Self::with_band(
            lattice,
            wavelength_um,
            window,
            Accuracy::Accurate,
            band,
        ))
    }

    fn with_band(
        lattice: Lattice,
        wavelength_um: f64,
        window: Window,
        accuracy: Accuracy,
        band: FrequencyBand,
    ) -> Self {
        let zoom = [0, 1].map(|a| {
            let cycles = window.step_um / band.fade.period_um[a];
            Zoom::new(band.count[a], band.first[a] as f64, window.samples, cycles)
        });
        Self {
            blocks_at_once: band.count[0].div_ceil(LANES),
            lattice,
            wavelength_um,
            window,
            accuracy,
            forward: band.bins.map(forward),
            inverse: band.bins.map(inverse),
            zoom,
            band,
        }
    }

    /// Period and fade that were chosen.
    pub fn fade(&self) -> &Fade {
        &self.band.fade
    }

    /// This plan, holding spectra of columns of at most so many bytes at a time, but at least of a few columns. The
    /// field is the same to the last bit; the rows of the aperture are transformed once for each part.
    #[must_use]
    pub fn within(mut self, bytes: usize) -> Self {
        self.blocks_at_once = (bytes / self.block_bytes()).clamp(1, self.blocks());
        self
    }

    /// Number of parts that a field is formed in, one after the other.
    pub fn parts(&self) -> usize {
        self.blocks().div_ceil(self.blocks_at_once)
    }

    /// Bytes of the spectra of all columns: what a field takes that is formed in one part, but for less than a tenth.
    pub fn spectra_bytes(&self) -> usize {
        self.blocks() * self.block_bytes()
    }

    fn block_bytes(&self) -> usize {
        LANES * self.residues() * size_of::<Complex32>()
    }

    /// Variant of [`Propagator::field`] that writes into the caller's memory. Shape `[samples, samples]`.
    ///
    /// # Errors
    /// As [`Propagator::field`], and if `values` has not the window's shape or its rows are not contiguous.
    pub fn field_into(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        scratch: &mut Scratch,
        mut values: ArrayViewMut2<Complex32>,
    ) -> Result<()> {
        let samples = self.window.samples;
        if values.dim() != (samples, samples) || !values.is_standard_layout() {
            return Err(WaveError::Shape {
                what: "an array",
                given: values.dim().into(),
                wanted: [samples; 2],
            });
        }
        let planes = [Plane::field(self.window)];
        self.spectra(&Together(vec![aperture]), wave, &planes, scratch, &mut |_, _| {})?;
        self.window_rows(0, scratch, &mut values);
        Ok(())
    }

    /// Transforms the apertures of a set to the columns of windows in planes along z, the planes of each aperture one after the
    /// other. `observe` sees the number of an aperture and the spectrum of its field in a plane, column by column: all
    /// rows of the band, the phase counted from the window's middle. Gives the power that each aperture passes (um^2).
    fn spectra(
        &self,
        set: &dyn ApertureSet,
        wave: &PlaneWave,
        planes: &[Plane],
        scratch: &mut Scratch,
        observe: &mut dyn FnMut(usize, &[Complex32]),
    ) -> Result<Vec<f64>> {
        check_wave(wave, self.wavelength_um)?;
        if set.lattice() != self.lattice {
            return Err(WaveError::Lattice {
                given: set.lattice(),
                planned: self.lattice,
            });
        }
        let mut power_um2 = Vec::new();
        let at_once = (self.blocks_at_once / set.count()).max(1);
        for first in (0..self.blocks()).step_by(at_once) {
            let part = first..(first + at_once).min(self.blocks());
            power_um2 = self.rows_forward(set, wave, part.clone(), scratch);
            self.columns_forward(part, (set.count(), planes), scratch, observe);
        }
        Ok(power_um2)
    }

    fn finished(&self, values: Array2<Complex32>, wave: &PlaneWave) -> Field {
        Field {
            window: self.window,
            wave: *wave,
            values,
            fade: Some(self.band.fade),
            accuracy: Some(self.accuracy),
        }
    }

    /// Rows of the lattice that pass anything.
    fn rows(&self) -> Range<usize> {
        let [_, rows] = self.lattice.reach();
        rows
    }

    /// Rows of the period that rows of the lattice are added up in.
    fn residues(&self) -> usize {
        self.rows().len().min(self.band.bins[1])
    }

    /// Rows of the lattice that are added up in a row of the period.
    fn rows_of(&self, residue: usize) -> std::iter::StepBy<Range<usize>> {
        let rows = self.rows();
        (rows.start + residue..rows.end).step_by(self.band.bins[1])
    }

    fn blocks(&self) -> usize {
        self.band.count[0].div_ceil(LANES)
    }

    /// Factors of the retained frequencies of column `k` of the band on their way to a plane.
    fn transfer(&self, plane: &Plane, k: usize, faded: &mut FadedColumn, out: &mut [Complex32]) {
        let Plane { window, slope, .. } = plane;
        let z = window.distance_um;
        let first = [0, self.rows().start];
        let transfer = Transfer {
            wavelength_um: self.wavelength_um,
            centre_um: window.centre_um,
            shift_um: [0, 1].map(|a| window.centre_um[a] - self.lattice.place_um(a, first[a])),
            fade: &self.band.fade,
            cell_um: self.lattice.cell_um(),
        };
        let column = FrequencyColumn {
            first: [
                (self.band.first[0] + k as i64) as f64,
                (self.band.first[1] + self.band.rows[k].start as i64) as f64,
            ],
            count: out.len(),
        };
        transfer.fade(plane.faded_at_um, column, faded);
        transfer.to_distance(z, column, faded, out);
        if *slope {
            transfer.slope(faded, out);
        }
    }

    /// The incident wave along both axes of the lattice.
    fn fill_wave(&self, wave: &PlaneWave, scratch: &mut Scratch) {
        let n = self.lattice.sites();
        for (axis, sine) in [wave.sin_x, wave.sin_y].into_iter().enumerate() {
            let turns = &mut scratch.turns;
            turns.clear();
            turns.extend((0..n).map(|i| self.lattice.place_um(axis, i) * sine / wave.wavelength_um));
            scratch.wave[axis].resize(n, Complex32::ZERO);
            cis_all(turns, &mut scratch.wave[axis]);
        }
    }
}

impl Propagator for FoldedPropagator {
    fn window(&self) -> &Window {
        &self.window
    }

    fn field(&self, aperture: &dyn Aperture, wave: &PlaneWave, scratch: &mut Scratch) -> Result<Field> {
        let samples = self.window.samples;
        let mut values = Array2::zeros((samples, samples));
        self.field_into(aperture, wave, scratch, values.view_mut())?;
        Ok(self.finished(values, wave))
    }

    fn field_and_otf(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<(Field, Option<Otf>)> {
        let one = self.fields_and_otfs(&Together(vec![aperture]), wave, lp_mm, scratch)?;
        Ok(one.into_iter().next().expect("a set of one"))
    }

    fn fields_and_otfs(
        &self,
        set: &dyn ApertureSet,
        wave: &PlaneWave,
        lp_mm: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<(Field, Option<Otf>)>> {
        self.with_otfs(set, wave, lp_mm, scratch)
    }

    fn adjoint(
        &self,
        values: &Array2<Complex32>,
        wave: &PlaneWave,
        scratch: &mut Scratch,
    ) -> Result<Array2<Complex32>> {
        self.adjoint_at(values, wave, self.window.distance_um, scratch)
    }
}
