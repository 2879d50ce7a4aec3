//! Images of a point in a channel, from those of single wavelengths.
//!
//! The PSF of a wavelength about its chief ray, summed over squares of a quarter of a pixel, is transformed. Between two
//! wavelengths it is the mean of both with weights that change linearly, and moves with its chief ray, as in
//! [`metalith_wave::psf::polychromatic`]; in light of narrow bands it follows a cubic through four
//! ([`metalith_sensor::Blend`]). Here the band is a sum over points 1 nm apart, which a pixel cannot tell from a line.

use metalith_sensor::ChannelPart;
use num_complex::{Complex32, Complex64};

use super::part_sum::{SplitSpectrum, add_part};
use crate::spectra::SceneSpectrum;
use metalith_wave::kernels::{FftScratch, SquareFft};

/// Squares an axis of a pixel.
pub(crate) const QUARTERS: usize = 4;

/// Plan that kernels are made with: transforms of one window size.
pub(crate) struct SpectrumPlan {
    /// Pixels an axis of a kernel, even.
    pub window: usize,
    fft: SquareFft,
}

/// Columns of frequencies that all parts are added to before the next ones: they and their spectra stay in the cache.
const COLUMNS: usize = 4;

/// A part of a channel, as it acts in one direction.
#[derive(Clone, Debug)]
pub(crate) struct MovedPart {
    /// Share of the channel's light.
    pub weight: f64,
    /// Wavelength (nm).
    pub nm: f64,
    /// Wavelengths whose PSFs it is a sum of, with their weights: [`metalith_sensor::Sampling::blended`].
    pub blended: Vec<(usize, f64)>,
    /// Offset from the chief ray of the channel to the chief ray of the part (pixels).
    pub offset: [f64; 2],
}

impl MovedPart {
    /// Part whose chief ray lands there, made of these wavelengths.
    pub(crate) fn new(part: &ChannelPart, total: f64, blended: Vec<(usize, f64)>, offset: [f64; 2]) -> Self {
        Self {
            weight: part.weight / total,
            nm: 0.5 * (part.nm[0] + part.nm[1]),
            blended,
            offset,
        }
    }

    /// True if its PSF is in a kernel of so many pixels: parts that land farther off belong to the stray light.
    pub(crate) fn inside(&self, window: usize) -> bool {
        self.offset.iter().all(|o| o.abs() <= 0.5 * window as f64)
    }
}

impl SpectrumPlan {
    /// Plan for kernels of `window` pixels an axis, an even number.
    pub(crate) fn new(window: usize) -> Self {
        // Half a window more than the kernel: what parts that have moved put beyond it comes back outside of it.
        Self {
            window,
            fft: SquareFft::new(window * QUARTERS * 3 / 2),
        }
    }

    /// Spectrum of the energies in quarters of the pixels of a window, row by row, its chief ray in the middle.
    pub(crate) fn spectrum(&self, quarters: &[f32], scratch: &mut FftScratch) -> SplitSpectrum {
        let (inner, size) = (self.window * QUARTERS, self.fft.size());
        let from = (size - inner) / 2;
        let mut square = vec![0.0; size * size];
        for (iy, row) in quarters.chunks_exact(inner).enumerate() {
            square[(iy + from) * size + from..][..inner].copy_from_slice(row);
        }
        let mut spectrum = vec![Complex32::ZERO; self.fft.entries()];
        self.fft.forward(&mut square, size, &mut spectrum, scratch);
        SplitSpectrum::of(&spectrum, size)
    }

    /// Kernels of a channel for each spectrum of the scene: energy in a pixel whose middle is at
    /// `(i - window + 1/2) / 2` pixels from the chief ray, i from 0 to 2 window - 1 along x and along y, as it counts in a
    /// sum over points half a pixel apart; see [`PlacedPixel`].
    pub(crate) fn kernels(
        &self,
        spectra: &[SplitSpectrum],
        parts: &[MovedPart],
        basis: &[SceneSpectrum],
        scratch: &mut FftScratch,
    ) -> Vec<Vec<f32>> {
        let size = self.fft.size();
        let columns = size / 2 + 1;
        let weakest = WEAKEST * parts.iter().map(|p| p.weight).fold(0.0, f64::max);
        let strong = parts.iter().filter(|p| p.weight > weakest && p.inside(self.window));
        let moved: Vec<MovedSum> = strong.map(|part| MovedSum::new(part, basis, size)).collect();
        let mut sums = vec![SplitSpectrum::zero(columns, size); basis.len()];
        for first in (0..columns).step_by(COLUMNS) {
            let at = first..(first + COLUMNS).min(columns);
            for part in &moved {
                let terms: Vec<_> = part.blended.iter().map(|(i, weight)| (&spectra[*i], *weight)).collect();
                add_part(
                    &terms,
                    at.clone(),
                    (&part.along_x, &part.along_y),
                    &part.weights,
                    &mut sums,
                );
            }
        }
        let mut square = vec![0.0; size * size];
        let finished = sums.into_iter().map(|sum| {
            self.fft.inverse(&mut sum.joined(), &mut square, size, scratch);
            self.pixels(&square)
        });
        finished.collect()
    }

    /// Sums over pixels of what lies in quarters.
    fn pixels(&self, square: &[f32]) -> Vec<f32> {
        let (window, size) = (self.window, self.fft.size());
        let side = 2 * window;
        let PlacedPixel { taps, first } = PlacedPixel::new();
        // Pixel i begins two quarters before its middle.
        let first = |i: usize| window + 2 * i - 1 - first;
        let mut lines = vec![0.0f32; size * side];
        for (row, line) in square.chunks_exact(size).zip(lines.chunks_exact_mut(side)) {
            for (i, v) in line.iter_mut().enumerate() {
                *v = row[first(i)..].iter().zip(&taps).map(|(r, t)| r * t).sum();
            }
        }
        let mut kernel = vec![0.0f32; side * side];
        for (i, out) in kernel.chunks_exact_mut(side).enumerate() {
            for (k, tap) in taps.iter().enumerate() {
                let line = &lines[(first(i) + k) * side..][..side];
                out.iter_mut().zip(line).for_each(|(o, v)| *o += tap * v);
            }
        }
        kernel
    }
}

/// Weights of quarters of pixels, along one axis, of a pixel that looks at points half a pixel apart.
///
/// A frame is an integral over the scene. A sum over points takes detail that is finer than they can tell for coarse
/// detail, unless what is summed is smooth: so each point stands for the light of half a pixel about it. What that blurs
/// is undone by the differences of neighbouring points: of a wave of frequency f, cos^2 is left, cos^2 (1 + u / 4 + u^2 / 8)
/// = 1 - 5 sin^6 + ... with sin, cos of pi f / 4 and u = sin^2(pi f / 2).
struct PlacedPixel {
    taps: Vec<f32>,
    /// Quarters before the first one of the pixel itself.
    first: usize,
}

impl PlacedPixel {
    fn new() -> Self {
        let pixel = vec![1.0; QUARTERS];
        let spread = [0.25, 0.5, 0.25];
        // 1 + u / 4 + u^2 / 8, with u = -(second difference) / 4, two quarters from point to point.
        let fourth = 1.0 / 128.0;
        let second = -1.0 / 16.0 - 4.0 * fourth;
        let sharpen = [
            fourth,
            0.0,
            second,
            0.0,
            1.0 - 2.0 * (second + fourth),
            0.0,
            second,
            0.0,
            fourth,
        ];
        let taps = convolved(&convolved(&pixel, &spread), &sharpen);
        let first = (taps.len() - QUARTERS) / 2;
        Self { taps, first }
    }
}

fn convolved(a: &[f32], b: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (k, y) in b.iter().enumerate() {
            out[i + k] += x * y;
        }
    }
    out
}

/// A part of a channel as it is added to the spectra of the kernels.
struct MovedSum {
    /// Wavelengths with their weights.
    blended: Vec<(usize, f32)>,
    /// Turns of the phase of frequencies along x and along y, by which its chief ray moves.
    along_x: Vec<Complex32>,
    along_y: SplitSpectrum,
    /// Weight in the kernel of each spectrum of the scene.
    weights: Vec<f32>,
}

impl MovedSum {
    fn new(part: &MovedPart, basis: &[SceneSpectrum], size: usize) -> Self {
        let along = |axis: usize| turns(size, part.offset[axis] * QUARTERS as f64);
        Self {
            blended: part.blended.iter().map(|(i, weight)| (*i, *weight as f32)).collect(),
            along_x: along(0),
            along_y: SplitSpectrum::of(&along(1), size),
            weights: basis.iter().map(|b| (part.weight * b.at(part.nm)) as f32).collect(),
        }
    }
}

/// Turns of the phase of the frequencies of `size` samples, those of negative frequencies behind the others, by which what they add
/// up to moves by some samples.
fn turns(size: usize, samples: f64) -> Vec<Complex32> {
    let step = Complex64::cis(-std::f64::consts::TAU * samples / size as f64);
    let mut turns = vec![Complex32::ONE; size];
    let mut turn = Complex64::ONE;
    for k in 1..=size / 2 {
        turn *= step;
        let single = Complex32::new(turn.re as f32, turn.im as f32);
        turns[size - k] = single.conj();
        turns[k] = single;
    }
    turns
}

/// Parts with a smaller share of the strongest are left out.
const WEAKEST: f64 = 1e-5;

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian that the light of two wavelengths moves: closed form on pixels by a fine sum.
    #[test]
    fn kernels_are_pixels_of_the_moved_psf() {
        /// Tolerance as a share of the peak: single precision, and a Gaussian of 3 quarters that is summed over them.
        const SHARE: f32 = 2e-3;
        let window = 16;
        let plan = SpectrumPlan::new(window);
        let mut scratch = FftScratch::default();
        let sigma = 0.8;
        let n = window * QUARTERS;
        let gauss = |x: f64, y: f64| (-(x * x + y * y) / (2.0 * sigma * sigma)).exp();
        // Energy of each quarter of a pixel, by points within it.
        let quarter = |ix: usize, iy: usize| {
            let at = |i: usize, k: usize| (i as f64 - 0.5 * n as f64 + (k as f64 + 0.5) / 4.0) / QUARTERS as f64;
            (0..16).map(|k| gauss(at(ix, k % 4), at(iy, k / 4))).sum::<f64>() / 256.0
        };
        let quarters: Vec<f32> = (0..n * n).map(|i| quarter(i % n, i / n) as f32).collect();
        let spectra = [
            plan.spectrum(&quarters, &mut scratch),
            plan.spectrum(&quarters, &mut scratch),
        ];
        let flat = SceneSpectrum {
            nm: vec![400.0, 700.0],
            values: vec![1.0, 1.0],
        };
        let part = |weight: f64, offset: [f64; 2]| MovedPart {
            weight,
            nm: 500.0,
            blended: vec![(0, 0.7), (1, 0.3)],
            offset,
        };
        let parts = [part(0.75, [1.3, -0.4]), part(0.25, [-2.1, 0.9]), part(9.0, [20.0, 0.0])];
        let kernel = plan
            .kernels(&spectra, &parts, std::slice::from_ref(&flat), &mut scratch)
            .remove(0);
        let side = 2 * window;
        let mut worst = 0.0f32;
        for (i, got) in kernel.iter().enumerate() {
            let middle = |i: usize| (i as f64 - window as f64 + 0.5) / 2.0;
            let (x, y) = (middle(i % side), middle(i / side));
            let want: f64 = parts[..2]
                .iter()
                .map(|p| {
                    let points = (0..400).map(|k| {
                        let (a, b) = (f64::from(k % 20), f64::from(k / 20));
                        gauss(
                            x + (a + 0.5) / 20.0 - 0.5 - p.offset[0],
                            y + (b + 0.5) / 20.0 - 0.5 - p.offset[1],
                        )
                    });
                    p.weight * points.sum::<f64>() / 400.0
                })
                .sum();
            worst = worst.max((got - want as f32).abs());
        }
        assert!(worst < SHARE, "{worst}");
    }
}
