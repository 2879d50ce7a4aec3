//! The field through frequencies, on a period no longer than the window needs.
//!
//! Samples of the aperture are added up modulo the period and transformed; each frequency goes its way to
//! the sensor, weighed by a raised cosine of where its ray lands; the window alone is formed, by chirps.
//! A lattice of point samples is periodic in frequency with 1 / pitch: each frequency that lands near the
//! window takes the bin it is equal to modulo 1 / pitch, so a steep wedge needs no finer lattice.
//!
//! Folding and the fade are exact but for light that leaves the window's neighbourhood; a hard band limit
//! (Matsushima and Shimobaba, Opt. Express 17, 19662 (2009)) would ring instead.

use std::sync::Arc;

use ndarray::{Array2, ArrayViewMut2};
use num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::cis::{accumulate, cis, cis_all, multiply, multiply_conj};
use super::fade::Band;
use super::plane::{check_shape, check_wave};
use super::zoom::{Zoom, process};
use super::{Accuracy, Aperture, Fade, Field, PlaneWave, Propagator, Scratch, Window};
use metalith_core::{Error, Lattice, Result};

/// Columns that travel together between the two transforms: one cache line of samples.
const LANES: usize = 8;

/// A plan for one lattice, wavelength and window; made once, used for any number of apertures and angles.
pub struct Fold {
    lattice: Lattice,
    wavelength_um: f64,
    window: Window,
    accuracy: Accuracy,
    band: Band,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
    zoom: [Zoom; 2],
}

impl Fold {
    /// For apertures on `lattice` that pass nothing outside `radius_um` of their centre. Period and fade
    /// follow from lens, window, distance and the accuracy asked for.
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
        let band = Band::choose(lattice, radius_um, wavelength_um, &window, accuracy)?;
        Ok(Self::with_band(lattice, wavelength_um, window, accuracy, band))
    }

    /// With a period of `bins` samples and a fade of one's own, from `fade_um[0]` to `fade_um[1]`: for those
    /// who study the method.
    ///
    /// # Errors
    /// As [`Fold::plan`], and if the fade does not end after it begins.
    pub fn with_fade(
        lattice: Lattice,
        wavelength_um: f64,
        window: Window,
        bins: usize,
        fade_um: [f64; 2],
    ) -> Result<Self> {
        let band = Band::new(lattice, wavelength_um, &window, bins, fade_um)?;
        Ok(Self::with_band(
            lattice,
            wavelength_um,
            window,
            Accuracy::Accurate,
            band,
        ))
    }

    fn with_band(lattice: Lattice, wavelength_um: f64, window: Window, accuracy: Accuracy, band: Band) -> Self {
        let mut planner = FftPlanner::new();
        let cycles = window.step_um / band.fade.period_um;
        let zoom = [0, 1].map(|a| Zoom::new(&mut planner, band.count[a], band.first[a], window.samples, cycles));
        Self {
            lattice,
            wavelength_um,
            window,
            accuracy,
            forward: planner.plan_fft_forward(band.bins),
            inverse: planner.plan_fft_inverse(band.bins),
            zoom,
            band,
        }
    }

    /// Period and fade that were chosen.
    pub fn fade(&self) -> &Fade {
        &self.band.fade
    }

    /// As [`Propagator::field`], into memory of the caller's. Shape `[samples, samples]`.
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
        check_wave(wave, self.wavelength_um)?;
        if aperture.lattice() != self.lattice {
            return Err(Error::invalid(
                format!(
                    "an aperture on {:?}, planned for {:?}",
                    aperture.lattice(),
                    self.lattice
                ),
                "plan one propagator a lattice",
            ));
        }
        let samples = self.window.samples;
        if values.dim() != (samples, samples) || !values.is_standard_layout() {
            return Err(Error::invalid(
                format!("an array of shape {:?} for a window of {samples} samples", values.dim()),
                "give a contiguous array with one value for each sample of the window",
            ));
        }
        self.rows_forward(aperture, wave, scratch);
        self.columns_forward(scratch);
        let Scratch {
            middle, fft, padded, ..
        } = scratch;
        for (line, mut out) in middle.chunks(self.band.count[0]).zip(values.rows_mut()) {
            let out = out.as_slice_mut().expect("checked above");
            self.zoom[0].run(line, out, padded, fft);
        }
        Ok(())
    }

    /// Rows of the lattice that a row of the period is the sum of.
    fn residues(&self) -> usize {
        self.lattice.sites().min(self.band.bins)
    }

    fn blocks(&self) -> usize {
        self.band.count[0].div_ceil(LANES)
    }

    /// Folds and transforms along x; leaves the kept columns in tiles of `LANES` columns by all rows.
    fn rows_forward(&self, aperture: &dyn Aperture, wave: &PlaneWave, scratch: &mut Scratch) {
        let (n, m, residues) = (self.lattice.sites(), self.band.bins, self.residues());
        self.fill_wave(wave, scratch);
        let Scratch {
            row,
            wave: [wave_x, wave_y],
            tiles,
            columns,
            spectrum,
            fft,
            ..
        } = scratch;
        row.resize(n, Complex32::ZERO);
        columns.resize(m.max(columns.len()), Complex32::ZERO);
        spectrum.resize(self.blocks() * LANES, Complex32::ZERO);
        tiles.resize(self.blocks() * residues * LANES, Complex32::ZERO);
        let folded = &mut columns[..m];
        for r in 0..residues {
            folded.fill(Complex32::ZERO);
            for iy in (r..n).step_by(m) {
                aperture.fill_row(iy, row);
                for (part, wave) in row.chunks(m).zip(wave_x.chunks(m)) {
                    accumulate(&mut folded[..part.len()], part, wave, wave_y[iy]);
                }
            }
            process(&*self.forward, folded, fft);
            gather(&mut spectrum[..self.band.count[0]], folded, self.band.first[0]);
            for (block, lanes) in spectrum.chunks_exact(LANES).enumerate() {
                let at = (block * residues + r) * LANES;
                tiles[at..at + LANES].copy_from_slice(lanes);
            }
        }
    }

    /// Transforms along y, sends each frequency to the sensor, and forms the window's rows of each column.
    fn columns_forward(&self, scratch: &mut Scratch) {
        let (m, residues, samples) = (self.band.bins, self.residues(), self.window.samples);
        let [kx, ky] = self.band.count;
        let Scratch {
            tiles,
            columns,
            spectrum,
            middle,
            fft,
            padded,
            transfer,
            row,
            ..
        } = scratch;
        columns.resize(LANES * m, Complex32::ZERO);
        spectrum.resize(ky, Complex32::ZERO);
        transfer.resize(ky, Complex32::ZERO);
        middle.resize(samples * kx, Complex32::ZERO);
        row.resize(samples.max(row.len()), Complex32::ZERO);
        for (block, tile) in tiles.chunks_exact(residues * LANES).enumerate() {
            let lanes = LANES.min(kx - block * LANES);
            for (lane, column) in columns.chunks_exact_mut(m).enumerate() {
                for (value, line) in column.iter_mut().zip(tile.chunks_exact(LANES)) {
                    *value = line[lane];
                }
                column[residues..].fill(Complex32::ZERO);
            }
            for (lane, column) in columns.chunks_exact_mut(m).enumerate().take(lanes) {
                let k = block * LANES + lane;
                let rows = self.band.rows[k].clone();
                process(&*self.forward, column, fft);
                spectrum.fill(Complex32::ZERO);
                let kept = &mut spectrum[rows.clone()];
                gather(kept, column, self.band.first[1] + rows.start as i64);
                let transfer = &mut transfer[..rows.len()];
                self.transfer(k, transfer);
                multiply(kept, transfer);
                self.zoom[1].run(spectrum, &mut row[..samples], padded, fft);
                for (value, line) in row.iter().zip(middle.chunks_exact_mut(kx)) {
                    line[k] = *value;
                }
            }
        }
    }

    /// What multiplies the kept frequencies of column `k`: the way to the sensor, the fade, the places of the
    /// lattice's first site and of the window's middle, and the weights of both transforms.
    fn transfer(&self, k: usize, out: &mut [Complex32]) {
        let df = 1.0 / self.band.fade.period_um;
        let z = self.window.distance_um;
        let [cx, cy] = self.window.centre_um;
        let x0 = self.lattice.coordinate_um(0);
        let fx = (self.band.first[0] + k as i64) as f64 * df;
        let first = (self.band.first[1] + self.band.rows[k].start as i64) as f64 * df;
        let rest = self.wavelength_um.powi(-2) - fx * fx;
        let along_x = fx * (cx - x0);
        let along_y = cy - x0;
        let Fade { full_um, zero_um, .. } = self.band.fade;
        let slope = 0.5 / (zero_um - full_um);
        let weight = (self.lattice.pitch_um() * df).powi(2) as f32;
        pulp::Arch::new().dispatch(|| {
            for (i, h) in out.iter_mut().enumerate() {
                let fy = first + i as f64 * df;
                // Below the square root of zero light does not propagate; its ray lands at infinity.
                let fz = (rest - fy * fy).max(1e-12).sqrt();
                let turns = z * fz + along_x + fy * along_y;
                let (sx, sy) = (z * fx / fz - cx, z * fy / fz - cy);
                let faded = ((sx * sx + sy * sy).sqrt() - full_um) * slope;
                let fade = (0.5 + 0.5 * cis(faded.clamp(0.0, 0.5)).re) * weight;
                let way = cis(turns);
                *h = Complex32 {
                    re: way.re * fade,
                    im: way.im * fade,
                };
            }
        });
    }

    /// The incident wave along both axes of the lattice.
    fn fill_wave(&self, wave: &PlaneWave, scratch: &mut Scratch) {
        let n = self.lattice.sites();
        for (axis, sine) in [wave.sin_x, wave.sin_y].into_iter().enumerate() {
            let turns = &mut scratch.turns;
            turns.clear();
            turns.extend((0..n).map(|i| self.lattice.coordinate_um(i) * sine / wave.wavelength_um));
            scratch.wave[axis].resize(n, Complex32::ZERO);
            cis_all(turns, &mut scratch.wave[axis]);
        }
    }

    /// The adjoint of `columns_forward`.
    fn columns_adjoint(&self, scratch: &mut Scratch) {
        let (m, residues, samples) = (self.band.bins, self.residues(), self.window.samples);
        let [kx, ky] = self.band.count;
        let Scratch {
            tiles,
            columns,
            spectrum,
            middle,
            fft,
            padded,
            transfer,
            row,
            ..
        } = scratch;
        columns.resize(m.max(columns.len()), Complex32::ZERO);
        spectrum.resize(ky, Complex32::ZERO);
        transfer.resize(ky, Complex32::ZERO);
        row.resize(samples.max(row.len()), Complex32::ZERO);
        tiles.clear();
        tiles.resize(self.blocks() * residues * LANES, Complex32::ZERO);
        let column = &mut columns[..m];
        for k in 0..kx {
            for (value, line) in row.iter_mut().zip(middle.chunks_exact(kx)) {
                *value = line[k];
            }
            self.zoom[1].adjoint(&row[..samples], spectrum, padded, fft);
            let rows = self.band.rows[k].clone();
            let kept = &mut spectrum[rows.clone()];
            let transfer = &mut transfer[..rows.len()];
            self.transfer(k, transfer);
            multiply_conj(kept, transfer);
            column.fill(Complex32::ZERO);
            scatter(column, kept, self.band.first[1] + rows.start as i64);
            process(&*self.inverse, column, fft);
            let tile = &mut tiles[k / LANES * residues * LANES..];
            for (line, value) in tile.chunks_exact_mut(LANES).zip(&column[..residues]) {
                line[k % LANES] = *value;
            }
        }
    }

    /// The adjoint of `rows_forward`, into one value a site.
    fn rows_adjoint(&self, wave: &PlaneWave, scratch: &mut Scratch, sites: &mut Array2<Complex32>) {
        let (n, m, residues) = (self.lattice.sites(), self.band.bins, self.residues());
        self.fill_wave(wave, scratch);
        let Scratch {
            wave: [wave_x, wave_y],
            tiles,
            columns,
            spectrum,
            fft,
            ..
        } = scratch;
        spectrum.resize(self.blocks() * LANES, Complex32::ZERO);
        let folded = &mut columns[..m];
        for r in 0..residues {
            for (block, lanes) in spectrum.chunks_exact_mut(LANES).enumerate() {
                let at = (block * residues + r) * LANES;
                lanes.copy_from_slice(&tiles[at..at + LANES]);
            }
            folded.fill(Complex32::ZERO);
            scatter(folded, &spectrum[..self.band.count[0]], self.band.first[0]);
            process(&*self.inverse, folded, fft);
            for iy in (r..n).step_by(m) {
                let wy = wave_y[iy].conj();
                let mut line = sites.row_mut(iy);
                for (ix, (site, wx)) in line.iter_mut().zip(wave_x.iter()).enumerate() {
                    *site = folded[ix % m] * wx.conj() * wy;
                }
            }
        }
    }
}

impl Propagator for Fold {
    fn window(&self) -> &Window {
        &self.window
    }

    fn field(&self, aperture: &dyn Aperture, wave: &PlaneWave, scratch: &mut Scratch) -> Result<Field> {
        let samples = self.window.samples;
        let mut values = Array2::zeros((samples, samples));
        self.field_into(aperture, wave, scratch, values.view_mut())?;
        Ok(Field {
            window: self.window,
            wave: *wave,
            values,
            fade: Some(self.band.fade),
            accuracy: Some(self.accuracy),
        })
    }

    fn adjoint(
        &self,
        values: &Array2<Complex32>,
        wave: &PlaneWave,
        scratch: &mut Scratch,
    ) -> Result<Array2<Complex32>> {
        check_wave(wave, self.wavelength_um)?;
        check_shape(values, &self.window)?;
        let (n, kx) = (self.lattice.sites(), self.band.count[0]);
        scratch.middle.resize(self.window.samples * kx, Complex32::ZERO);
        scratch
            .row
            .resize(self.window.samples.max(scratch.row.len()), Complex32::ZERO);
        let Scratch {
            middle,
            fft,
            padded,
            row,
            ..
        } = scratch;
        let line_in = &mut row[..self.window.samples];
        for (line, given) in middle.chunks_exact_mut(kx).zip(values.rows()) {
            for (a, b) in line_in.iter_mut().zip(given) {
                *a = *b;
            }
            self.zoom[0].adjoint(line_in, line, padded, fft);
        }
        self.columns_adjoint(scratch);
        let mut sites = Array2::zeros((n, n));
        self.rows_adjoint(wave, scratch, &mut sites);
        Ok(sites)
    }
}

/// Bins `first`, `first + 1`, ... of a periodic spectrum.
fn gather(kept: &mut [Complex32], period: &[Complex32], first: i64) {
    let mut at = first.rem_euclid(period.len() as i64) as usize;
    let mut rest = kept;
    while !rest.is_empty() {
        let n = rest.len().min(period.len() - at);
        let (now, later) = rest.split_at_mut(n);
        now.copy_from_slice(&period[at..at + n]);
        rest = later;
        at = 0;
    }
}

/// The adjoint of [`gather`]: adds to bins `first`, `first + 1`, ...
fn scatter(period: &mut [Complex32], kept: &[Complex32], first: i64) {
    let size = period.len();
    let at = first.rem_euclid(size as i64) as usize;
    for (i, value) in kept.iter().enumerate() {
        period[(at + i) % size] += value;
    }
}
