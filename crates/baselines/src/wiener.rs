//! An array's frame, made sharp by Wiener deconvolution with the kernels of one place of each element's field after the other, and laid on
//! the scene: the pictures that a Multi-Wiener-Net begins with (Yanny et al., Optica 9, 96 (2022)).
//!
//! Kernels are those of a grey surface. The stray light of a grey scene is subtracted; what neighbours' sub-images overlap stays.

use metalith_core::{Progress, Result};
use metalith_imaging::{FrameOperator, ImagingSystem, sensor_um};
use metalith_restoration::{FrameModel, Recorded, SceneStatistics, without_stray_light};
use metalith_wave::kernels::{FftScratch, SquareFft, fft_size};
use ndarray::{Array2, Zip};
use num_complex::Complex32;
use rayon::prelude::*;

use crate::post_processing::PICTURES;

/// Places of the field of an element whose kernels are used, from its axis, of the way to the last one that has some: the middle, and
/// half of the way to each corner.
const PLACES: [[f64; 2]; PICTURES] = [[0.0, 0.0], [-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]];

/// Parts that deconvolutions of one camera share.
struct Tiles<'a> {
    system: &'a ImagingSystem,
    fft: SquareFft,
    /// First row and column of the square about each element.
    first: Vec<[i64; 2]>,
    /// The element whose axis is nearest to each pixel.
    nearest: Array2<u16>,
    /// Weights of slopes and bends at each frequency, over the power of scenes on this sensor.
    prior: Vec<f32>,
}

/// Pictures by place: planes of each channel, white being one.
///
/// # Errors
/// If the user stopped it.
pub(crate) fn pictures(
    system: &ImagingSystem,
    operator: &FrameOperator<'_>,
    recorded: &Recorded<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Array2<f32>>>> {
    let tiles = Tiles::new(system, operator);
    let white = operator.apply_elements(&operator.white(), &operator.all_elements(), false);
    let [rows, columns] = operator.frame();
    let everywhere = vec![Array2::<f32>::ones((rows, columns)); operator.channels()];
    let reference = operator.unrestored(&white, &everywhere);
    let light = without_stray_light(recorded);
    let noise: Vec<f32> = recorded
        .inverse_variance
        .iter()
        .zip(&white)
        .map(|(t, w)| relative_noise(t, w))
        .collect();
    let even: Vec<Array2<f32>> = light
        .par_iter()
        .zip(recorded.inverse_variance)
        .map(|(l, t)| filled(l, t))
        .collect();
    progress.begin("restoring by Wiener filters", PICTURES as u64);
    let one = |place: &[f64; 2]| {
        progress.check_stopped()?;
        let channels = 0..operator.channels();
        let sharp: Vec<_> = channels
            .map(|c| tiles.sharpened(&even[c], c, *place, noise[c]))
            .collect();
        let mut laid = operator.unrestored(&sharp, &everywhere);
        for (plane, white) in laid.iter_mut().zip(&reference) {
            Zip::from(plane)
                .and(white)
                .for_each(|p, w| *p = if *w > 0.0 { *p / w } else { 0.0 });
        }
        progress.advance(1);
        Ok(laid)
    };
    PLACES.iter().map(one).collect()
}

/// Variance that noise has in each frequency of a frame whose missing pixels were filled in, over the square of the mean light of a white
/// scene: fewer pixels, more noise.
fn relative_noise(inverse_variance: &Array2<f32>, white: &Array2<f32>) -> f32 {
    let known = inverse_variance.iter().filter(|t| **t > 0.0);
    let (sum, count) = known.fold((0.0, 0usize), |(s, n), t| (s + 1.0 / f64::from(*t), n + 1));
    let mean = white.iter().map(|v| f64::from(*v)).sum::<f64>() / white.len() as f64;
    let count = count.max(1) as f64;
    let variance = sum / count * (inverse_variance.len() as f64 / count);
    (variance / (mean * mean).max(f64::MIN_POSITIVE)) as f32
}

/// Light in all pixels, from those about each that are known: weights fall linearly to the next but one.
fn filled(light: &Array2<f32>, inverse_variance: &Array2<f32>) -> Array2<f32> {
    let (rows, columns) = light.dim();
    Array2::from_shape_fn((rows, columns), |(y, x)| {
        let (mut sum, mut all) = (0.0, 0.0);
        for i in y.saturating_sub(1)..(y + 2).min(rows) {
            for j in x.saturating_sub(1)..(x + 2).min(columns) {
                if inverse_variance[[i, j]] > 0.0 {
                    let w = (if i == y { 1.0 } else { 0.5 }) * (if j == x { 1.0 } else { 0.5 });
                    sum += w * light[[i, j]];
                    all += w;
                }
            }
        }
        if all > 0.0 { sum / all } else { 0.0 }
    })
}

impl<'a> Tiles<'a> {
    fn new(system: &'a ImagingSystem, operator: &FrameOperator<'_>) -> Self {
        let spec = &system.bank.spec;
        let [rows, columns] = operator.frame();
        // Rows and columns of the axes of the elements.
        let sensor = &system.camera.sensor;
        let axes: Vec<[f64; 2]> = system.elements.iter().map(|e| sensor.pixel_at(e.centre_um)).collect();
        let reach = (spec.reach_um / spec.pixel_um).ceil() as usize;
        let fft = SquareFft::new(fft_size(2 * (reach + spec.window)));
        let half = (fft.size() / 2) as i64;
        let first = axes.iter().map(|a| a.map(|v| v.round() as i64 - half)).collect();
        let nearest = Array2::from_shape_fn((rows, columns), |(y, x)| {
            let distance = |a: &[f64; 2]| (a[0] - y as f64).powi(2) + (a[1] - x as f64).powi(2);
            let best = (0..axes.len()).min_by(|i, k| distance(&axes[*i]).total_cmp(&distance(&axes[*k])));
            best.unwrap_or(0) as u16
        });
        Self {
            system,
            first,
            nearest,
            prior: prior(system, &fft),
            fft,
        }
    }

    /// A channel's frame without the blur that its kernels have at a place of each element's field.
    fn sharpened(&self, frame: &Array2<f32>, channel: usize, place: [f64; 2], noise: f32) -> Array2<f32> {
        let n = self.fft.size();
        let squares: Vec<Vec<f32>> = self
            .first
            .par_iter()
            .enumerate()
            .map_init(FftScratch::default, |scratch, (element, first)| {
                let mut seen = self.transformed(self.cut(frame, *first), scratch);
                let kernel = self.transformed(self.kernel(element, channel, place), scratch);
                for ((v, k), prior) in seen.iter_mut().zip(&kernel).zip(&self.prior) {
                    *v *= k.conj() / (k.norm_sqr() + noise * prior);
                }
                let mut square = vec![0.0; n * n];
                self.fft.inverse(&mut seen, &mut square, n, scratch);
                square
            })
            .collect();
        Array2::from_shape_fn(frame.dim(), |(y, x)| {
            let element = usize::from(self.nearest[[y, x]]);
            let at = [y, x].map(|v| v as i64);
            let at = [0, 1].map(|a| at[a] - self.first[element][a]);
            if at.iter().all(|v| (0..n as i64).contains(v)) {
                squares[element][at[0] as usize * n + at[1] as usize]
            } else {
                0.0
            }
        })
    }

    fn transformed(&self, mut square: Vec<f32>, scratch: &mut FftScratch) -> Vec<Complex32> {
        let mut spectrum = vec![Complex32::ZERO; self.fft.entries()];
        self.fft.forward(&mut square, self.fft.size(), &mut spectrum, scratch);
        spectrum
    }

    /// A square of a frame; beyond the sensor its border goes on.
    fn cut(&self, frame: &Array2<f32>, first: [i64; 2]) -> Vec<f32> {
        let n = self.fft.size();
        let (rows, columns) = frame.dim();
        let at = |i: usize, a: usize, n: usize| (first[a] + i as i64).clamp(0, n as i64 - 1) as usize;
        (0..n * n)
            .map(|k| frame[[at(k / n, 0, rows), at(k % n, 1, columns)]])
            .collect()
    }

    /// The kernel of a grey surface, on pixels, of sum one, its middle in the first place of a square; and what filling in pixels blurs.
    fn kernel(&self, element: usize, channel: usize, place: [f64; 2]) -> Vec<f32> {
        let (bank, n) = (&self.system.bank, self.fft.size());
        let last = (bank.spec.nodes - 1) as f64;
        let node = place.map(|p| (0.5 * (p + 1.0) * last).round() as usize);
        let (window, side) = (bank.spec.window as i64, bank.spec.side());
        let mut square = vec![0.0; n * n];
        let mut energy = 0.0;
        for basis in self.system.primaries() {
            let kept = bank.kernel(element, node, channel, basis);
            let kernel = kept.turned();
            for dy in 1 - window / 2..window / 2 {
                for dx in 1 - window / 2..window / 2 {
                    // Kernels stand at a quarter of a pixel on both sides of its middle.
                    let at = |d: i64| (window - 1 + 2 * d) as usize;
                    let pair = |y: usize| kernel[y * side + at(dx)] + kernel[y * side + at(dx) + 1];
                    let value = 0.25 * (pair(at(dy)) + pair(at(dy) + 1));
                    energy += value;
                    for (y, wy) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
                        for (x, wx) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
                            let wrapped = |d: i64| d.rem_euclid(n as i64) as usize;
                            square[wrapped(dy + y) * n + wrapped(dx + x)] += wy * wx * value;
                        }
                    }
                }
            }
        }
        // A place whose light misses the sensor has a kernel of zeros.
        if energy > 0.0 {
            square.iter_mut().for_each(|v| *v /= energy);
        }
        square
    }
}

/// One over the spectrum of a channel of natural scenes on the pixels of the sensor, in the order of a transform.
fn prior(system: &ImagingSystem, fft: &SquareFft) -> Vec<f32> {
    let n = fft.size();
    // Pixels of the sensor for a pixel of the scene: what scenes have beyond their own finest detail is taken to be like it.
    let scale = sensor_um(&system.design, &system.camera) * system.view.pixel() / system.camera.sensor.pixel_um;
    let strength = SceneStatistics::grey(1).terms(1.0).slopes / (scale * scale);
    let squared: Vec<f64> = (0..n)
        .map(|k| {
            let cycles = (k.min(n - k) as f64 / n as f64 * scale).min(0.5);
            2.0 - 2.0 * (std::f64::consts::TAU * cycles).cos()
        })
        .collect();
    (0..fft.entries())
        .map(|i| {
            let s = squared[i / n] + squared[i % n];
            (strength * (s + s * s)) as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_pixels_are_between_their_neighbours_and_count_as_noise() {
        /// Sums of a few numbers in single precision.
        const ROUNDING: f32 = 1e-5;
        let ramp = Array2::from_shape_fn((12, 14), |(y, x)| 1.0 + 0.3 * y as f32 + 0.2 * x as f32);
        // One pixel of a square of two by two is known, with a variance of a quarter.
        let inverse_variance =
            Array2::from_shape_fn(ramp.dim(), |(y, x)| if y % 2 == 0 && x % 2 == 1 { 4.0 } else { 0.0 });
        let light = &ramp * &inverse_variance.mapv(|t| t / 4.0);
        let found = filled(&light, &inverse_variance);
        for y in 1..10 {
            for x in 1..12 {
                assert!((found[[y, x]] - ramp[[y, x]]).abs() < ROUNDING, "{y} {x}");
            }
        }
        // Four pixels for each that is known, light of two.
        let noise = relative_noise(&inverse_variance, &Array2::from_elem(ramp.dim(), 2.0));
        assert!((noise - 0.25 * 4.0 / 4.0).abs() < ROUNDING, "{noise}");
    }
}
