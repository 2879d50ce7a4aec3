//! Photographs taken through a lens, restored, and compared with what was in front of it.

use ndarray::{Array2, Array3};
use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustfft::FftPlanner;

use super::imaging::Transfer;
use super::pupil::Window;
use super::wiener::Scene;

/// How well one photograph was restored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Restored {
    /// Peak signal-to-noise ratio [dB].
    pub psnr_db: f64,
    /// Structural similarity (Wang et al. 2004), mean over the colours.
    pub ssim: f64,
}

/// A camera behind one lens at one field angle: what it does to each colour, and its noise.
pub struct Camera {
    /// Mean transfer function of each colour, `[j][i]` on a window's frequencies.
    channels: Vec<Vec<Complex64>>,
    window: Window,
    scene: Scene,
}

impl Camera {
    /// From the transfer functions over wavelength at one angle; red is the last third of them.
    pub fn new(transfers: &[Transfer], window: Window, scene: Scene) -> Self {
        let (count, modes) = (transfers.len(), transfers.first().map_or(0, Vec::len));
        let channels = (0..3)
            .rev()
            .map(|c| {
                let part = &transfers[c * count / 3..(c + 1) * count / 3];
                (0..modes)
                    .map(|m| {
                        let sum = part
                            .iter()
                            .map(|t| Complex64::new(f64::from(t[m].re), f64::from(t[m].im)));
                        sum.sum::<Complex64>() / part.len() as f64
                    })
                    .collect()
            })
            .collect();
        Self {
            channels,
            window,
            scene,
        }
    }

    /// Take a photograph of `image` (`[row, column, colour]`, sRGB from 0 to 1), restore it with the Wiener
    /// filter of the mean transfer function of each colour, and compare. Edges are periodic.
    pub fn photograph(&self, image: &Array3<f64>, seed: u64) -> (Array3<f64>, Restored) {
        let (rows, columns, _) = image.dim();
        let mut restored = image.clone();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        for (colour, transfer) in self.channels.iter().enumerate() {
            let light = Array2::from_shape_fn((rows, columns), |(y, x)| linear(image[[y, x, colour]]));
            let blur = self.spread(transfer, rows, columns);
            let mut seen = fourier(&light.mapv(|v| Complex64::new(v, 0.0)), false);
            seen.zip_mut_with(&blur, |s, h| *s *= h);
            let mut seen = fourier(&seen, true);
            for v in &mut seen {
                let signal = v.re.max(0.0);
                let deviation = (self.scene.photon_noise * signal + self.scene.read_noise.powi(2)).sqrt();
                *v = Complex64::new(v.re + deviation * normal(&mut random), 0.0);
            }
            let filtered = self.restore(&fourier(&seen, false), &blur);
            for ((y, x), v) in filtered.indexed_iter() {
                restored[[y, x, colour]] = encoded(v.re);
            }
        }
        let fidelity = Restored {
            psnr_db: psnr(image, &restored),
            ssim: ssim(image, &restored),
        };
        (restored, fidelity)
    }

    fn restore(&self, seen: &Array2<Complex64>, blur: &Array2<Complex64>) -> Array2<Complex64> {
        let (rows, columns) = seen.dim();
        let pixels = (rows * columns) as f64;
        // Image power as in the merit: falling with the square of the frequency in periods a window.
        let (wy, wx) = (
            self.window.pixels as f64 / rows as f64,
            self.window.pixels as f64 / columns as f64,
        );
        let signed = |i: usize, n: usize| if 2 * i > n { i as f64 - n as f64 } else { i as f64 };
        let power = Array2::from_shape_fn((rows, columns), |(y, x)| {
            let q2 = (signed(y, rows) * wy).powi(2) + (signed(x, columns) * wx).powi(2);
            if y == 0 && x == 0 { 0.0 } else { 1.0 / (1.0 + q2) }
        });
        let scale = self.scene.contrast.powi(2) / power.sum();
        let noise = (self.scene.photon_noise * self.scene.mean + self.scene.read_noise.powi(2)) / pixels;
        let mut spectrum = seen.clone();
        for ((at, v), h) in spectrum.indexed_iter_mut().zip(blur) {
            let s = power[at] * scale;
            // The mean is kept as it is, but for the lens's losses.
            *v *= if at == (0, 0) {
                1.0 / h
            } else {
                h.conj() * s / (h.norm_sqr() * s + noise)
            };
        }
        fourier(&spectrum, true)
    }

    /// The transfer function on the frequencies of an image: the PSF in pixels, cut to what fits, in its place.
    fn spread(&self, transfer: &[Complex64], rows: usize, columns: usize) -> Array2<Complex64> {
        let (n, side) = (self.window.pixels, self.window.pixels / 2 + 1);
        let full = Array2::from_shape_fn((n, n), |(y, x)| {
            let (j, i) = (y.min(n - y), x.min(n - x));
            let h = transfer[j * side + i];
            if x > n / 2 { h.conj() } else { h }
        });
        let psf = fourier(&full, true);
        let mut placed = Array2::zeros((rows, columns));
        for ((y, x), v) in psf.indexed_iter() {
            let (dy, dx) = (if 2 * y > n { n - y } else { y }, if 2 * x > n { n - x } else { x });
            if 2 * dy < rows && 2 * dx < columns {
                let (y, x) = (
                    if 2 * y > n { rows - dy } else { dy },
                    if 2 * x > n { columns - dx } else { dx },
                );
                placed[[y, x]] += Complex64::new(v.re, 0.0);
            }
        }
        fourier(&placed, false)
    }
}

/// Two-dimensional transform; the inverse is divided by the number of entries.
fn fourier(values: &Array2<Complex64>, inverse: bool) -> Array2<Complex64> {
    let mut planner = FftPlanner::new();
    let mut along = |a: &Array2<Complex64>| {
        let mut rows = a.as_standard_layout().into_owned();
        let n = rows.dim().1;
        let plan = if inverse {
            planner.plan_fft_inverse(n)
        } else {
            planner.plan_fft_forward(n)
        };
        plan.process(rows.as_slice_mut().expect("it is in standard layout"));
        rows.reversed_axes()
    };
    let once = along(values);
    let mut twice = along(&once).as_standard_layout().into_owned();
    if inverse {
        let count = twice.len() as f64;
        twice.mapv_inplace(|v| v / count);
    }
    twice
}

/// Light from an sRGB value (IEC 61966-2-1).
fn linear(v: f64) -> f64 {
    if v <= 0.04045 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

/// sRGB value of light, cut to 0 to 1.
fn encoded(v: f64) -> f64 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * v.powf(1.0 / 2.4) - 0.055
    }
}

fn normal(random: &mut impl Rng) -> f64 {
    let (a, b) = (1.0 - random.random::<f64>(), random.random::<f64>());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// Peak signal-to-noise ratio of two images from 0 to 1 [dB].
pub fn psnr(a: &Array3<f64>, b: &Array3<f64>) -> f64 {
    let error = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64;
    -10.0 * error.log10()
}

/// Mean structural similarity of two images from 0 to 1: Gaussian window of 1.5 pixels, 11 across,
/// K1 = 0.01, K2 = 0.03, over places where the window fits.
pub fn ssim(a: &Array3<f64>, b: &Array3<f64>) -> f64 {
    const HALF: usize = 5;
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let weights = (0..=2 * HALF)
        .map(|i| (-0.5 * ((i as f64 - HALF as f64) / 1.5).powi(2)).exp())
        .collect::<Vec<_>>();
    let total = weights.iter().sum::<f64>();
    let (rows, columns, colours) = a.dim();
    if rows <= 2 * HALF || columns <= 2 * HALF {
        return f64::NAN;
    }
    let smooth = |value: &dyn Fn(usize, usize) -> f64| {
        let across = Array2::from_shape_fn((rows, columns - 2 * HALF), |(y, x)| {
            weights
                .iter()
                .enumerate()
                .map(|(i, w)| w * value(y, x + i))
                .sum::<f64>()
                / total
        });
        Array2::from_shape_fn((rows - 2 * HALF, columns - 2 * HALF), |(y, x)| {
            weights
                .iter()
                .enumerate()
                .map(|(i, w)| w * across[[y + i, x]])
                .sum::<f64>()
                / total
        })
    };
    let mut sum = 0.0;
    for c in 0..colours {
        let (mean_a, mean_b) = (smooth(&|y, x| a[[y, x, c]]), smooth(&|y, x| b[[y, x, c]]));
        let square_a = smooth(&|y, x| a[[y, x, c]].powi(2));
        let square_b = smooth(&|y, x| b[[y, x, c]].powi(2));
        let product = smooth(&|y, x| a[[y, x, c]] * b[[y, x, c]]);
        let mut part = 0.0;
        for at in ndarray::indices_of(&mean_a) {
            let (m, n) = (mean_a[at], mean_b[at]);
            let (v, w, cov) = (square_a[at] - m * m, square_b[at] - n * n, product[at] - m * n);
            part += (2.0 * m * n + C1) * (2.0 * cov + C2) / ((m * m + n * n + C1) * (v + w + C2));
        }
        sum += part / mean_a.len() as f64;
    }
    sum / colours as f64
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;

    use super::*;

    const WINDOW: Window = Window {
        pixels: 16,
        pixel_um: 5.86,
    };

    /// A transfer function that changes nothing.
    fn perfect(window: Window) -> Transfer {
        vec![Complex32::new(1.0, 0.0); (window.pixels / 2 + 1).pow(2)]
    }

    fn image() -> Array3<f64> {
        Array3::from_shape_fn((40, 36, 3), |(y, x, c)| {
            0.5 + 0.3 * (0.4 * x as f64 + c as f64).sin() * (0.3 * y as f64).cos()
        })
    }

    fn quiet() -> Scene {
        Scene {
            photon_noise: 1e-12,
            read_noise: 1e-8,
            ..Scene::default()
        }
    }

    #[test]
    fn a_perfect_lens_without_noise_changes_nothing() {
        let camera = Camera::new(&[perfect(WINDOW), perfect(WINDOW), perfect(WINDOW)], WINDOW, quiet());
        let (_, found) = camera.photograph(&image(), 1);
        assert!(found.psnr_db > 60.0 && found.ssim > 0.999, "{found:?}");
    }

    /// A shift of the transfer function by one pixel along x moves what is seen by one column; the filter,
    /// which knows it, moves it back.
    #[test]
    fn a_known_shift_is_undone() {
        let side = WINDOW.pixels / 2 + 1;
        let shift = (0..side * side)
            .map(|m| {
                let angle = -std::f64::consts::TAU * (m % side) as f64 / WINDOW.pixels as f64;
                Complex32::new(angle.cos() as f32, angle.sin() as f32)
            })
            .collect::<Vec<_>>();
        let camera = Camera::new(&[shift.clone(), shift.clone(), shift], WINDOW, quiet());
        let (_, found) = camera.photograph(&image(), 1);
        assert!(found.psnr_db > 50.0, "{found:?}");
        let psf = camera.spread(&camera.channels[0], 40, 36);
        let light = Array2::from_shape_fn((40, 36), |(y, x)| Complex64::new(f64::from(y == 5 && x == 7), 0.0));
        let moved = fourier(&(fourier(&light, false) * psf), true);
        assert!(moved[[5, 8]].re > 0.99);
    }

    #[test]
    fn similarity_knows_itself_and_noise() {
        let a = image();
        assert!((ssim(&a, &a) - 1.0).abs() < 1e-12);
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let noisy = a.mapv(|v| v + 0.1 * normal(&mut random));
        let found = ssim(&a, &noisy);
        assert!(found > 0.2 && found < 0.9, "{found}");
        assert!((psnr(&a, &noisy) - 20.0).abs() < 0.5);
    }
}
