//! The sensor: pixels, blur, displacement, and the comparison of a frame with a prediction.

use std::f64::consts::{PI, TAU};

use nalgebra::DMatrix;
use ndarray::Array2;
use num_complex::{Complex32, Complex64};

use super::frames::level_of;
use super::sampling::Sampling;
use super::set::StackPlane;
use crate::heights::fft::{Fft2, frequency};

/// A displacement is found when a step is below this (pixels).
const FOUND_PX: f64 = 0.003;

/// Steps towards a displacement.
pub(super) const STEPS: usize = 4;

/// A frame without its level, of norm one.
pub(super) struct Measured {
    pub values: Vec<f32>,
    /// 1 for pixels that are used, else 0.
    pub used: Vec<f32>,
    /// Largest value.
    pub peak: f64,
    /// Conjugate spectrum within the padded window, for correlations.
    spectrum: Vec<Complex32>,
}

/// Prediction of a frame, displaced to where the frame is, with its changes along x and y (per pixel).
pub(super) struct Images {
    pub value: Vec<f32>,
    pub along: [Vec<f32>; 2],
}

/// Transforms of a sensor.
pub(super) struct Detector {
    rows: usize,
    cols: usize,
    padded: [usize; 2],
    fine: usize,
    forward: Fft2<f32>,
    inverse: Fft2<f32>,
    /// Of the padded window, one value a pixel.
    pixels: [Fft2<f32>; 2],
}

impl Detector {
    pub(super) fn new(rows: usize, cols: usize, sampling: &Sampling) -> Self {
        let [m, n] = sampling.padded;
        let [fm, fn_] = sampling.padded.map(|k| k * sampling.fine);
        Self {
            rows,
            cols,
            padded: sampling.padded,
            fine: sampling.fine,
            forward: Fft2::new(fm, fn_, false),
            inverse: Fft2::new(fn_, fm, true),
            pixels: [Fft2::new(m, n, false), Fft2::new(n, m, true)],
        }
    }

    /// A frame as it is compared.
    pub(super) fn measured(&self, plane: &StackPlane, background: bool) -> Measured {
        let level = if background {
            f64::from(level_of(&plane.frame))
        } else {
            0.0
        };
        let used: Vec<f32> = plane.used.iter().map(|u| f32::from(u8::from(*u))).collect();
        let own = || plane.frame.iter().zip(&used);
        let squares: f64 = own()
            .map(|(v, u)| (f64::from(*u) * (f64::from(*v) - level)).powi(2))
            .sum();
        let norm = squares.sqrt().max(f64::MIN_POSITIVE);
        let values: Vec<f32> = own()
            .map(|(v, u)| ((f64::from(*v) - level) / norm) as f32 * u)
            .collect();
        let peak = values.iter().fold(0.0_f32, |a, b| a.max(*b));
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let [m, n] = self.padded;
        let (top, left) = ((m - self.rows) / 2, (n - self.cols) / 2);
        let mut field = vec![Complex32::ZERO; m * n];
        for y in 0..self.rows {
            for x in 0..self.cols {
                field[(y + top) * n + x + left].re = values[y * self.cols + x] - mean * used[y * self.cols + x];
            }
        }
        let spectrum = self.pixels[0].transposed(field).into_iter().map(|v| v.conj()).collect();
        Measured {
            values,
            used,
            peak: f64::from(peak),
            spectrum,
        }
    }

    /// Spectrum of an intensity on fine points, averaged over pixels and blurred (variances along x and y, um^2).
    pub(super) fn spectrum(&self, intensity: Array2<f32>, pixel_um: f64, blur_um2: [f64; 2]) -> Vec<Complex32> {
        let field = intensity.into_iter().map(Complex32::from).collect();
        let mut spectrum = self.forward.transposed(field);
        let fine = self.fine as f64;
        // A pixel of an even number of points has its middle between two of them.
        let between = 0.5 * ((self.fine + 1) % 2) as f64;
        let factors = |n: usize, variance: f64| -> Vec<Complex32> {
            let factor = |k: usize| {
                let f = frequency(k, n);
                let t = PI * f * fine;
                let box_of_pixel = if t == 0.0 { 1.0 } else { t.sin() / t };
                let gaussian = (-2.0 * PI * PI * (f * fine / pixel_um).powi(2) * variance).exp();
                let v = Complex64::cis(TAU * f * between) * (box_of_pixel * gaussian);
                Complex32::new(v.re as f32, v.im as f32)
            };
            (0..n).map(factor).collect()
        };
        let (m, n) = (self.forward.rows, self.forward.cols);
        let (by_x, by_y) = (factors(n, blur_um2[0]), factors(m, blur_um2[1]));
        for (row, fx) in spectrum.chunks_exact_mut(m).zip(&by_x) {
            row.iter_mut().zip(&by_y).for_each(|(v, fy)| *v *= fx * fy);
        }
        spectrum
    }

    /// Fine points of two real images, displaced (pixels): a spectrum under two real factors by the frequencies (cycles per pixel).
    fn back(&self, spectrum: &[Complex32], shift: [f64; 2], factors: impl Fn(f64, f64) -> [f32; 2]) -> Vec<Complex32> {
        let (m, n) = (self.forward.rows, self.forward.cols);
        let fine = self.fine as f64;
        let line = |n: usize, shift: f64| -> Vec<(f64, Complex32)> {
            let one = |k: usize| {
                let f = frequency(k, n) * fine;
                let v = Complex64::cis(-TAU * f * shift);
                (f, Complex32::new(v.re as f32, v.im as f32))
            };
            (0..n).map(one).collect()
        };
        let (by_x, by_y) = (line(n, shift[0]), line(m, shift[1]));
        let scale = 1.0 / (m * n) as f32;
        let mut out = Vec::with_capacity(m * n);
        for (row, (fx, px)) in spectrum.chunks_exact(m).zip(&by_x) {
            out.extend(row.iter().zip(&by_y).map(|(v, (fy, py))| {
                let [a, b] = factors(*fx, *fy);
                v * px * py * Complex32::new(a, b) * scale
            }));
        }
        self.inverse.transposed(out)
    }

    /// Values at the middles of pixels: of the window, or of the padded one.
    fn pick(&self, fine: &[Complex32], padded: bool, part: impl Fn(&Complex32) -> f32) -> Vec<f32> {
        let [m, n] = self.padded;
        let (rows, cols) = if padded { (m, n) } else { (self.rows, self.cols) };
        let (top, left) = ((m - rows) / 2, (n - cols) / 2);
        let (s, width) = (self.fine, n * self.fine);
        let at = |k: usize, first: usize| (k + first) * s + (s - 1) / 2;
        let mut out = Vec::with_capacity(rows * cols);
        for y in 0..rows {
            let line = at(y, top) * width;
            out.extend((0..cols).map(|x| part(&fine[line + at(x, left)])));
        }
        out
    }

    /// A displaced image.
    pub(super) fn image(&self, spectrum: &[Complex32], shift: [f64; 2]) -> Vec<f32> {
        self.pick(&self.back(spectrum, shift, |_, _| [1.0, 0.0]), false, |v| v.re)
    }

    /// A displaced image and its slopes.
    pub(super) fn images(&self, spectrum: &[Complex32], shift: [f64; 2]) -> Images {
        // The slope has the factor 2 pi i f; as the imaginary part of the answer it is i times that.
        let first = self.back(spectrum, shift, |fx, _| [1.0 - (TAU * fx) as f32, 0.0]);
        let second = self.back(spectrum, shift, |_, fy| [-(TAU * fy) as f32, 0.0]);
        Images {
            value: self.pick(&first, false, |v| v.re),
            along: [self.pick(&first, false, |v| v.im), self.pick(&second, false, |v| v.im)],
        }
    }

    /// Whole pixels by which a prediction has to be displaced, and the correlation there.
    pub(super) fn correlate(&self, spectrum: &[Complex32], measured: &Measured, most: [usize; 2]) -> ([f64; 2], f64) {
        let [m, n] = self.padded;
        let whole = self.pick(&self.back(spectrum, [0.0; 2], |_, _| [1.0, 0.0]), true, |v| v.re);
        let mean = whole.iter().sum::<f32>() / whole.len() as f32;
        let norm = whole.iter().map(|v| f64::from(v - mean).powi(2)).sum::<f64>().sqrt();
        let own = self.pixels[0].transposed(whole.into_iter().map(|v| Complex32::from(v - mean)).collect());
        let product = own
            .iter()
            .zip(&measured.spectrum)
            .map(|(a, b)| (a * b).conj())
            .collect();
        let found = self.pixels[1].transposed(product);
        let signed = |k: usize, n: usize| if 2 * k > n { k as isize - n as isize } else { k as isize };
        let inside = |k: usize| {
            let (y, x) = (signed(k / n, m), signed(k % n, n));
            y.unsigned_abs() <= most[1] && x.unsigned_abs() <= most[0]
        };
        let best = (0..found.len())
            .filter(|&k| inside(k))
            .max_by(|&a, &b| found[a].re.total_cmp(&found[b].re));
        let best = best.unwrap_or(0);
        let of_measured: f64 = measured.spectrum.iter().map(|v| f64::from(v.norm_sqr())).sum::<f64>() / (m * n) as f64;
        let peak = f64::from(found[best].re) / (m * n) as f64;
        let shift = [signed(best % n, n) as f64, signed(best / n, m) as f64];
        (shift, peak / (norm * of_measured.sqrt()).max(f64::MIN_POSITIVE))
    }

    /// Displacement of a prediction to where the frame is, as least squares have it, with the images there; and whether steps were
    /// short.
    pub(super) fn register(
        &self,
        spectrum: &[Complex32],
        measured: &Measured,
        from: [f64; 2],
        steps: usize,
    ) -> (([f64; 2], Images), bool) {
        let (mut shift, mut is_near) = (from, true);
        let mut images = self.images(spectrum, shift);
        for _ in 0..steps {
            let all = [
                &images.value,
                &measured.used,
                &images.along[0],
                &images.along[1],
                &measured.values,
            ];
            let mut form = DMatrix::<f64>::zeros(5, 5);
            for i in 0..5 {
                for j in 0..=i {
                    form[(i, j)] = dot_used(all[i], all[j], &measured.used);
                    form[(j, i)] = form[(i, j)];
                }
            }
            let normal = form.view((0, 0), (4, 4)).into_owned();
            let right = form.view((0, 4), (4, 1)).into_owned();
            let found = normal.cholesky().map(|c| c.solve(&right));
            let Some(found) = found.filter(|found| found[0] > 0.0) else {
                is_near = false;
                break;
            };
            let step = [2, 3].map(|k| -found[k] / found[0]);
            is_near &= step.iter().all(|v| v.abs() < 1.0);
            let step = step.map(|v| v.clamp(-1.0, 1.0));
            let next = [0, 1].map(|k| (shift[k] + step[k]).clamp(from[k] - 3.0, from[k] + 3.0));
            if step[0].hypot(step[1]) < FOUND_PX {
                break;
            }
            shift = next;
            images = self.images(spectrum, shift);
        }
        ((shift, images), is_near)
    }
}

fn dot_used(a: &[f32], b: &[f32], used: &[f32]) -> f64 {
    let lanes = |k: usize| a[k] * used[k] * b[k];
    summed(a.len(), lanes)
}

/// Sum of products.
pub(super) fn dot(a: &[f32], b: &[f32]) -> f64 {
    summed(a.len().min(b.len()), |k| a[k] * b[k])
}

/// Sum of values, in single precision over few of them only.
fn summed(n: usize, value: impl Fn(usize) -> f32) -> f64 {
    const LANES: usize = 8;
    const BLOCK: usize = 4 * LANES;
    let mut sums = [0.0_f64; LANES];
    for first in (0..n / BLOCK * BLOCK).step_by(BLOCK) {
        let mut own = [0.0_f32; LANES];
        for at in (first..first + BLOCK).step_by(LANES) {
            for (k, v) in own.iter_mut().enumerate() {
                *v += value(at + k);
            }
        }
        for (sum, v) in sums.iter_mut().zip(own) {
            *sum += f64::from(v);
        }
    }
    let rest: f64 = (n / BLOCK * BLOCK..n).map(|k| f64::from(value(k))).sum();
    sums.iter().sum::<f64>() + rest
}

/// Sums of products of columns, with other columns eliminated.
pub(super) fn eliminated(columns: &[&[f32]], own: &[&[f32]]) -> DMatrix<f64> {
    let k = own.len();
    let all = |i: usize| if i < k { own[i] } else { columns[i - k] };
    eliminate(k, k + columns.len(), &mut |i, j| dot(all(i), all(j)))
}

/// Products of columns, of which the first `k` are eliminated.
pub(super) fn eliminate(k: usize, all: usize, product: &mut dyn FnMut(usize, usize) -> f64) -> DMatrix<f64> {
    let mut form = DMatrix::<f64>::zeros(all, all);
    for i in 0..all {
        for j in 0..=i {
            form[(i, j)] = product(i, j);
            form[(j, i)] = form[(i, j)];
        }
    }
    let squares: Vec<f64> = (0..k).map(|p| form[(p, p)]).collect();
    for (p, square) in squares.into_iter().enumerate() {
        let pivot = form[(p, p)];
        // One that others hold already is rounding.
        if pivot <= 1e-7 * square {
            continue;
        }
        let row: Vec<f64> = (0..all).map(|j| form[(p, j)] / pivot).collect();
        for i in p + 1..all {
            let factor = form[(i, p)];
            for (j, v) in row.iter().enumerate().skip(p + 1) {
                form[(i, j)] -= factor * v;
            }
        }
    }
    let n = all - k;
    let mut out = form.view((k, k), (n, n)).into_owned();
    for i in 0..n {
        out[(i, i)] = out[(i, i)].max(0.0);
    }
    out
}
