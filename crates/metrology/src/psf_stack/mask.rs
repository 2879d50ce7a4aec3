//! Samples of a mask as the light meets them.

use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView2};
use num_complex::Complex32;

use super::set::Transmission;

/// Complex transmission on blocks of samples.
pub(super) struct Mask {
    values: Array2<Complex32>,
    pub(super) sample_um: f64,
}

impl Mask {
    /// Means over blocks of at most half a sample of the light.
    pub(super) fn new(t: &Transmission, factor: f64, blur_um2: f64, dx_um: f64) -> Self {
        let blurred = (blur_um2 > 0.0).then(|| blurred(&t.phase, blur_um2 / (t.sample_um * t.sample_um)));
        let block = ((0.5 * dx_um / t.sample_um) as usize).max(1);
        let (rows, cols) = t.phase.dim();
        let [m, n] = [rows, cols].map(|n| n.div_ceil(block));
        let mut values = Array2::<Complex32>::zeros((m, n));
        let mut counts = Array2::<f32>::zeros((m, n));
        for ((y, x), phase) in blurred.as_ref().unwrap_or(&t.phase).indexed_iter() {
            let amplitude = t.amplitude.as_ref().map_or(1.0, |a| a[(y, x)]);
            let at = (y / block, x / block);
            values[at] += Complex32::from_polar(amplitude, (f64::from(*phase) * factor).rem_euclid(TAU) as f32);
            counts[at] += 1.0;
        }
        values.zip_mut_with(&counts, |v, n| *v /= *n);
        Self {
            values,
            sample_um: t.sample_um * block as f64,
        }
    }

    /// Mean over a square of an edge about a place (um) from the middle of the object; its outermost samples go on.
    pub(super) fn at(&self, x: f64, y: f64, edge_um: f64) -> Complex32 {
        let (rows, cols) = self.values.dim();
        let [x, y] = [(x, cols), (y, rows)].map(|(v, n)| v / self.sample_um + 0.5 * n as f64);
        boxed(self.values.view(), x, y, 0.5 * edge_um / self.sample_um)
    }
}

/// A map under a Gaussian of a variance (samples squared), by passes over neighbours; its outermost samples go on.
fn blurred(map: &Array2<f32>, variance: f64) -> Array2<f32> {
    /// Variance of one pass, below which its weights are like a Gaussian's.
    const ONE_PASS: f64 = 0.4;
    let passes = (variance / ONE_PASS).ceil().max(1.0);
    let side = (0.5 * variance / passes) as f32;
    let mut out = map.clone();
    for _ in 0..passes as usize {
        for axis in [0, 1] {
            for mut line in out.lanes_mut(ndarray::Axis(axis)) {
                let (n, mut before) = (line.len(), line[0]);
                for k in 0..n {
                    let (own, after) = (line[k], line[(k + 1).min(n - 1)]);
                    line[k] = own + side * (before - 2.0 * own + after);
                    before = own;
                }
            }
        }
    }
    out
}

/// Mean of samples, each a square of edge 1, over a square about a place.
pub(super) fn boxed<T>(values: ArrayView2<'_, T>, x: f64, y: f64, half: f64) -> T
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T> + Default,
{
    let (rows, cols) = values.dim();
    let range = |v: f64, n: usize| {
        // Beyond the rim its samples go on.
        let v = v.clamp(-1.0, n as f64 + 1.0);
        let (low, high) = (v - half, v + half);
        (low.floor() as isize..=high.floor() as isize).filter_map(move |k| {
            let weight = (high.min(k as f64 + 1.0) - low.max(k as f64)) / (2.0 * half);
            (weight > 0.0).then(|| (k.clamp(0, n as isize - 1) as usize, weight as f32))
        })
    };
    let mut sum = T::default();
    for (row, by_row) in range(y, rows) {
        for (col, by_col) in range(x, cols) {
            sum = sum + values[(row, col)] * (by_row * by_col);
        }
    }
    sum
}
