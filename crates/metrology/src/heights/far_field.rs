//! Far field of a relief: the intensity that a plane wave has behind it.

use ndarray::ArrayView2;
use num_complex::Complex64;

use super::fft::Fft2;

/// Light on a relief, and the orders that are compared.
#[derive(Clone, Copy, Debug)]
pub struct FarField {
    pub wavelength_nm: f64,
    /// Index of the relief less that of the medium.
    pub index_difference: f64,
    /// Orders on either side of the axis.
    pub orders: usize,
}

/// Transforms for maps of one size.
pub(super) struct FarFieldPlan {
    light: FarField,
    fft: Fft2<f64>,
}

impl FarFieldPlan {
    pub(super) fn new(light: FarField, rows: usize, cols: usize) -> Self {
        Self {
            light,
            fft: Fft2::new(rows, cols, false),
        }
    }

    /// Intensities of the orders about the axis behind a map of heights (nm), under a Hann window.
    pub(super) fn intensities(&self, heights: ArrayView2<'_, f64>) -> Vec<f64> {
        let (rows, cols) = heights.dim();
        let hann = |i: usize, n: usize| 0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / (n - 1) as f64).cos();
        let waves_per_nm = self.light.index_difference / self.light.wavelength_nm;
        let field = heights
            .indexed_iter()
            .map(|((y, x), h)| {
                let phase = std::f64::consts::TAU * waves_per_nm * h;
                Complex64::from_polar(hann(y, rows) * hann(x, cols), phase)
            })
            .collect();
        let spectrum = self.fft.transposed(field);
        let n = self.light.orders as isize;
        let orders = |size: usize| (-n..=n).map(move |k| k.rem_euclid(size as isize) as usize);
        let at = orders(cols).flat_map(|x| orders(rows).map(move |y| x * rows + y));
        at.map(|k| spectrum[k].norm_sqr()).collect()
    }
}

/// Error of intensities relative to others: norm of the difference over the norm.
pub(super) fn relative_error(of: &[f64], reference: &[f64]) -> f64 {
    let difference: f64 = of.iter().zip(reference).map(|(a, b)| (a - b).powi(2)).sum();
    let whole: f64 = reference.iter().map(|b| b * b).sum();
    (difference / whole.max(f64::MIN_POSITIVE)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// A weak sinusoidal phase grating of amplitude a has J1(a)^2 of the light in each first order.
    #[test]
    fn a_sinusoidal_grating_has_the_orders_of_its_bessel_functions() {
        let light = FarField {
            wavelength_nm: 600.0,
            index_difference: 0.5,
            orders: 12,
        };
        let amplitude_nm = 0.4 * 600.0 / (std::f64::consts::TAU * 0.5);
        let n = 64;
        let wave = |x: usize| (std::f64::consts::TAU * 8.0 * x as f64 / n as f64).sin();
        let map = Array2::from_shape_fn((n, n), |(_, x)| amplitude_nm * wave(x));
        let found = FarFieldPlan::new(light, n, n).intensities(map.view());
        let at = |x: isize| found[((x + 12) * 25 + 12) as usize];
        let [j0, j1] = [0.960_398_226_7, 0.196_026_578];
        let ratio = (at(8) / at(0)).sqrt();
        // The window is that of n - 1 samples, the period of the grating n: orders differ by their tails.
        assert!((ratio - j1 / j0).abs() < 1e-3, "{ratio}");
        assert!((at(-8) / at(8) - 1.0).abs() < 0.02);
    }
}
