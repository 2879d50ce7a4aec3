//! The error to be expected of an image after Wiener filtering, in closed form.

use metalith_sensor::Noise;
use num_complex::{Complex32, Complex64};

use super::scene::Scene;
use super::wiener::Wiener;
use crate::PixelWindow;

/// Power of image and noise at every frequency of a window's quarter plane, and the number of modes that
/// each stands for.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    image: Vec<f64>,
    count: Vec<f64>,
    noise: f64,
}

impl Spectrum {
    /// Powers of natural images level off below one period a window; noise is white. Powers are such that their sums
    /// over all modes are variances.
    pub(crate) fn new(scene: &Scene, noise: &Noise, window: PixelWindow) -> Self {
        let side = window.pixels / 2 + 1;
        let share = |i: usize| if i == 0 || i == window.pixels / 2 { 1.0 } else { 2.0 };
        let mut image = Vec::with_capacity(side * side);
        let mut count = Vec::with_capacity(side * side);
        for j in 0..side {
            for i in 0..side {
                let zero = i == 0 && j == 0;
                image.push(if zero {
                    0.0
                } else {
                    Scene::power((i * i + j * j) as f64)
                });
                count.push(share(i) * share(j));
            }
        }
        let total = image.iter().zip(&count).map(|(s, c)| s * c).sum::<f64>();
        image.iter_mut().for_each(|s| *s *= scene.contrast.powi(2) / total);
        let noise = noise.variance(scene.mean) / (window.pixels as f64).powi(2);
        Self { image, count, noise }
    }

    /// Number of modes of the quarter plane.
    pub(crate) fn modes(&self) -> usize {
        self.image.len()
    }

    /// Mean square error of images that are blurred by one of `blurs`, each as likely as the others, and
    /// restored by the one [`Wiener`] filter that is best for all of them:
    /// error S (1 - |mean H|^2 S / (mean |H|^2 S + N)), summed over all modes. For a single blur that is
    /// S N / (|H|^2 S + N).
    ///
    /// If `slopes` are given, the derivative by each blur (not its conjugate) times `scale` is added to them.
    pub(crate) fn error(&self, blurs: &[&[Complex32]], scale: f64, mut slopes: Option<&mut [Vec<Complex64>]>) -> f64 {
        let share = 1.0 / blurs.len() as f64;
        let mut sum = 0.0;
        for at in 0..self.image.len() {
            let (s, c) = (self.image[at], self.count[at]);
            let (mut mean, mut power) = (Complex64::ZERO, 0.0);
            for blur in blurs {
                let h = wide(blur[at]);
                mean += h * share;
                power += h.norm_sqr() * share;
            }
            let wiener = Wiener::new(power, s, self.noise);
            let gain = wiener.restored(mean);
            sum += c * s * (1.0 - gain);
            if let Some(slopes) = &mut slopes {
                let factor = -scale * c * s * s * share / wiener.seen();
                for (slope, blur) in slopes.iter_mut().zip(blurs) {
                    slope[at] += factor * (mean.conj() - gain * wide(blur[at]).conj());
                }
            }
        }
        sum
    }
}

fn wide(c: Complex32) -> Complex64 {
    Complex64::new(f64::from(c.re), f64::from(c.im))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tolerance of sums over 49 modes in double precision, through a difference of the size of one.
    const ROUNDING: f64 = 1e-9;

    const WINDOW: PixelWindow = PixelWindow {
        pixels: 12,
        pixel_um: 5.86,
    };

    fn transfer(seed: f32) -> Vec<Complex32> {
        (0..49)
            .map(|i| {
                let x = seed + i as f32;
                Complex32::new((0.7 * x).sin(), (1.3 * x).cos()) / (1.0 + 0.2 * i as f32)
            })
            .collect()
    }

    #[test]
    fn powers_sum_to_variances() {
        let (scene, count) = (Scene::default(), 144.0);
        let spectrum = Spectrum::new(&scene, &Noise::default(), WINDOW);
        assert_eq!(spectrum.count.iter().sum::<f64>(), count);
        let total = spectrum
            .image
            .iter()
            .zip(&spectrum.count)
            .map(|(s, c)| s * c)
            .sum::<f64>();
        assert!((total - scene.contrast.powi(2)).abs() < ROUNDING);
    }

    /// Any other filter W has the error mean |1 - W H|^2 S + |W|^2 N, which is larger.
    #[test]
    fn no_other_filter_does_better() {
        let spectrum = Spectrum::new(&Scene::default(), &Noise::default(), WINDOW);
        let (h, g) = (transfer(0.0), transfer(5.0));
        let best = spectrum.error(&[&h, &g], 1.0, None);
        let with = |shift: Complex64| {
            (0..49)
                .map(|i| {
                    let (s, n, h, g) = (spectrum.image[i], spectrum.noise, wide(h[i]), wide(g[i]));
                    let mean = 0.5 * (h + g);
                    let w = mean.conj() * s / (0.5 * (h.norm_sqr() + g.norm_sqr()) * s + n) + shift;
                    let miss = 0.5 * ((1.0 - w * h).norm_sqr() + (1.0 - w * g).norm_sqr());
                    spectrum.count[i] * (miss * s + w.norm_sqr() * n)
                })
                .sum::<f64>()
        };
        assert!((with(Complex64::ZERO) - best).abs() < ROUNDING * best);
        for shift in [0.01, -0.01] {
            assert!(with(Complex64::new(shift, 0.0)) > best);
            assert!(with(Complex64::new(0.0, shift)) > best);
        }
    }

    #[test]
    fn slopes_are_those_of_differences() {
        /// Single precision of the transfer functions over the step, and its square.
        const TOLERANCE: f64 = 2e-3;
        let noise = Noise {
            photon: 4e-2,
            ..Noise::default()
        };
        let spectrum = Spectrum::new(&Scene::default(), &noise, WINDOW);
        let (h, g) = (transfer(0.0), transfer(0.3));
        let mut slopes = vec![vec![Complex64::ZERO; 49]; 2];
        spectrum.error(&[&h, &g], 1.0, Some(&mut slopes));
        let step = 1e-2f32;
        for at in [1, 8, 20, 48] {
            for direction in [Complex32::new(1.0, 0.0), Complex32::new(0.0, 1.0)] {
                let moved = |sign: f32| {
                    let mut g = g.clone();
                    g[at] += direction * (sign * step);
                    spectrum.error(&[&h, &g], 1.0, None)
                };
                let difference = (moved(1.0) - moved(-1.0)) / (2.0 * f64::from(step));
                // dE = 2 Re(slope dH)
                let expected = 2.0 * (slopes[1][at] * wide(direction)).re;
                let error = (difference - expected).abs() / (2.0 * slopes[1][at].norm());
                assert!(error < TOLERANCE, "{at}: {difference} {expected}");
            }
        }
    }
}
