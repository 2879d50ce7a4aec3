//! Images restored from their blur.

use ndarray::Array2;
use num_complex::Complex64;

use super::Scene;
use crate::camera::{Blur, Noise};
use crate::kernels::Fourier;

/// The linear filter of least expected square error at one frequency,
/// W = conj(mean H) S / (mean |H|^2 S + N): Wiener's for a blur H that is known, the best one for all where one of
/// several acts, each as likely as the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiener {
    signal: f64,
    total: f64,
}

impl Wiener {
    /// From the mean |H|^2 of the blurs and the powers S of the scene and N of the noise.
    pub fn new(blur_power: f64, signal: f64, noise: f64) -> Self {
        Self {
            signal,
            total: (blur_power * signal + noise).max(f64::MIN_POSITIVE),
        }
    }

    /// W, from the mean of the blurs.
    pub fn filter(&self, blur: Complex64) -> Complex64 {
        blur.conj() * self.signal / self.total
    }

    /// Share of the scene's power that is restored; the expected square error is S (1 - share).
    pub fn restored(&self, blur: Complex64) -> f64 {
        blur.norm_sqr() * self.signal / self.total
    }

    /// Expected power of what is seen, mean |H|^2 S + N.
    pub fn seen(&self) -> f64 {
        self.total
    }
}

/// What a restoration expects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Restoration {
    /// The scene.
    pub scene: Scene,
    /// The noise of the sensor; it is that of the scene's mean everywhere.
    pub noise: Noise,
    /// Longest structure of a scene: below one period in so many pixels its power no longer rises.
    pub longest_pixels: f64,
}

impl Restoration {
    /// Wiener's filter for each patch of a blur, blended where patches meet. Beyond its border the image goes on as
    /// its own mirror image.
    pub fn restore(&self, image: &Array2<f64>, blur: &Blur) -> Array2<f64> {
        let shape = <[usize; 2]>::from(image.dim());
        // An inverse reaches further than its kernel.
        let fourier = Fourier::new(shape, 2 * blur.reach());
        let spectrum = fourier.of_image(image);
        let signal = self.signal(&fourier);
        let [rows, columns] = fourier.size();
        let noise = self.noise.variance(self.scene.mean) / (rows * columns) as f64;
        let mut restored = Array2::zeros(shape);
        for (kernel, weight) in blur.weighted(shape) {
            let mut filtered = fourier.of_kernel(kernel);
            for ((at, h), s) in filtered.indexed_iter_mut().zip(&signal) {
                *h = Wiener::new(h.norm_sqr(), *s, noise).filter(*h) * spectrum[at];
            }
            restored += &(fourier.to_image(filtered) * &weight);
        }
        restored
    }

    /// Power of the scene at each frequency: their sum but for zero frequency is the square of its contrast, and that
    /// at zero frequency the square of its mean.
    fn signal(&self, fourier: &Fourier) -> Array2<f64> {
        let f = |axis: usize, i: usize| fourier.frequency(axis, i) * self.longest_pixels;
        let mut power = Array2::from_shape_fn(fourier.size(), |(y, x)| Scene::power(f(0, y).powi(2) + f(1, x).powi(2)));
        power[[0, 0]] = 0.0;
        power *= self.scene.contrast.powi(2) / power.sum();
        power[[0, 0]] = self.scene.mean.powi(2);
        power
    }
}

#[cfg(test)]
mod tests {
    use metalith_core::part;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::super::psnr_db;
    use super::*;

    /// Of transforms of a few thousand values of size one.
    const ROUNDING: f64 = 1e-12;

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

    /// A Gaussian that passes nine tenths of the light.
    fn kernel(sigma: f64) -> Array2<f64> {
        let kernel = Array2::from_shape_fn((13, 13), |(y, x)| {
            let r2 = (y as f64 - 6.0).powi(2) + (x as f64 - 6.0).powi(2);
            (-r2 / (2.0 * sigma * sigma)).exp()
        });
        0.9 / kernel.sum() * kernel
    }

    fn restoration(noise: Noise) -> Restoration {
        Restoration {
            scene: Scene::default(),
            noise,
            longest_pixels: 80.0,
        }
    }

    #[test]
    fn restored_is_better_than_blurred() {
        let scene = scene();
        let noise = Noise::default();
        let changing = vec![kernel(0.9), kernel(1.0), kernel(1.1), kernel(1.0)];
        for (blur, gain_db) in [
            (Blur::uniform(kernel(1.0)).unwrap(), 4.0),
            (Blur::new(changing, [2, 2]).unwrap(), 2.0),
        ] {
            let image = noise.expose(&blur.image(&scene), &mut ChaCha8Rng::seed_from_u64(3));
            let restored = restoration(noise).restore(&image, &blur);
            // Without its losses.
            let before = psnr_db((&image / 0.9).view(), scene.view()).unwrap();
            let after = psnr_db(restored.view(), scene.view()).unwrap();
            assert!(after > before + gain_db, "{before} dB before, {after} dB after");
        }
    }

    #[test]
    fn a_point_kernel_and_no_noise_change_nothing() {
        let scene = scene();
        let mut point = Array2::zeros((3, 3));
        point[[1, 1]] = 0.5;
        let blur = Blur::uniform(point).unwrap();
        let silent = Noise { photon: 0.0, read: 0.0 };
        let restored = restoration(silent).restore(&blur.image(&scene), &blur);
        assert!((&restored - &scene).iter().all(|d| d.abs() < ROUNDING));
    }

    /// A shift is undone: what came from beyond the border is the mirror image, which the filter expects there.
    #[test]
    fn a_known_shift_is_undone() {
        let scene = scene();
        let mut shifted = Array2::zeros((5, 5));
        shifted[[2, 3]] = 1.0;
        let blur = Blur::uniform(shifted).unwrap();
        let quiet = Noise {
            photon: 1e-12,
            read: 1e-8,
        };
        let seen = blur.image(&scene);
        assert!((seen[[20, 31]] - scene[[20, 30]]).abs() < ROUNDING);
        let restored = restoration(quiet).restore(&seen, &blur);
        // All but the column that has left the image.
        let inner = |a: &Array2<f64>| part(a.view(), 0..64, 0..79).to_owned();
        let found = psnr_db(inner(&restored).view(), inner(&scene).view()).unwrap();
        // What the filter leaves of so little noise; an image that stays shifted has 20 dB.
        const UNDONE_DB: f64 = 50.0;
        assert!(found > UNDONE_DB, "{found}");
    }

    #[test]
    fn expected_powers_add_up_to_the_variance() {
        let expected = restoration(Noise::default());
        let signal = expected.signal(&Fourier::new([40, 56], 0));
        let Scene { mean, contrast } = expected.scene;
        assert!((signal.sum() - mean * mean - contrast * contrast).abs() < ROUNDING);
        assert!(signal[[0, 1]] > signal[[0, 2]] && signal[[1, 0]] > signal[[2, 0]]);
    }
}
