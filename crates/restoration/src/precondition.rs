//! Preconditioner of the linear systems of restoration: an approximate inverse.
//!
//! It knows how much light each place of the scene sends into the frame, how scenes vary, and a little of what the frame
//! says of each frequency: the first steps are smooth pictures, and fine detail follows. Without the statistics of scenes,
//! the patterns in which back-projected pixels overlap stay in the picture.
//!
//! The whole inverse of the mean response looks like the better choice and is not, neither for all of the field nor zone by
//! zone: its first steps are spent on fine detail that the frame says next to nothing of (7.5 dB instead of 18 for a
//! photograph after 12 steps). What a frame says of a frequency differs a thousandfold between middle and corners, and the
//! borders of the elements' fields belong to no frequency. A thousandth of the mean response only keeps what is smooth
//! from being overdone, and that is what the solution waits for.

use metalith_wave::kernels::{FftScratch, SquareFft, fft_size};
use ndarray::Array2;
use num_complex::Complex32;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::frame_model::Planes;
use crate::scene_statistics::{Terms, squared_frequencies};
use crate::slope_split::{SlopeBorder, slopes};

/// Pixels between a picture and its periodic copies: beyond them little of it is correlated.
const BORDER: usize = 40;

/// Share that is added to the prior for all frequencies, relative to the prior of the highest. With less the first
/// steps are spent on what is smooth: of 1e-4, 1e-3 and 1e-2 the last has the most of a photograph after 16 steps
/// (17.7, 18.1 and 18.3 dB).
const FLAT: f64 = 1e-2;

/// Share of the mean response that is added for steps from black. Of 1e-4, 3e-4 and 1e-3 a camera with all of its physics has the most of a
/// photograph of 800 x 800 with the last (22.1, 22.4 and 22.9 dB of linear light after 48 steps), and one of one kernel
/// for each element and colour with the first (28.5 and 27.4 dB with 1e-4 and 1e-3).
pub(crate) const RESPONSE: f64 = 5e-4;
/// Power of the light of a place by which the inverse is weighed on both sides. Half of one is that of the data alone: of 0.5,
/// 0.65 and 0.8 a photograph has 21.5, 21.7 and 21.7 dB of linear light after 32 steps; the camera of one kernel has 2 dB
/// less with 0.8 than with 0.65.
const LIGHT_POWER: f32 = 0.65;
/// Frequency up to which the response is one value (cycles a pixel), bins an octave beyond it, and their number.
const LOWEST: f64 = 1.0 / 64.0;
const BINS_AN_OCTAVE: f64 = 2.0;
const BINS: usize = 12;
/// Seed of the random picture that finds the response.
const SEED: u64 = 1;

/// Approximate inverse for a frame.
pub(crate) struct Preconditioner {
    fft: SquareFft,
    /// The light of each place to the power of -[`LIGHT_POWER`].
    unit: Array2<f32>,
    /// Response of the frame to each frequency, between two of these: by plane and [`place`].
    response: Vec<Vec<f64>>,
}

/// Place of a squared frequency among the bins.
fn place(squared: f64) -> f64 {
    let frequency = squared.sqrt() / std::f64::consts::TAU;
    (BINS_AN_OCTAVE * (frequency / LOWEST).max(1.0).log2()).min((BINS - 1) as f64)
}

impl Preconditioner {
    /// Preconditioner for the light of each place, one where most is and nowhere zero, and for what a frame of so many
    /// planes comes back as.
    pub(crate) fn new(light: &Array2<f32>, planes: usize, there_and_back: impl Fn(&[Array2<f32>]) -> Planes) -> Self {
        let (rows, columns) = light.dim();
        let mut own = Self {
            fft: SquareFft::new(fft_size(rows.max(columns) + BORDER)),
            unit: light.mapv(|v| v.powf(-LIGHT_POWER)),
            response: Vec::new(),
        };
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        // Slopes of a random picture: little that is smooth, which would drown what is fine.
        let mut probe = || {
            let white = Array2::from_shape_fn(light.dim(), |_| StandardNormal.sample(&mut random));
            let [down, right] = slopes(&white, SlopeBorder::Even);
            down + right
        };
        let probe: Planes = (0..planes).map(|_| probe()).collect();
        let there: Planes = probe.iter().map(|p| p * &own.unit).collect();
        let back = there_and_back(&there);
        let size = own.fft.size();
        let squared = squared_frequencies(size);
        for (probe, back) in probe.iter().zip(&back) {
            let (from, to) = (own.spectrum(probe), own.spectrum(&(back * &own.unit)));
            let mut sums = [(0.0, 0.0); BINS];
            for (i, (a, b)) in from.iter().zip(&to).enumerate() {
                let bin = &mut sums[place(squared[i / size] + squared[i % size]).round() as usize];
                bin.0 += f64::from((a.conj() * b).re);
                bin.1 += f64::from(a.norm_sqr());
            }
            let mut found: Vec<f64> = sums.iter().map(|(a, b)| a / b.max(f64::MIN_POSITIVE)).collect();
            // It falls with the frequency; what else there is comes from the few waves of a bin.
            for bin in (0..BINS).rev() {
                found[bin] = found[bin].max(found.get(bin + 1).copied().unwrap_or(0.0));
            }
            own.response.push(found);
        }
        own
    }

    fn spectrum(&self, plane: &Array2<f32>) -> Vec<Complex32> {
        self.fft.of_plane(plane, &mut FftScratch::default())
    }

    /// One over the prior and a share `added` of the response, for each frequency of a plane's spectrum.
    pub(crate) fn filter(&self, plane: usize, terms: Terms, added: f64) -> Vec<f32> {
        let response = &self.response[plane];
        let size = self.fft.size();
        let squared = squared_frequencies(size);
        let most = 8.0 * terms.slopes + 64.0 * terms.bends + terms.identity;
        let of = |i: usize| {
            let s = squared[i / size] + squared[i % size];
            let at = place(s);
            let (low, share) = (at as usize, at.fract());
            let mean = (1.0 - share) * response[low] + share * response[(low + 1).min(BINS - 1)];
            match most {
                // Nothing is known of the picture.
                0.0 => 1.0,
                _ => 1.0 / (terms.slopes * s + terms.bends * s * s + terms.identity + FLAT * most + added * mean),
            }
        };
        (0..self.fft.entries()).map(|i| of(i) as f32).collect()
    }

    /// The inverse of the prior between two powers of the light of each place. The two are in one unit where a place
    /// counts most; each plane has its own filter.
    pub(crate) fn apply(&self, right: &[Array2<f32>], filters: &[Vec<f32>]) -> Planes {
        right
            .par_iter()
            .zip(filters)
            .map(|(r, filter)| self.apply_to(r, filter))
            .collect()
    }

    fn apply_to(&self, right: &Array2<f32>, filter: &[f32]) -> Array2<f32> {
        let mut spectrum = self.spectrum(&(right * &self.unit));
        spectrum.iter_mut().zip(filter).for_each(|(v, f)| *v *= f);
        let plane = self
            .fft
            .to_plane(&mut spectrum, right.dim(), &mut FftScratch::default());
        plane * &self.unit
    }
}
