//! What is known of a picture before it is taken: how scenes vary from place to place and from colour to colour.

use metalith_wave::kernels::fft_size;
use nalgebra::DMatrix;
use ndarray::Array2;
use num_complex::Complex32;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::normal::{Planes, Terms};
use crate::SceneView;
use crate::operator::{FftScratch, SquareFft};

/// Statistics of natural scenes in linear light.
///
/// Colours are sums of three planes that vary independently: grey, red against blue, and green against both (Ruderman,
/// Cronin and Chiao, J. Opt. Soc. Am. A 15, 2036 (1998)). The spectrum of each falls as 1 / f^2 (Field, J. Opt. Soc. Am.
/// A 4, 2379 (1987)), and faster where a photograph's own camera blurs: power / (s + s^2), with s the squared frequency
/// that differences of neighbouring pixels count, from 0 to 8. The numbers are those of 25 photographs of 576 x 576 pixels
/// (GB82 image dataset, CC0), fitted by eye to a fifth of the power between 0.03 and 0.4 cycles a pixel.
#[derive(Clone, Debug)]
pub struct SceneStatistics {
    /// Planes of the picture (rows) from independent planes of one spectrum (columns).
    mix: Vec<Vec<f32>>,
    /// Of this spectrum.
    power: f64,
}

/// Mean of the light.
const MEAN: f32 = 0.2;
/// Of the plane (red + green + blue) / sqrt(3).
const POWER: f64 = 0.07;
/// Deviations of the other two planes over that of the first.
const OPPONENTS: [f32; 2] = [0.29, 0.15];

impl SceneStatistics {
    /// Of pictures of red, green and blue planes.
    pub fn colours() -> Self {
        let (grey, blue, green) = (3f32.sqrt().recip(), 2f32.sqrt().recip(), 6f32.sqrt().recip());
        let [b, g] = OPPONENTS;
        Self {
            mix: vec![
                vec![grey, b * blue, g * green],
                vec![grey, 0.0, -2.0 * g * green],
                vec![grey, -b * blue, g * green],
            ],
            power: POWER,
        }
    }

    /// Of pictures of grey planes, of which nothing is known together.
    pub fn grey(planes: usize) -> Self {
        let unit = |i: usize| (0..planes).map(|k| f32::from(u8::from(i == k))).collect();
        Self {
            mix: (0..planes).map(unit).collect(),
            power: POWER / 3.0,
        }
    }

    /// Planes of the picture (rows) from independent planes (columns).
    pub fn mixing(&self) -> DMatrix<f64> {
        let n = self.mix.len();
        DMatrix::from_fn(n, n, |i, k| f64::from(self.mix[i][k]))
    }

    /// Planes of the picture from independent planes.
    pub fn picture(&self, independent: &[Array2<f32>]) -> Planes {
        let row = |weights: &Vec<f32>| weighted(weights.iter().copied(), independent);
        self.mix.iter().map(row).collect()
    }

    /// The adjoint of [`SceneStatistics::picture`].
    pub fn adjoint(&self, picture: &[Array2<f32>]) -> Planes {
        let column = |k: usize| weighted(self.mix.iter().map(|row| row[k]), picture);
        (0..self.mix.len()).map(column).collect()
    }

    /// Sums of the squares of what each independent plane is to the planes of a picture: columns of the mixing, which are at
    /// right angles.
    pub fn sizes(&self) -> Vec<f64> {
        let column = |k: usize| self.mix.iter().map(|row| f64::from(row[k]).powi(2)).sum();
        (0..self.mix.len()).map(column).collect()
    }

    /// Independent planes of a picture: the inverse of [`SceneStatistics::picture`].
    pub fn independent(&self, picture: &[Array2<f32>]) -> Planes {
        let mut planes = self.adjoint(picture);
        for (plane, size) in planes.iter_mut().zip(self.sizes()) {
            *plane /= size as f32;
        }
        planes
    }

    /// The prior of independent planes, in units of `scale`: one over their spectrum.
    pub fn terms(&self, scale: f64) -> Terms {
        let strength = 1.0 / (self.power * scale);
        Terms {
            slopes: strength,
            bends: strength,
            identity: 0.0,
        }
    }

    /// A scene of normal light with these statistics, and none of a photograph's edges: planes of the picture.
    pub fn random_scene(&self, view: &SceneView, seed: u64) -> Planes {
        let size = fft_size(view.rows.max(view.columns));
        let fft = SquareFft::new(size);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut scratch = FftScratch::default();
        let squared = squared_frequencies(size);
        let mut plane = || {
            let mut square: Vec<f32> = StandardNormal.sample_iter(&mut random).take(size * size).collect();
            let mut spectrum = vec![Complex32::ZERO; fft.entries()];
            fft.forward(&mut square, size, &mut spectrum, &mut scratch);
            for (i, v) in spectrum.iter_mut().enumerate() {
                let s = squared[i / size] + squared[i % size];
                // The mean is stated by itself.
                *v *= if i == 0 {
                    0.0
                } else {
                    (self.power / (s + s * s)).sqrt() as f32
                };
            }
            fft.inverse(&mut spectrum, &mut square, view.rows, &mut scratch);
            Array2::from_shape_fn((view.rows, view.columns), |(y, x)| square[y * size + x])
        };
        let independent: Planes = (0..self.mix.len()).map(|_| plane()).collect();
        let mut picture = self.picture(&independent);
        picture.iter_mut().for_each(|p| *p += MEAN);
        picture
    }
}

fn weighted(weights: impl Iterator<Item = f32>, planes: &[Array2<f32>]) -> Array2<f32> {
    let mut sum = Array2::zeros(planes[0].dim());
    for (weight, plane) in weights.zip(planes).filter(|(w, _)| *w != 0.0) {
        sum.scaled_add(weight, plane);
    }
    sum
}

/// What differences of neighbours count of each frequency of a periodic line, squared.
pub fn squared_frequencies(size: usize) -> Vec<f64> {
    let of = |k: usize| 2.0 - 2.0 * (std::f64::consts::TAU * k as f64 / size as f64).cos();
    (0..size).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::restore::normal::slopes;

    #[test]
    fn colours_mix_and_have_their_adjoint() {
        let statistics = SceneStatistics::colours();
        let plane = |k: usize| Array2::from_shape_fn((5, 7), |(y, x)| ((y * 3 + x * 5 + k) % 7) as f32);
        let (a, b): (Planes, Planes) = ((0..3).map(plane).collect(), (3..6).map(plane).collect());
        let dot = |a: &Planes, b: &Planes| -> f32 { a.iter().zip(b).map(|(a, b)| (a * b).sum()).sum() };
        let (forward, back) = (dot(&statistics.picture(&a), &b), dot(&a, &statistics.adjoint(&b)));
        // Single precision.
        assert!((forward / back - 1.0).abs() < 1e-5, "{forward} {back}");
    }

    #[test]
    fn random_scenes_have_the_slopes_that_are_expected() {
        /// Of a sum over many modes of which some ten are strong.
        const DRAW: f64 = 0.03;
        let view = SceneView {
            rows: 240,
            columns: 240,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        };
        let statistics = SceneStatistics::grey(1);
        let scene = statistics.random_scene(&view, 5).remove(0);
        let found: f64 = slopes(&scene)
            .iter()
            .flatten()
            .map(|v| f64::from(*v).powi(2))
            .sum::<f64>()
            / (240.0 * 240.0);
        // The mean over the frequencies of s power / (s + s^2).
        let s = squared_frequencies(240);
        let sum: f64 = s.iter().flat_map(|a| s.iter().map(move |b| 1.0 / (1.0 + a + b))).sum();
        let want = POWER / 3.0 * sum / (240.0 * 240.0);
        assert!((found / want - 1.0).abs() < DRAW, "{found} {want}");
    }
}
