//! Kernels that an effect declares, as filters of images.

use ndarray::Array2;
use num_complex::Complex64;

use crate::declared::{CompiledTerm, DeclaredQuantity};
use crate::expression::Input;

/// A kernel is evaluated at so many places for each sample of an image, along each axis: the spot of a ghost may be much
/// narrower than the samples, which only have to hold the light. Of a Gaussian with a standard deviation of 0.2 steps,
/// exp(-2 (pi 0.8)^2) is then aliased, 3e-6.
const FINER: usize = 4;

/// Factor of kernels on each wave of an image, with the image itself: kernels act one after the other.
pub struct KernelFilter {
    /// Spectrum of twice as many rows and columns as the image: nothing comes from beyond it.
    spectrum: Array2<Complex64>,
}

impl KernelFilter {
    /// Kernels on images of this shape, rows along +y. The places at which they are evaluated are moved by `moved` of the distance
    /// between two of them.
    pub(super) fn new(terms: &[CompiledTerm], shape: [usize; 2], step_um: f64, moved: f64) -> Self {
        let mut spectrum = Array2::from_elem(shape.map(|n| 2 * n), Complex64::ONE);
        for term in terms {
            if term.quantity == DeclaredQuantity::Transfer {
                transfer_of(term, &mut spectrum, step_um);
                continue;
            }
            let own = spectrum_of(term, shape, step_um, moved);
            spectrum.zip_mut_with(&own, |all, own| *all *= Complex64::ONE + own);
        }
        Self { spectrum }
    }

    /// Add what the kernels make of an image: at each sample, the light of all others through them.
    pub fn apply(&self, image: &mut Array2<f64>) {
        let lit = |at: (usize, usize)| image.get(at).map_or(Complex64::ZERO, |v| Complex64::from(*v));
        let mut light = Array2::from_shape_fn(self.spectrum.dim(), lit);
        transform(&mut light, false);
        light *= &self.spectrum;
        transform(&mut light, true);
        let scale = 1.0 / self.spectrum.len() as f64;
        image.indexed_iter_mut().for_each(|(at, v)| *v = light[at].re * scale);
    }
}

/// Multiply a spectrum by a transfer factor. Images stay real: a frequency and its opposite have the mean of both factors.
fn transfer_of(term: &CompiledTerm, spectrum: &mut Array2<Complex64>, step_um: f64) {
    let (rows, cols) = spectrum.dim();
    let frequency = |k: usize, n: usize| {
        let signed = if k <= n / 2 { k as f64 } else { k as f64 - n as f64 };
        signed / (n as f64 * step_um)
    };
    for ((ky, kx), v) in spectrum.indexed_iter_mut() {
        let (fx, fy) = (frequency(kx, cols), frequency(ky, rows));
        *v *= 0.5 * (term.value(&[fx, fy]) + term.value(&[-fx, -fy]));
    }
}

/// The spectrum of a kernel up to the highest frequency that samples hold. The kernel is evaluated on [`FINER`] times as
/// many places along each axis, one lattice of the step of the samples after the other, each with the phase of its place.
fn spectrum_of(term: &CompiledTerm, [rows, cols]: [usize; 2], step_um: f64, moved: f64) -> Array2<Complex64> {
    let shape = [2 * rows, 2 * cols];
    let fine_um = step_um / FINER as f64;
    let mut sum = Array2::from_elem(shape, Complex64::ZERO);
    let mut values = vec![0.0; shape[1]];
    let phases = shape.map(|n| {
        (0..FINER)
            .map(|part| phases(n, part as f64 + moved))
            .collect::<Vec<_>>()
    });
    for (part_y, along_y) in phases[0].iter().enumerate() {
        let places_y = places(shape[0], part_y as f64 + moved, fine_um);
        for (part_x, along_x) in phases[1].iter().enumerate() {
            let places_x = places(shape[1], part_x as f64 + moved, fine_um);
            let mut own = Array2::from_elem(shape, Complex64::ZERO);
            for (mut row, y) in own.rows_mut().into_iter().zip(&places_y) {
                term.row(&[Input::Row(&places_x), Input::Scalar(*y)], &mut values);
                row.iter_mut()
                    .zip(&values)
                    .for_each(|(to, v)| *to = Complex64::from(*v));
            }
            transform(&mut own, false);
            for ((ky, kx), v) in own.indexed_iter() {
                sum[[ky, kx]] += v * along_y[ky] * along_x[kx];
            }
        }
    }
    sum.mapv_into(|v| v * fine_um * fine_um)
}

/// Places of one lattice (um): sample 0 is in the middle, and the second half stands before it.
fn places(samples: usize, part: f64, fine_um: f64) -> Vec<f64> {
    let place = |i: usize| i as f64 - if i < samples / 2 { 0.0 } else { samples as f64 };
    (0..samples)
        .map(|i| (place(i) * FINER as f64 + part) * fine_um)
        .collect()
}

/// The phase at each frequency of a lattice that stands `part` fine steps off.
fn phases(samples: usize, part: f64) -> Vec<Complex64> {
    let turn = |k: f64| -std::f64::consts::TAU * k * part / (samples * FINER) as f64;
    let half = samples / 2;
    (0..samples)
        .map(|k| match k {
            // The highest frequency is that of both signs.
            _ if k == half => Complex64::from(turn(half as f64).cos()),
            _ if k < half => Complex64::cis(turn(k as f64)),
            _ => Complex64::cis(turn(k as f64 - samples as f64)),
        })
        .collect()
}

/// The Fourier transform over both axes, not scaled.
fn transform(plane: &mut Array2<Complex64>, inverse: bool) {
    for _ in 0..2 {
        let n = plane.ncols();
        let fft = if inverse {
            metalith_fourier::inverse::<f64>(n)
        } else {
            metalith_fourier::forward::<f64>(n)
        };
        if let Some(lines) = plane.as_slice_mut() {
            fft.process(lines);
        }
        *plane = plane.t().as_standard_layout().into_owned();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraChange, DeclaredQuantity, DeclaredTerm};

    /// Samples of the images (um), and how many.
    const STEP_UM: f64 = 0.5;
    const SAMPLES: usize = 64;

    /// Standard deviation of the image (um).
    const IMAGE_UM: f64 = 1.2;

    fn gaussian(sigma: f64, at: [f64; 2]) -> Array2<f64> {
        let place = |i: usize| (i as f64 - 0.5 * (SAMPLES as f64 - 1.0)) * STEP_UM;
        Array2::from_shape_fn((SAMPLES, SAMPLES), |(iy, ix)| {
            let r2: f64 = (place(ix) - at[0]).powi(2) + (place(iy) - at[1]).powi(2);
            (-r2 / (2.0 * sigma * sigma)).exp() / (sigma * sigma)
        })
    }

    fn ghosted(a: f64, [u, v]: [f64; 2], sigma: f64) -> Array2<f64> {
        let text = "a * exp(-((x - u)^2 + (y - v)^2) / (2 * s^2)) / (2 * pi * s^2)";
        let values = [("a", a), ("u", u), ("v", v), ("s", sigma)];
        let change = CameraChange {
            declared: vec![DeclaredTerm {
                name: "ghost".into(),
                quantity: DeclaredQuantity::Kernel,
                expression: text.into(),
                values: values.map(|(name, v)| (name.to_owned(), v)).into(),
            }],
            ..CameraChange::default()
        };
        let mut image = gaussian(IMAGE_UM, [0.0; 2]);
        change.kernels(image.dim(), STEP_UM).unwrap().apply(&mut image);
        image
    }

    /// The second image of a Gaussian is one of the summed variance, also of a spot much narrower than the samples and at
    /// a place between them.
    #[test]
    fn a_kernel_makes_a_second_image_however_narrow_it_is() {
        /// The tail of the narrowest kernel that its places alias, 2 exp(-2 (pi 0.1 / 0.125)^2), times the share.
        const ALIASED: f64 = 1e-6;
        for (sigma, at) in [(0.1, [2.1, -1.57]), (0.5, [2.0, -1.5]), (1.0, [-1.8, 0.3])] {
            let got = ghosted(0.1, at, sigma);
            let want = gaussian(IMAGE_UM, [0.0; 2]) + 0.1 * gaussian(IMAGE_UM.hypot(sigma), at);
            let worst = (&got - &want).fold(0.0, |worst: f64, v| worst.max(v.abs()));
            assert!(worst < ALIASED, "{sigma} {at:?}: {worst:e}");
        }
    }

    /// Places moved by half of their distance: a smooth kernel is the same, one with an edge is as much longer as places are apart.
    #[test]
    fn moved_places_tell_how_well_a_kernel_is_sampled() {
        let light = |text: &str, moved: f64| {
            let change = CameraChange {
                declared: vec![DeclaredTerm {
                    name: "k".into(),
                    quantity: DeclaredQuantity::Kernel,
                    expression: text.into(),
                    values: [("a".to_owned(), 0.2)].into(),
                }],
                ..CameraChange::default()
            };
            let mut image = gaussian(IMAGE_UM, [0.0; 2]);
            let kernels = change.kernels_on_places(image.dim(), STEP_UM, moved).unwrap();
            kernels.apply(&mut image);
            image.sum()
        };
        let differ = |text: &str| (light(text, 0.5) / light(text, 0.0) - 1.0).abs();
        assert!(differ("a * exp(-(x^2 + y^2))") < 1e-9);
        // 21 and 20 places of 0.125 um on each axis: what is added differs by a tenth.
        assert!(differ("a * step(1.26 - abs(x)) * step(1.26 - abs(y))") > 1e-2);
    }

    #[test]
    fn two_kernels_act_one_after_the_other() {
        /// Sums of some ten thousand numbers in double precision.
        const ROUNDING: f64 = 1e-12;
        let term = |text: &str| DeclaredTerm {
            name: "k".into(),
            quantity: DeclaredQuantity::Kernel,
            expression: text.into(),
            values: [("a".to_owned(), 0.2)].into(),
        };
        let texts = ["a * exp(-((x - 3)^2 + y^2))", "a * exp(-(x^2 + (y - 2)^2))"];
        let filtered = |terms: &[&str]| {
            let change = CameraChange {
                declared: terms.iter().map(|t| term(t)).collect(),
                ..CameraChange::default()
            };
            let mut image = gaussian(IMAGE_UM, [0.0; 2]);
            change.kernels(image.dim(), STEP_UM).unwrap().apply(&mut image);
            image
        };
        let base = gaussian(IMAGE_UM, [0.0; 2]);
        let both = filtered(&texts);
        let [one, other] = texts.map(|t| filtered(&[t]) - &base);
        // What is left is the light that passed both: a spot at (3, 2), of the product of their shares.
        let twice = both - &base - one - other;
        let at = |x: f64, y: f64| {
            let index = |v: f64| (v / STEP_UM + 0.5 * (SAMPLES as f64 - 1.0)).round() as usize;
            twice[[index(y), index(x)]]
        };
        assert!(at(3.0, 2.0) > 10.0 * at(-3.0, 2.0).abs().max(ROUNDING));
    }

    /// A Gaussian that vibrates along a direction at 30 degrees is as wide as before across it.
    #[test]
    fn a_transfer_blurs_along_one_direction() {
        const BLUR_UM: f64 = 0.9;
        const TOLERANCE: f64 = 1e-3;
        let mut change = CameraChange::default();
        change.declared.push(DeclaredTerm {
            name: "vibration".into(),
            quantity: DeclaredQuantity::Transfer,
            expression: "exp(-2 * pi^2 * a * (fx * cos(b * pi / 180) + fy * sin(b * pi / 180))^2)".into(),
            values: [("a".to_owned(), BLUR_UM * BLUR_UM), ("b".to_owned(), 30.0)].into(),
        });
        let mut image = gaussian(IMAGE_UM, [0.0; 2]);
        let light = image.sum();
        change.kernels(image.dim(), STEP_UM).unwrap().apply(&mut image);
        assert!((image.sum() / light - 1.0).abs() < TOLERANCE);
        let place = |i: usize| (i as f64 - 0.5 * (SAMPLES as f64 - 1.0)) * STEP_UM;
        let variance = |angle: f64| {
            let squares = image.indexed_iter().map(|((iy, ix), v)| {
                let along = place(ix) * angle.cos() + place(iy) * angle.sin();
                v * along * along
            });
            squares.sum::<f64>() / light
        };
        let along = std::f64::consts::FRAC_PI_6;
        let across = along + std::f64::consts::FRAC_PI_2;
        for (angle, expected) in [(along, IMAGE_UM.powi(2) + BLUR_UM.powi(2)), (across, IMAGE_UM.powi(2))] {
            assert!(
                (variance(angle) / expected - 1.0).abs() < TOLERANCE,
                "{} {expected}",
                variance(angle)
            );
        }
    }
}
