//! Fourier sums to points of any distance, by convolution with a chirp.

use std::f64::consts::PI;
use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};

use super::light::single;
use super::sampling::fft_size;

/// Sums over samples of each row of an array, to a number of points.
pub(super) struct ChirpSum {
    samples: usize,
    points: usize,
    size: usize,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

/// Factors of one sum.
pub(super) struct Chirp {
    before: Vec<Complex32>,
    spectrum: Vec<Complex32>,
}

impl ChirpSum {
    pub(super) fn new(samples: usize, points: usize) -> Self {
        let size = fft_size((samples + points).next_multiple_of(2));
        Self {
            samples,
            points,
            size,
            forward: forward(size),
            inverse: inverse(size),
        }
    }

    /// The sum of weighted samples under exp(2 pi i rate k j) over samples k for points j, both in steps of one from the first; each
    /// point may have any phase.
    pub(super) fn chirp(&self, [sample, point]: [f64; 2], rate: f64, weight: impl Fn(f64) -> Complex64) -> Chirp {
        // 2 k j = k k + j j - (j - k)(j - k).
        let before = (0..self.samples).map(|k| {
            let k = sample + k as f64;
            single(weight(k) * Complex64::cis(PI * rate * k * k))
        });
        let mut spectrum = vec![Complex32::ZERO; self.size];
        for t in 1 - self.samples as isize..self.points as isize {
            let v = t as f64 + point - sample;
            let scale = 1.0 / self.size as f64;
            spectrum[t.rem_euclid(self.size as isize) as usize] =
                single(Complex64::from_polar(scale, -PI * rate * v * v));
        }
        self.forward.process(&mut spectrum);
        Chirp {
            before: before.collect(),
            spectrum,
        }
    }

    /// The sums of each row; the answer is transposed.
    pub(super) fn sum(&self, rows: &Array2<Complex32>, chirp: &Chirp) -> Array2<Complex32> {
        let n = rows.nrows();
        let mut work = vec![Complex32::ZERO; n * self.size];
        for (line, row) in work.chunks_exact_mut(self.size).zip(rows.outer_iter()) {
            let products = row.iter().zip(&chirp.before).map(|(v, b)| v * b);
            line.iter_mut().zip(products).for_each(|(to, v)| *to = v);
        }
        self.forward.process(&mut work);
        for line in work.chunks_exact_mut(self.size) {
            line.iter_mut().zip(&chirp.spectrum).for_each(|(v, h)| *v *= h);
        }
        self.inverse.process(&mut work);
        /// Edge of a tile that stays in the cache.
        const TILE: usize = 16;
        let mut out = vec![Complex32::ZERO; n * self.points];
        for y0 in (0..n).step_by(TILE) {
            for x0 in (0..self.points).step_by(TILE) {
                for x in x0..(x0 + TILE).min(self.points) {
                    for y in y0..(y0 + TILE).min(n) {
                        out[x * n + y] = work[y * self.size + x];
                    }
                }
            }
        }
        Array2::from_shape_vec((self.points, n), out).expect("as many as points")
    }
}
