//! Imaging from the cells of a pupil to the point spread function over a window and its transform on the pixels'
//! frequencies, and the adjoint of both.

use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use num_complex::Complex32;

use crate::PixelWindow;
use crate::image::buffer_pool::Scratch;
use crate::image::pupil::Pupil;

/// Plans and place to work for one pupil. The field is even in y, so that columns stand for themselves
/// and their mirror images.
pub(crate) struct Imaging<'p> {
    pupil: &'p Pupil,
    window: PixelWindow,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    pub(crate) buffers: Scratch,
}

/// Transfer function at the frequencies (i, j) / window, i and j from 0 to half the pixels: the others
/// follow, H(-i, j) = conj H(i, j) since the PSF is real, and H(i, -j) = H(i, j) since it is even in y.
pub(crate) type OpticalTransfer = Vec<Complex32>;

impl<'p> Imaging<'p> {
    pub(crate) fn new(pupil: &'p Pupil, window: PixelWindow, mut buffers: Scratch) -> Self {
        // Both are written in full before they are read.
        buffers.rows.resize(pupil.cells.1 * pupil.size, Complex32::default());
        buffers
            .field
            .resize(pupil.size * (pupil.size / 2 + 1), Complex32::default());
        let (forward, inverse) = (forward(pupil.size), inverse(pupil.size));
        let scratch = forward.get_inplace_scratch_len().max(inverse.get_inplace_scratch_len());
        Self {
            pupil,
            window,
            forward,
            inverse,
            scratch: vec![Complex32::default(); scratch],
            buffers,
        }
    }

    /// Frequencies an axis from zero to the pixels' Nyquist.
    fn modes(&self) -> usize {
        self.window.pixels / 2 + 1
    }

    /// Transform of the aperture of a square pixel.
    fn pixel(&self, i: usize) -> f32 {
        let x = std::f32::consts::PI * i as f32 / self.window.pixels as f32;
        if i == 0 { 1.0 } else { x.sin() / x }
    }

    /// The transfer function, `[j][i]`, from the transmissions of the rings.
    pub(crate) fn transfer(&mut self, t_re: &[f32], t_im: &[f32]) -> OpticalTransfer {
        self.propagate(t_re, t_im);
        let (n, half, modes) = (self.pupil.size, self.pupil.size / 2 + 1, self.modes());
        // Along y: even and real, two columns in one transform.
        let mut along_y = vec![Complex32::default(); modes * n];
        let mut column = vec![Complex32::default(); n];
        for x in (0..n).step_by(2) {
            let (field_a, field_b) = (&self.buffers.field[x * half..], &self.buffers.field[(x + 1) * half..]);
            let (v_a, v_b) = (self.weight_x(x), self.weight_x(x + 1));
            for (y, (entry, v)) in column.iter_mut().zip(&self.pupil.weight).enumerate() {
                *entry = Complex32::new(field_a[y].norm_sqr() * v_a, field_b[y].norm_sqr() * v_b) * v;
            }
            mirror(&mut column);
            self.forward.process_with_scratch(&mut column, &mut self.scratch);
            for j in 0..modes {
                along_y[j * n + x].re = column[j].re;
                along_y[j * n + x + 1].re = column[j].im;
            }
        }
        let mut transfer = Vec::with_capacity(modes * modes);
        for (j, row) in along_y.chunks_exact_mut(n).enumerate() {
            self.forward.process_with_scratch(row, &mut self.scratch);
            let pixel_y = self.pixel(j);
            transfer.extend((0..modes).map(|i| row[i] * (self.pixel(i) * pixel_y)));
        }
        transfer
    }

    /// Adds to `g_re`, `g_im` the derivative by the conjugate of each ring's transmission of a real number
    /// whose derivative by the transfer function (not its conjugate) is `slope`, at the transmissions last
    /// given to [`Imaging::transfer`].
    pub(crate) fn adjoint(&mut self, slope: &[Complex32], g_re: &mut [f32], g_im: &mut [f32]) {
        let (n, half, modes) = (self.pupil.size, self.pupil.size / 2 + 1, self.modes());
        // dL/dI(x, y) = sum over j of 2 Re[sum over i of slope exp(-2 pi i (i x) / n)] cos(2 pi j y / n)
        let mut along_x = vec![0.0f32; modes * n];
        let mut row = vec![Complex32::default(); n];
        for j in 0..modes {
            row.fill(Complex32::default());
            let pixel_y = self.pixel(j);
            for i in 0..modes {
                row[i] = slope[j * modes + i] * (self.pixel(i) * pixel_y);
            }
            self.forward.process_with_scratch(&mut row, &mut self.scratch);
            for (out, value) in along_x[j * n..(j + 1) * n].iter_mut().zip(&row) {
                *out = 2.0 * value.re;
            }
        }
        let mut column = vec![Complex32::default(); n];
        for x in (0..n).step_by(2) {
            column.fill(Complex32::default());
            for j in 0..modes {
                // The transform of an even sequence counts each entry but the first twice.
                let share = if j == 0 { 1.0 } else { 0.5 };
                column[j] = Complex32::new(along_x[j * n + x], along_x[j * n + x + 1]) * share;
            }
            mirror(&mut column);
            self.forward.process_with_scratch(&mut column, &mut self.scratch);
            let (v_a, v_b) = (self.weight_x(x), self.weight_x(x + 1));
            for (y, (slope, v)) in column.iter().zip(&self.pupil.weight).enumerate() {
                self.buffers.field[x * half + y] *= slope.re * v_a * v;
                self.buffers.field[(x + 1) * half + y] *= slope.im * v_b * v;
            }
        }
        self.propagate_back(g_re, g_im);
    }

    fn weight_x(&self, x: usize) -> f32 {
        self.pupil.weight[x.min(self.pupil.size - x)]
    }

    /// Place of the cell `i` of a row in the transform.
    fn place(&self, i: usize) -> usize {
        (self.pupil.first_x + i as i32).rem_euclid(self.pupil.size as i32) as usize
    }

    fn propagate(&mut self, t_re: &[f32], t_im: &[f32]) {
        let (n, half) = (self.pupil.size, self.pupil.size / 2 + 1);
        let (cells_x, cells_y) = self.pupil.cells;
        let mut cells = vec![Complex32::default(); cells_x * cells_y];
        self.pupil.forward(t_re, t_im, &mut cells);
        self.buffers.rows.fill(Complex32::default());
        for (y, row) in cells.chunks_exact(cells_x).enumerate() {
            for (i, &value) in row.iter().enumerate() {
                let at = y * n + self.place(i);
                self.buffers.rows[at] = value;
            }
        }
        self.inverse
            .process_with_scratch(&mut self.buffers.rows, &mut self.scratch);
        let mut columns = vec![Complex32::default(); BLOCK * n];
        for first in (0..n).step_by(BLOCK) {
            let count = BLOCK.min(n - first);
            columns.fill(Complex32::default());
            for y in 0..cells_y {
                for c in 0..count {
                    let value = self.buffers.rows[y * n + first + c];
                    columns[c * n + y] = value;
                    columns[c * n + (n - y) % n] = value;
                }
            }
            self.inverse
                .process_with_scratch(&mut columns[..count * n], &mut self.scratch);
            for c in 0..count {
                self.buffers.field[(first + c) * half..(first + c + 1) * half]
                    .copy_from_slice(&columns[c * n..c * n + half]);
            }
        }
    }

    /// The adjoint of `propagate`, from `field`.
    fn propagate_back(&mut self, g_re: &mut [f32], g_im: &mut [f32]) {
        let (n, half) = (self.pupil.size, self.pupil.size / 2 + 1);
        let (cells_x, cells_y) = self.pupil.cells;
        let mut columns = vec![Complex32::default(); BLOCK * n];
        for first in (0..n).step_by(BLOCK) {
            let count = BLOCK.min(n - first);
            for c in 0..count {
                let column = &mut columns[c * n..(c + 1) * n];
                column[..half].copy_from_slice(&self.buffers.field[(first + c) * half..(first + c + 1) * half]);
                mirror(column);
            }
            self.forward
                .process_with_scratch(&mut columns[..count * n], &mut self.scratch);
            for y in 0..cells_y {
                // A cell off the axis stands for two.
                let share = if y == 0 { 1.0 } else { 2.0 };
                for c in 0..count {
                    self.buffers.rows[y * n + first + c] = columns[c * n + y] * share;
                }
            }
        }
        self.forward
            .process_with_scratch(&mut self.buffers.rows, &mut self.scratch);
        let mut cells = vec![Complex32::default(); cells_x * cells_y];
        for (y, row) in cells.chunks_exact_mut(cells_x).enumerate() {
            for (i, value) in row.iter_mut().enumerate() {
                *value = self.buffers.rows[y * n + self.place(i)];
            }
        }
        self.pupil.adjoint(&cells, g_re, g_im);
    }
}

/// Columns that are moved between rows and columns at a time: a cache line of them.
const BLOCK: usize = 8;

/// Make a sequence even: entry n - y takes the value of entry y.
fn mirror(column: &mut [Complex32]) {
    let n = column.len();
    for y in 1..n.div_ceil(2) {
        column[n - y] = column[y];
    }
}

#[cfg(test)]
mod tests;
