//! Transforms of real squares.

use std::sync::Arc;

use metalith_fourier::{ComplexToReal, Fft, RealToComplex, forward, inverse, real_forward, real_inverse};
use ndarray::Array2;
use num_complex::Complex32;

/// Transforms of squares of `size` real values an axis. A spectrum holds the columns of half of the frequencies along x,
/// each with all those along y: `size / 2 + 1` times `size` values.
pub struct SquareFft {
    size: usize,
    rows: Arc<dyn RealToComplex<f32>>,
    rows_back: Arc<dyn ComplexToReal<f32>>,
    columns: Arc<dyn Fft<f32>>,
    columns_back: Arc<dyn Fft<f32>>,
}

/// Working memory of a transform.
#[derive(Default)]
pub struct FftScratch {
    lines: Vec<Complex32>,
    work: Vec<Complex32>,
}

impl SquareFft {
    /// Transform for squares of an even `size`.
    pub fn new(size: usize) -> Self {
        Self {
            size,
            rows: real_forward(size),
            rows_back: real_inverse(size),
            columns: forward(size),
            columns_back: inverse(size),
        }
    }

    /// Values an axis.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Entries of a spectrum.
    pub fn entries(&self) -> usize {
        (self.size / 2 + 1) * self.size
    }

    fn prepare(&self, scratch: &mut FftScratch) {
        let most = [
            self.rows.get_scratch_len(),
            self.rows_back.get_scratch_len(),
            self.columns.get_inplace_scratch_len(),
            self.columns_back.get_inplace_scratch_len(),
        ];
        let most = most.into_iter().max().unwrap_or(0);
        scratch.work.resize(most.max(scratch.work.len()), Complex32::ZERO);
        scratch.lines.resize(self.entries(), Complex32::ZERO);
    }

    /// Spectrum of a square, which is used up; rows from `filled` on are taken to be zero.
    pub fn forward(&self, square: &mut [f32], filled: usize, spectrum: &mut [Complex32], scratch: &mut FftScratch) {
        self.prepare(scratch);
        let (n, half) = (self.size, self.size / 2 + 1);
        let FftScratch { lines, work } = scratch;
        let rows = square.chunks_exact_mut(n).zip(lines.chunks_exact_mut(half));
        for (row, line) in rows.take(filled) {
            // Fails for wrong lengths alone.
            self.rows
                .process_with_scratch(row, line, &mut work[..self.rows.get_scratch_len()])
                .expect("lengths are those of the plan");
        }
        // What is not filled stays zero.
        spectrum.fill(Complex32::ZERO);
        transpose(&lines[..filled * half], half, spectrum, n);
        let need = self.columns.get_inplace_scratch_len();
        self.columns.process_with_scratch(spectrum, &mut work[..need]);
    }

    /// Spectrum of a plane in the first corner of a square of zeros.
    pub fn of_plane(&self, plane: &Array2<f32>, scratch: &mut FftScratch) -> Vec<Complex32> {
        let n = self.size;
        let mut square = vec![0.0f32; n * n];
        for (line, row) in square.chunks_exact_mut(n).zip(plane.rows()) {
            line.iter_mut().zip(row).for_each(|(to, v)| *to = *v);
        }
        let mut spectrum = vec![Complex32::ZERO; self.entries()];
        self.forward(&mut square, plane.nrows(), &mut spectrum, scratch);
        spectrum
    }

    /// The plane of so many rows and columns in the first corner of the square of a spectrum, which is used up.
    pub fn to_plane(&self, spectrum: &mut [Complex32], shape: (usize, usize), scratch: &mut FftScratch) -> Array2<f32> {
        let n = self.size;
        let mut square = vec![0.0f32; n * n];
        self.inverse(spectrum, &mut square, shape.0, scratch);
        Array2::from_shape_fn(shape, |(y, x)| square[y * n + x])
    }

    /// The first `wanted` rows of the square of a spectrum, which is used up. Scaled so that it undoes
    /// [`SquareFft::forward`].
    pub fn inverse(&self, spectrum: &mut [Complex32], square: &mut [f32], wanted: usize, scratch: &mut FftScratch) {
        self.prepare(scratch);
        let (n, half) = (self.size, self.size / 2 + 1);
        let FftScratch { lines, work } = scratch;
        let need = self.columns_back.get_inplace_scratch_len();
        self.columns_back.process_with_scratch(spectrum, &mut work[..need]);
        transpose(spectrum, n, lines, half);
        let scale = 1.0 / (n * n) as f32;
        let rows = square.chunks_exact_mut(n).zip(lines.chunks_exact_mut(half));
        for (row, line) in rows.take(wanted) {
            // Rounding leaves next to nothing where a real square has exactly none.
            line[0].im = 0.0;
            line[half - 1].im = 0.0;
            self.rows_back
                .process_with_scratch(line, row, &mut work[..self.rows_back.get_scratch_len()])
                .expect("lengths are those of the plan");
            row.iter_mut().for_each(|v| *v *= scale);
        }
    }
}

/// `to[j][i] = from[i][j]` for all of `from`, with so many values a row of both, by blocks that fit the cache.
fn transpose(from: &[Complex32], columns: usize, to: &mut [Complex32], rows: usize) {
    const BLOCK: usize = 8;
    let mut bands = from.chunks_exact(BLOCK * columns);
    for (band, block) in bands.by_ref().enumerate() {
        let lines: [&[Complex32]; BLOCK] = std::array::from_fn(|k| &block[k * columns..][..columns]);
        for (j, to) in to.chunks_exact_mut(rows).take(columns).enumerate() {
            let to = &mut to[band * BLOCK..][..BLOCK];
            to.iter_mut().zip(&lines).for_each(|(t, line)| *t = line[j]);
        }
    }
    let done = from.len() / columns / BLOCK * BLOCK;
    for (k, line) in bands.remainder().chunks_exact(columns).enumerate() {
        for (j, value) in line.iter().enumerate() {
            to[j * rows + done + k] = *value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_of_spectra_is_a_convolution() {
        // Single precision of sums over some hundred values of size one.
        const SINGLE: f32 = 1e-4;
        let n = 24;
        let fft = SquareFft::new(n);
        let mut scratch = FftScratch::default();
        let a: Vec<f32> = (0..n * n)
            .map(|i| if i / n < 9 { ((i * 7) % 11) as f32 / 11.0 } else { 0.0 })
            .collect();
        let b: Vec<f32> = (0..n * n).map(|i| ((i * i) % 13) as f32 / 13.0 - 0.5).collect();
        let mut spectra = [
            vec![Complex32::ZERO; fft.entries()],
            vec![Complex32::ZERO; fft.entries()],
        ];
        fft.forward(&mut a.clone(), 9, &mut spectra[0], &mut scratch);
        fft.forward(&mut b.clone(), n, &mut spectra[1], &mut scratch);
        let mut product: Vec<Complex32> = spectra[0].iter().zip(&spectra[1]).map(|(x, y)| x * y).collect();
        let mut got = vec![0.0; n * n];
        fft.inverse(&mut product, &mut got, n, &mut scratch);
        for (y, x) in [(0, 0), (3, 20), (17, 5)] {
            let mut want = 0.0;
            for (i, a) in a.iter().enumerate() {
                let (dy, dx) = ((y + n - i / n) % n, (x + n - i % n) % n);
                want += a * b[dy * n + dx];
            }
            assert!((got[y * n + x] - want).abs() < SINGLE, "{} {want}", got[y * n + x]);
        }
    }
}
