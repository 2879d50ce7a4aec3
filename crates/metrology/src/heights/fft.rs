//! Fourier transforms over two axes.

use std::sync::Arc;

use metalith_fourier::{Fft, Precision, forward};
use num_complex::Complex;

/// Transforms of arrays of one size, row by row.
pub(crate) struct Fft2<T: Precision> {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    along: [Arc<dyn Fft<T>>; 2],
}

impl<T: Precision> Fft2<T> {
    /// Transforms of `rows` x `cols` numbers, forward or inverse (not normalised).
    pub(crate) fn new(rows: usize, cols: usize, inverse: bool) -> Self {
        let plan = if inverse { metalith_fourier::inverse } else { forward };
        Self {
            rows,
            cols,
            along: [plan(cols), plan(rows)],
        }
    }

    /// Transform; the answer is transposed: `cols` rows of `rows` numbers.
    pub(crate) fn transposed(&self, mut values: Vec<Complex<T>>) -> Vec<Complex<T>> {
        self.along[0].process(&mut values);
        let mut turned = transpose(&values, self.rows, self.cols);
        self.along[1].process(&mut turned);
        turned
    }
}

/// Rows as columns.
pub(crate) fn transpose<V: Copy>(values: &[V], rows: usize, cols: usize) -> Vec<V> {
    /// Edge of a tile that stays in the cache.
    const TILE: usize = 16;
    let mut out = values.to_vec();
    for y0 in (0..rows).step_by(TILE) {
        for x0 in (0..cols).step_by(TILE) {
            for y in y0..(y0 + TILE).min(rows) {
                for x in x0..(x0 + TILE).min(cols) {
                    out[x * rows + y] = values[y * cols + x];
                }
            }
        }
    }
    out
}

/// Frequency of the sample `k` of `n`, in cycles per sample.
pub(crate) fn frequency(k: usize, n: usize) -> f64 {
    let k = k as f64;
    let n = n as f64;
    (if k > n / 2.0 { k - n } else { k }) / n
}
