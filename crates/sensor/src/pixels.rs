//! Sampling of intensity on fine samples by the pixels of a camera.
//!
//! Intensity is band-limited, so all of this happens on its spectrum and is exact; the samples that stand
//! around the window are faded out towards their border, which keeps its far side from coming in.

use metalith_core::part;
use ndarray::Array2;
use num_complex::Complex32;

use crate::Optic;
use metalith_wave::kernels::{cis, fade};

/// The intensity around one window, as a spectrum.
#[derive(Clone, Debug)]
pub struct PixelGrid {
    /// Bins that hold light, shape `[my, 2 mx + 1]`: ky from zero, kx from -mx to mx.
    re: Array2<f32>,
    im: Array2<f32>,
    /// Width of a bin (1/um).
    cycle: f64,
    /// Distance from the first sample to the middle of the window (um).
    middle_um: f64,
    shape: [usize; 2],
    pixel_um: f64,
    /// Offset of the window after the image (x, y) (um); of a change, the change of the offset.
    off_um: [f64; 2],
}

/// Bins below this share of the mean are left out: together they are below any noise.
const EMPTY: f32 = 1e-6;

impl PixelGrid {
    /// Share of the samples on each side over which the surroundings are faded out.
    pub const FADED: f64 = 0.06;

    /// Memory of a spectrum that has so many bins along each axis, negative frequencies among them (bytes): half of the
    /// plane, two single-precision numbers each.
    pub fn bytes_of(bins: f64) -> f64 {
        0.5 * bins * bins * (2 * size_of::<f32>()) as f64
    }

    /// Memory of this spectrum (bytes).
    pub fn bytes(&self) -> usize {
        (self.re.len() + self.im.len()) * size_of::<f32>()
    }

    /// The spectrum of `intensity` (a square of samples `step_um` apart) behind `optic`, to be read on
    /// `rows` x `cols` pixels about its middle.
    pub fn new(intensity: &[f32], step_um: f64, optic: &Optic, rows: usize, cols: usize) -> Self {
        let n = (intensity.len() as f64).sqrt().round() as usize;
        let ramp = ((Self::FADED * n as f64) as usize).max(2);
        let border: f32 = {
            let ends = (0..n).flat_map(|i| [i, (n - 1) * n + i, i * n, i * n + n - 1]);
            ends.map(|i| intensity[i]).sum::<f32>() / (4 * n) as f32
        };
        let counts: Vec<f32> = (0..n)
            .map(|i| {
                let depth = (i.min(n - 1 - i) as f64 + 0.5) / ramp as f64;
                fade(1.0 - depth as f32)
            })
            .collect();
        let fft = metalith_fourier::forward::<f32>(n);
        let mut rows_of: Vec<Complex32> = intensity
            .iter()
            .enumerate()
            .map(|(i, v)| Complex32::new(border + (v - border) * counts[i / n] * counts[i % n], 0.0))
            .collect();
        fft.process(&mut rows_of);
        let mut columns = vec![Complex32::ZERO; n * n];
        for y in 0..n {
            for x in 0..n {
                columns[x * n + y] = rows_of[y * n + x];
            }
        }
        fft.process(&mut columns);
        let half = n / 2;
        let cycle = 1.0 / (n as f64 * step_um);
        let norm = 1.0 / (n * n) as f64;
        let bin = |kx: i64, ky: usize| {
            let weight = if ky == 0 { norm } else { 2.0 * norm };
            let factor = optic.transfer(kx as f64 * cycle, ky as f64 * cycle) * weight;
            columns[kx.rem_euclid(n as i64) as usize * n + ky] * factor as f32
        };
        let reach = half as i64 - 1;
        let least = EMPTY * bin(0, 0).norm();
        let (mut mx, mut my) = (1, 1);
        let mut bins = Array2::from_elem((half, 2 * reach as usize + 1), Complex32::ZERO);
        for ((ky, i), value) in bins.indexed_iter_mut() {
            let kx = i as i64 - reach;
            *value = bin(kx, ky);
            if value.norm() > least {
                (mx, my) = (mx.max(kx.abs()), my.max(ky + 1));
            }
        }
        let kept = part(bins.view(), 0..my, (reach - mx) as usize..(reach + mx + 1) as usize);
        Self {
            re: kept.mapv(|v| v.re),
            im: kept.mapv(|v| v.im),
            cycle,
            middle_um: 0.5 * (n as f64 - 1.0) * step_um,
            shape: [rows, cols],
            pixel_um: optic.pixel_um,
            off_um: [0.0; 2],
        }
    }

    /// Offset by which the window has [moved](Self::moved) (x, y) (um); of a sum, the sum.
    pub fn off_um(&self) -> [f64; 2] {
        self.off_um
    }

    /// The sum of grids, each with its factor. They must be of the same window.
    pub fn combine(parts: &[(&Self, f32)]) -> Self {
        let my = parts.iter().map(|(g, _)| g.re.nrows()).max().unwrap_or(0);
        let mx = parts.iter().map(|(g, _)| g.re.ncols()).max().unwrap_or(0);
        let (mut re, mut im) = (Array2::zeros((my, mx)), Array2::zeros((my, mx)));
        let mut off_um = [0.0; 2];
        for (grid, factor) in parts {
            off_um = [0, 1].map(|axis| off_um[axis] + f64::from(*factor) * grid.off_um[axis]);
            let (rows, cols) = grid.re.dim();
            let from = (mx - cols) / 2;
            part(re.view_mut(), 0..rows, from..from + cols).scaled_add(*factor, &grid.re);
            part(im.view_mut(), 0..rows, from..from + cols).scaled_add(*factor, &grid.im);
        }
        Self {
            re,
            im,
            off_um,
            ..*parts.first().expect("a sum has parts").0
        }
    }

    /// Mean square over the samples (Parseval's theorem), of the unit of intensity.
    pub fn mean_square(&self) -> f64 {
        let of_row = |ky: usize| -> f64 {
            let bins = self.re.row(ky).into_iter().zip(self.im.row(ky));
            bins.map(|(re, im)| f64::from(re * re + im * im)).sum()
        };
        // Bins of ky > 0 stand for those of -ky too, with twice their amplitude.
        let rows = (0..self.re.nrows()).map(|ky| if ky == 0 { of_row(ky) } else { 0.5 * of_row(ky) });
        rows.sum()
    }

    /// This image seen from a window that is off by so much (x, y) (um).
    #[must_use]
    pub fn moved(mut self, [x, y]: [f64; 2]) -> Self {
        if x == 0.0 && y == 0.0 {
            return self;
        }
        self.off_um = [self.off_um[0] + x, self.off_um[1] + y];
        let middle = (self.re.ncols() / 2) as f64;
        for ((ky, kx), re) in self.re.indexed_iter_mut() {
            let im = &mut self.im[[ky, kx]];
            let turned = Complex32::new(*re, *im) * cis(self.cycle * ((kx as f64 - middle) * x + ky as f64 * y));
            (*re, *im) = (turned.re, turned.im);
        }
        self
    }

    /// Derivative by the shift along x (0) or y (1) (1/um).
    #[must_use]
    pub fn slope(&self, axis: usize) -> Self {
        let middle = (self.re.ncols() / 2) as f32;
        let omega = (std::f64::consts::TAU * self.cycle) as f32;
        let at = |(ky, kx): (usize, usize)| omega * if axis == 0 { kx as f32 - middle } else { ky as f32 };
        // A derivative turns each wave by a quarter.
        let (mut re, mut im) = (self.im.clone(), self.re.clone());
        re.indexed_iter_mut().for_each(|(i, v)| *v *= -at(i));
        im.indexed_iter_mut().for_each(|(i, v)| *v *= at(i));
        Self {
            re,
            im,
            off_um: [0.0; 2],
            ..*self
        }
    }

    /// Change by a blur, for a unit of its covariance between two axes (1/um^2).
    #[must_use]
    pub fn blur(&self, [a, b]: [usize; 2]) -> Self {
        let half = if a == b { 0.5 } else { 1.0 };
        Self::combine(&[(&self.slope(a).slope(b), half)])
    }

    /// The pixels of a window whose middle is off by `shift_um` (x, y).
    pub fn pixels(&self, shift_um: [f64; 2]) -> Array2<f32> {
        Reading::new([self], shift_um).pixels(self)
    }
}

/// Transform from bins to the pixels of one window at one place, computed once for all grids of the window.
pub struct Reading {
    /// Cosines, then sines of each bin at each pixel along x, `[kx, 2 cols]`.
    along_x: Array2<f32>,
    /// Cosines, then sines with their sign turned, of each bin at each pixel along y, `[row, 2 ky]`.
    along_y: Array2<f32>,
    /// Angular frequency of a bin (1/um).
    omega: f32,
}

impl Reading {
    /// Transform for a window whose middle is off by `shift_um` (x, y), as wide in frequency as the widest of `grids`.
    pub fn new<'g>(grids: impl IntoIterator<Item = &'g PixelGrid>, shift_um: [f64; 2]) -> Self {
        let mut grids = grids.into_iter().peekable();
        let first = *grids.peek().expect("there is something to read");
        let [rows, cols] = first.shape;
        let (half, n) = grids.fold((0, 0), |(a, b), g| (a.max(g.re.nrows()), b.max(g.re.ncols())));
        let place = |i: usize, count: usize, shift: f64| {
            (i as f64 - 0.5 * (count as f64 - 1.0)) * first.pixel_um + shift + first.middle_um
        };
        let mut along_x = Array2::zeros((n, 2 * cols));
        for (k, mut line) in along_x.rows_mut().into_iter().enumerate() {
            for j in 0..cols {
                let turn = cis((k as f64 - (n / 2) as f64) * place(j, cols, shift_um[0]) * first.cycle);
                (line[j], line[cols + j]) = (turn.re, turn.im);
            }
        }
        let mut along_y = Array2::zeros((rows, 2 * half));
        for (i, mut line) in along_y.rows_mut().into_iter().enumerate() {
            for k in 0..half {
                let turn = cis(k as f64 * place(i, rows, shift_um[1]) * first.cycle);
                (line[k], line[half + k]) = (turn.re, -turn.im);
            }
        }
        Self {
            along_x,
            along_y,
            omega: (std::f64::consts::TAU * first.cycle) as f32,
        }
    }

    /// The pixels.
    pub fn pixels(&self, grid: &PixelGrid) -> Array2<f32> {
        self.along_y.dot(&self.columns(grid))
    }

    /// The pixels, and their derivatives by the shift along x and along y (1/um).
    pub fn with_slopes(&self, grid: &PixelGrid) -> [Array2<f32>; 3] {
        let columns = self.columns(grid);
        // Along y a derivative turns each wave by a quarter, whatever it is along x.
        let half = columns.nrows() / 2;
        let turned = Array2::from_shape_fn(columns.dim(), |(k, j)| match k.checked_sub(half) {
            None => -self.omega * k as f32 * columns[[half + k, j]],
            Some(k) => self.omega * k as f32 * columns[[k, j]],
        });
        let along_x = self.pixels(&grid.slope(0));
        [self.along_y.dot(&columns), along_x, self.along_y.dot(&turned)]
    }

    /// Waves along y at each pixel along x: real parts, then imaginary ones, `[2 ky, col]`.
    fn columns(&self, grid: &PixelGrid) -> Array2<f32> {
        let (own, n) = grid.re.dim();
        let (half, cols) = (self.along_y.ncols() / 2, self.along_x.ncols() / 2);
        let from = (self.along_x.nrows() - n) / 2;
        let along_x = part(self.along_x.view(), from..from + n, 0..2 * cols);
        let (re, im) = (grid.re.dot(&along_x), grid.im.dot(&along_x));
        let mut columns = Array2::zeros((2 * half, cols));
        for k in 0..own {
            for j in 0..cols {
                columns[[k, j]] = re[[k, j]] - im[[k, cols + j]];
                columns[[half + k, j]] = re[[k, cols + j]] + im[[k, j]];
            }
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Single precision of sums over some hundred frequencies, and the midpoint rule over a pixel, of a peak of one.
    const PIXEL: f64 = 2e-5;
    /// Single precision of both sides.
    const SAME: f32 = 1e-5;
    /// Over steps of 1e-2 um: single precision over the step.
    const SLOPE: f32 = 1e-3;
    /// Second order in a change of the blur's variance of 8e-3 um^2.
    const BLUR: f32 = 1e-4;

    #[test]
    fn pixels_of_a_gaussian_are_those_of_its_integral() {
        let (n, step, sigma) = (96, 0.5, 1.3);
        let at = |i: usize| (i as f64 - 47.5) * step;
        let gauss = |s: f64, x: f64, y: f64| (-(x * x + y * y) / (2.0 * s * s)).exp();
        let samples: Vec<f32> = (0..n * n).map(|i| gauss(sigma, at(i % n), at(i / n)) as f32).collect();
        let optic = Optic {
            pixel_um: 0.7,
            disc_um: [[0.0; 2]; 2],
            blur_um: 0.4,
        };
        let grid = PixelGrid::new(&samples, step, &optic, 40, 32);
        let shift = [0.23, -0.61];
        let pixels = grid.pixels(shift);
        // A blurred Gaussian is one of the summed variance; over a pixel by a fine midpoint rule.
        let total: f64 = sigma * sigma + 0.16;
        for (row, col) in [(20, 16), (17, 20), (25, 11)] {
            let x = (col as f64 - 15.5) * 0.7 + shift[0];
            let y = (row as f64 - 19.5) * 0.7 + shift[1];
            let fine = (0..40 * 40).map(|k| {
                let (a, b) = (f64::from(k % 40), f64::from(k / 40));
                let off = |v: f64| ((v + 0.5) / 40.0 - 0.5) * 0.7;
                gauss(total.sqrt(), x + off(a), y + off(b)) * sigma * sigma / total / 1600.0
            });
            let want: f64 = fine.sum();
            assert!(
                (f64::from(pixels[[row, col]]) - want).abs() < PIXEL,
                "{} {want}",
                pixels[[row, col]]
            );
        }
        let h = 1e-2;
        let slope = grid.slope(0).pixels(shift);
        let numeric =
            (&grid.pixels([shift[0] + h, shift[1]]) - &grid.pixels([shift[0] - h, shift[1]])) / (2.0 * h as f32);
        assert!((&slope - &numeric).iter().all(|d| d.abs() < SLOPE));
        // As the derivative of each grid has it, in a reading that is wider than the grid.
        let wide = PixelGrid::new(&samples, step, &Optic { blur_um: 0.0, ..optic }, 40, 32);
        let together = Reading::new([&grid, &wide], shift).with_slopes(&grid);
        for (one, other) in together
            .iter()
            .zip([pixels.clone(), slope, grid.slope(1).pixels(shift)])
        {
            assert!((one - &other).iter().all(|d| d.abs() < SAME));
        }
        // Of the samples at even places the square is a sum over all: the Gaussian falls to nothing at the border.
        let clear = Optic {
            blur_um: 0.0,
            pixel_um: 0.0,
            ..optic
        };
        let mean_square = samples.iter().map(|v| f64::from(v * v)).sum::<f64>() / (n * n) as f64;
        let of_bins = PixelGrid::new(&samples, step, &clear, 40, 32).mean_square();
        assert!((of_bins / mean_square - 1.0).abs() < PIXEL, "{of_bins} {mean_square}");
        let moved = grid.clone().moved([0.4, -0.2]).pixels([shift[0] - 0.4, shift[1] + 0.2]);
        assert!((&moved - &pixels).iter().all(|d| d.abs() < SAME));
        // A little more blur, as its term has it.
        let blurred = PixelGrid::new(&samples, step, &Optic { blur_um: 0.41, ..optic }, 40, 32);
        let variance = 0.41f32.powi(2) - 0.4f32.powi(2);
        let both = PixelGrid::combine(&[
            (&grid, 1.0),
            (&grid.blur([0, 0]), variance),
            (&grid.blur([1, 1]), variance),
        ]);
        assert!(
            (&blurred.pixels(shift) - &both.pixels(shift))
                .iter()
                .all(|d| d.abs() < BLUR)
        );
    }
}
