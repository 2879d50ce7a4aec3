//! Effect of the camera of a perturbation on a PSF: declared kernels, a Gaussian blur, and stray light.

mod kernels;

use ndarray::Array2;
use num_complex::Complex64;

pub use kernels::KernelFilter;

use super::CameraChange;
use super::declared::compiled;
use metalith_wave::Psf;

impl CameraChange {
    /// Filter of the declared kernels for images of `rows` x `cols` samples `step_um` apart; `None` where none is
    /// declared.
    pub fn kernels(&self, shape: (usize, usize), step_um: f64) -> Option<KernelFilter> {
        self.kernels_on_places(shape, step_um, 0.0)
    }

    /// The same with the places at which kernels are evaluated moved by `moved` of the distance between two: what this changes, they
    /// do not resolve.
    pub fn kernels_on_places(&self, (rows, cols): (usize, usize), step_um: f64, moved: f64) -> Option<KernelFilter> {
        let terms = compiled(&self.declared, |_| true);
        (!terms.is_empty()).then(|| KernelFilter::new(&terms, [rows, cols], step_um, moved))
    }

    /// Blur a PSF and spread the stray share of its light evenly over its window. The energy in the window stays.
    pub fn apply(&self, psf: &mut Psf) {
        if let Some(kernels) = self.kernels(psf.values.dim(), psf.window.step_um) {
            kernels.apply(&mut psf.values);
            // A kernel of any shape has no transfer along a line that its window's samples would not show better.
            psf.otf = None;
        }
        if self.pixel_blur_um > 0.0 {
            blur(&mut psf.values, self.pixel_blur_um / psf.window.step_um);
        }
        if self.stray_light > 0.0 {
            let mean = psf.values.mean().unwrap_or(0.0);
            psf.values.mapv_inplace(|v| veiled(v, mean, self.stray_light));
        }
        if let Some(otf) = &mut psf.otf {
            // A veil has no contrast at the frequencies of interest; a blur takes its share of each.
            let sigma = self.pixel_blur_um;
            otf.scale(|lp_mm| {
                let blurred = (-2.0 * (std::f64::consts::PI * sigma * lp_mm * 1e-3).powi(2)).exp();
                (1.0 - self.stray_light) * blurred
            });
        }
    }
}

/// Intensity where the share `stray` of a window's light, of this mean, is spread evenly over it.
pub fn veiled(value: f64, mean: f64, stray: f64) -> f64 {
    value + stray * (mean - value)
}

/// Convolve with a Gaussian of `sigma` samples, the image mirrored at its border: the spectrum of an image and its
/// mirror is multiplied with exp(-2 (pi sigma f)^2), which is exact for an image that its samples hold.
pub fn blur(values: &mut Array2<f64>, sigma: f64) {
    for _ in 0..2 {
        blur_rows(values, sigma);
        *values = values.t().as_standard_layout().into_owned();
    }
}

fn blur_rows(values: &mut Array2<f64>, sigma: f64) {
    let n = values.ncols();
    let (forward, inverse) = (
        metalith_fourier::forward::<f64>(2 * n),
        metalith_fourier::inverse::<f64>(2 * n),
    );
    let factor: Vec<f64> = (0..2 * n)
        .map(|k| {
            let frequency = k.min(2 * n - k) as f64 / (2 * n) as f64;
            (-2.0 * (std::f64::consts::PI * sigma * frequency).powi(2)).exp() / (2 * n) as f64
        })
        .collect();
    let mut line = vec![Complex64::ZERO; 2 * n];
    for mut row in values.rows_mut() {
        for (i, v) in row.iter().enumerate() {
            line[i] = Complex64::from(*v);
            line[2 * n - 1 - i] = Complex64::from(*v);
        }
        forward.process(&mut line);
        line.iter_mut().zip(&factor).for_each(|(z, f)| *z *= f);
        inverse.process(&mut line);
        row.iter_mut().zip(&line).for_each(|(v, z)| *v = z.re);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_wave::Window;

    fn gaussian(sigma: f64) -> Psf {
        let window = Window {
            centre_um: [3.0, -2.0],
            step_um: 0.5,
            samples: 64,
            distance_um: 100.0,
        };
        let at = |axis: usize, i: usize| window.coordinate_um(axis, i) - [3.4, -2.7][axis];
        let value = |(iy, ix)| {
            let r2: f64 = at(0, ix).powi(2) + at(1, iy).powi(2);
            (-r2 / (2.0 * sigma * sigma)).exp() / (sigma * sigma)
        };
        Psf {
            window,
            values: Array2::from_shape_fn((64, 64), value),
            otf: None,
        }
    }

    #[test]
    fn a_blurred_gaussian_is_one_of_the_summed_variance() {
        let mut psf = gaussian(1.2);
        let change = CameraChange {
            pixel_blur_um: 0.9,
            ..CameraChange::default()
        };
        change.apply(&mut psf);
        let want = gaussian(1.5);
        // The spectrum of the Gaussian at half the sampling rate, exp(-2 (pi 1.2)^2), is below this.
        const ALIASED: f64 = 1e-10;
        let worst = psf.values.iter().zip(&want.values).map(|(a, b)| (a - b).abs());
        assert!(worst.fold(0.0, f64::max) < ALIASED);
    }

    #[test]
    fn a_veil_keeps_the_energy_and_takes_its_share_of_contrast() {
        let plain = gaussian(1.2);
        let mut psf = plain.clone();
        let change = CameraChange {
            stray_light: 0.25,
            ..CameraChange::default()
        };
        change.apply(&mut psf);
        // Sums of four thousand numbers in double precision.
        const ROUNDING: f64 = 1e-12;
        assert!((psf.energy_um2() / plain.energy_um2() - 1.0).abs() < ROUNDING);
        // A frequency of the window's own grid, where an even veil has nothing.
        let frequency = 1e3 * 4.0 / (64.0 * 0.5);
        let [a, b] = [&psf, &plain].map(|p| p.mtf_curve(0, &[frequency])[0]);
        // The ratio of two sums over all samples, each with its own rounding.
        const RATIO: f64 = 1e-9;
        assert!((a / b - 0.75).abs() < RATIO, "{a} {b}");
    }
}
