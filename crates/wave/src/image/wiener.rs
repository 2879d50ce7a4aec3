//! Images restored from their blur.

use ndarray::Array2;
use num_complex::Complex64;

use super::Patches;
use super::fourier::Fourier;
use super::sensor::Noise;

/// What a restoration expects of scene and noise: their powers at a frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expectation {
    /// Variance of the scene over its pixels.
    pub scene_variance: f64,
    /// Variance of the noise of a pixel.
    pub noise_variance: f64,
}

/// Frequency below which the power of natural scenes no longer rises [cycles a pixel]: a scene has an end.
const FLAT_BELOW: f64 = 2e-3;

impl Expectation {
    /// From an image itself: its variance stands for the scene's, its mean sets the noise.
    pub fn of(image: &Array2<f64>, noise: &Noise) -> Self {
        let n = image.len() as f64;
        let mean = image.sum() / n;
        Self {
            scene_variance: image.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n,
            noise_variance: noise.variance(mean),
        }
    }

    /// Noise over signal at a frequency [cycles a pixel]. Natural scenes have a power that falls with its square
    /// (Field, J. Opt. Soc. Am. A 4, 2379 (1987)); the scale makes its mean over all frequencies the variance.
    pub fn noise_to_signal(&self, fx: f64, fy: f64) -> f64 {
        // Integral of 1 / (f^2 + f0^2) over the square of frequencies, taken as a circle of the same area.
        let circle = std::f64::consts::PI * (1.0 + 1.0 / (std::f64::consts::PI * FLAT_BELOW * FLAT_BELOW)).ln();
        let signal = self.scene_variance / circle / (fx * fx + fy * fy + FLAT_BELOW * FLAT_BELOW);
        self.noise_variance / signal.max(f64::MIN_POSITIVE)
    }
}

/// Wiener's filter for each patch, conj(H) / (|H|^2 + noise / signal), blended where patches meet.
///
/// The linear restoration of least expected square error; what the kernel has not passed it leaves alone.
pub fn restore(image: &Array2<f64>, patches: &Patches, expectation: &Expectation) -> Array2<f64> {
    let shape = <[usize; 2]>::from(image.dim());
    // An inverse reaches further than its kernel.
    let fourier = Fourier::new(shape, 2 * patches.reach());
    let spectrum = fourier.of_image(image);
    let mut restored = Array2::zeros(shape);
    for (kernel, weight) in patches.weighted(shape) {
        let mut filtered = fourier.of_kernel(kernel);
        for ((y, x), h) in filtered.indexed_iter_mut() {
            let ratio = expectation.noise_to_signal(fourier.frequency(1, x), fourier.frequency(0, y));
            let passes = h.norm_sqr() + ratio;
            let gain: Complex64 = h.conj() / passes;
            *h = gain * spectrum[[y, x]];
        }
        restored += &(fourier.to_image(filtered) * &weight);
    }
    restored
}

#[cfg(test)]
mod tests {
    use metalith_core::part;

    use super::super::{psnr_db, sensor::blur};
    use super::*;

    /// Rectangles over one another: edges at all scales, as in natural scenes.
    fn scene() -> Array2<f64> {
        let mut state = 12_345_u64;
        let mut next = |n: u64| {
            state = (state * 1_103_515_245 + 12_345) % (1 << 31);
            ((state >> 8) % n) as usize
        };
        let mut scene = Array2::from_elem((64, 80), 0.5);
        for _ in 0..200 {
            let [y, x, h, w] = [next(64), next(80), 2 + next(16), 2 + next(16)];
            let (rows, columns) = (
                y.saturating_sub(h)..(y + h).min(64),
                x.saturating_sub(w)..(x + w).min(80),
            );
            part(scene.view_mut(), rows, columns).fill(0.05 + 0.0009 * next(1000) as f64);
        }
        scene
    }

    fn kernel(sigma: f64) -> Array2<f64> {
        Array2::from_shape_fn((13, 13), |(y, x)| {
            let r2 = (y as f64 - 6.0).powi(2) + (x as f64 - 6.0).powi(2);
            (-r2 / (2.0 * sigma * sigma)).exp()
        })
    }

    #[test]
    fn restored_is_better_than_blurred() {
        let scene = scene();
        let noise = Noise::default();
        let changing = vec![kernel(0.9), kernel(1.0), kernel(1.1), kernel(1.0)];
        for (patches, gain_db) in [
            (Patches::uniform(kernel(1.0)).unwrap(), 4.0),
            (Patches::new(changing, [2, 2]).unwrap(), 2.0),
        ] {
            let image = noise.expose(&blur(&scene, &patches), 3);
            let restored = restore(&image, &patches, &Expectation::of(&image, &noise));
            let (before, after) = (psnr_db(&image, &scene), psnr_db(&restored, &scene));
            assert!(after > before + gain_db, "{before} dB before, {after} dB after");
        }
    }

    #[test]
    fn a_point_kernel_and_no_noise_change_nothing() {
        let scene = scene();
        let mut point = Array2::zeros((3, 3));
        point[[1, 1]] = 2.0;
        let patches = Patches::uniform(point).unwrap();
        let expectation = Expectation {
            scene_variance: 0.05,
            noise_variance: 0.0,
        };
        let restored = restore(&blur(&scene, &patches), &patches, &expectation);
        assert!((&restored - &scene).iter().all(|d| d.abs() < 1e-12));
    }

    #[test]
    fn expected_powers_add_up_to_the_variance() {
        // A sum over a grid of frequencies against the closed form of a circle of the same area.
        const SQUARE_FOR_CIRCLE: f64 = 0.03;
        let expectation = Expectation {
            scene_variance: 0.04,
            noise_variance: 1.0,
        };
        let n = 2000;
        let f = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
        let sum: f64 = (0..n * n)
            .map(|i| 1.0 / expectation.noise_to_signal(f(i % n), f(i / n)))
            .sum();
        assert!((sum / f64::from(n * n) / 0.04 - 1.0).abs() < SQUARE_FOR_CIRCLE);
    }
}
