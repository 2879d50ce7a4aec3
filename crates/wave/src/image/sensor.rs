//! Scenes through a lens onto a noisy sensor.

use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Patches;
use super::fourier::Fourier;

/// Noise of a sensor, for images between zero and one: photons counted in units of `photon`, and what reading adds.
///
/// The model and numbers of Tseng et al., Nature Communications 12, 6493 (2021).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Signal of one photon, a_p.
    pub photon: f64,
    /// Standard deviation of what reading adds, sigma_g.
    pub read: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            photon: 4e-5,
            read: 1e-5,
        }
    }
}

impl Noise {
    /// Variance at a signal of this size.
    pub fn variance(&self, signal: f64) -> f64 {
        self.photon * signal.max(0.0) + self.read * self.read
    }

    /// One exposure. The same seed gives the same noise.
    pub fn expose(&self, image: &Array2<f64>, seed: u64) -> Array2<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        image.map(|&signal| {
            let photons = if self.photon > 0.0 {
                poisson(&mut rng, signal.max(0.0) / self.photon) * self.photon
            } else {
                signal
            };
            photons + self.read * normal(&mut rng)
        })
    }
}

/// The image of a scene, without noise: each point spread by the kernel in force where it is. The scene is mirrored at
/// its border.
pub fn blur(scene: &Array2<f64>, patches: &Patches) -> Array2<f64> {
    let shape = <[usize; 2]>::from(scene.dim());
    let fourier = Fourier::new(shape, patches.reach());
    let mut sum = Array2::zeros(fourier.size());
    for (kernel, weight) in patches.weighted(shape) {
        sum += &(fourier.of_image(&(scene * &weight)) * fourier.of_kernel(kernel));
    }
    fourier.to_image(sum)
}

/// A standard normal number, by Box and Muller.
fn normal(rng: &mut impl Rng) -> f64 {
    let (u, v): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A Poisson number: by products of uniform numbers below a mean of ten, else by Hoermann's transformed rejection
/// (Insurance: Mathematics and Economics 12, 39 (1993)).
fn poisson(rng: &mut impl Rng, mean: f64) -> f64 {
    if mean < 10.0 {
        let limit = (-mean).exp();
        let (mut count, mut product) = (0.0, rng.random::<f64>());
        while product > limit {
            product *= rng.random::<f64>();
            count += 1.0;
        }
        return count;
    }
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.02483 * b;
    let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    let quick = 0.9277 - 3.6224 / (b - 2.0);
    loop {
        let u = rng.random::<f64>() - 0.5;
        let v = rng.random::<f64>();
        let edge = 0.5 - u.abs();
        let k = ((2.0 * a / edge + b) * u + mean + 0.43).floor();
        if edge >= 0.07 && v <= quick {
            return k;
        }
        if k < 0.0 || (edge < 0.013 && v > edge) {
            continue;
        }
        let hat = (v * inverse_alpha / (a / (edge * edge) + b)).ln();
        if hat <= k * mean.ln() - mean - ln_factorial(k) {
            return k;
        }
    }
}

/// ln k!, by Stirling's series above ten: good to 1e-9.
fn ln_factorial(k: f64) -> f64 {
    if k < 10.0 {
        return (2..=k as u32).map(|i| f64::from(i).ln()).sum();
    }
    let n = k + 1.0;
    let series = 1.0 / (12.0 * n) - 1.0 / (360.0 * n.powi(3)) + 1.0 / (1260.0 * n.powi(5));
    (n - 0.5) * n.ln() - n + 0.5 * std::f64::consts::TAU.ln() + series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_mean_and_variance_it_says() {
        // Moments of 40,000 numbers: a standard error of 0.5 % of the deviation, and of 0.7 % in the variance.
        const FIVE_SIGMA: f64 = 5.0;
        let n = 200 * 200;
        for (photon, signal) in [(4e-5, 0.5), (4e-5, 2e-4), (0.01, 0.3), (0.0, 0.3)] {
            let noise = Noise { photon, read: 1e-5 };
            let image = noise.expose(&Array2::from_elem((200, 200), signal), 7);
            let mean = image.sum() / f64::from(n);
            let variance = image.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
            let want = noise.variance(signal);
            assert!((mean - signal).abs() < FIVE_SIGMA * (want / f64::from(n)).sqrt());
            assert!(
                (variance / want - 1.0).abs() < FIVE_SIGMA * (2.5 / f64::from(n)).sqrt(),
                "{photon} {signal}"
            );
        }
    }

    #[test]
    fn factorials() {
        assert!((ln_factorial(12.0) - 479_001_600.0_f64.ln()).abs() < 1e-9);
        assert!((ln_factorial(5.0) - 120.0_f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn a_blur_is_the_sum_over_the_kernel_and_mirrors_at_the_border() {
        let scene = Array2::from_shape_fn((12, 17), |(y, x)| ((y * 7 + x * x * 3) % 11) as f64 / 10.0);
        let kernel = Array2::from_shape_fn((3, 5), |(y, x)| (1 + y * 5 + x) as f64);
        let got = blur(&scene, &Patches::uniform(kernel.clone()).unwrap());
        let mirror = |i: i64, n: i64| {
            (if i < 0 {
                -1 - i
            } else if i >= n {
                2 * n - 1 - i
            } else {
                i
            }) as usize
        };
        for ((y, x), got) in got.indexed_iter() {
            let mut want = 0.0;
            for ((ky, kx), k) in kernel.indexed_iter() {
                let (sy, sx) = (y as i64 + 1 - ky as i64, x as i64 + 2 - kx as i64);
                want += k / kernel.sum() * scene[[mirror(sy, 12), mirror(sx, 17)]];
            }
            assert!((got - want).abs() < 1e-12, "{y} {x}: {got} is not {want}");
        }
    }
}
