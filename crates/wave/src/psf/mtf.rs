//! Contrast of a point spread function at a frequency.

use num_complex::Complex64;

use super::Psf;
use crate::kernels::sinc;

/// Frequencies at which contrast on pixels of one size is stated. All are to three significant digits, as they are
/// written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFrequencies {
    /// Edge of a pixel (um).
    pixel_um: f64,
    /// The finest frequency that the pixels can tell, one line pair on two of them (line pairs a millimetre).
    pub nyquist_lp_mm: f64,
    /// Half of it (line pairs a millimetre).
    pub half_nyquist_lp_mm: f64,
}

/// Pixels whose curves are drawn at round frequencies, and those beside the two that are reported (line pairs a millimetre).
const ROUND_UM: f64 = 5.86;
const ROUND_LP_MM: [f64; 4] = [5.0, 20.0, 63.0, 110.0];

impl PixelFrequencies {
    /// Frequencies of pixels with this edge (um), which is positive.
    pub fn of(pixel_um: f64) -> Self {
        let nyquist = 500.0 / pixel_um;
        Self {
            pixel_um,
            nyquist_lp_mm: three_digits(nyquist),
            half_nyquist_lp_mm: three_digits(0.5 * nyquist),
        }
    }

    /// Frequencies at which contrast is reported (line pairs a millimetre): half of the finest frequency, and all of
    /// it.
    pub fn reported(&self) -> [f64; 2] {
        [self.half_nyquist_lp_mm, self.nyquist_lp_mm]
    }

    /// Frequencies at which contrast is drawn (line pairs a millimetre), rising: few, since each costs two correlations
    /// of the spectrum along each axis.
    pub fn drawn(&self) -> [f64; 6] {
        let [first, second, third, last] = ROUND_LP_MM.map(|f| three_digits(f * ROUND_UM / self.pixel_um));
        let [half, nyquist] = self.reported();
        [first, second, half, third, nyquist, last]
    }
}

fn three_digits(x: f64) -> f64 {
    format!("{x:.2e}").parse().expect("a number as it was just written")
}

impl Psf {
    /// Contrast along one axis (0 is x) at a frequency (line pairs a millimetre), without the pixel: of all the light
    /// that the element passes where the PSF knows it ([`Psf::otf`] at that very frequency), else of the window's.
    pub fn contrast(&self, axis: usize, lp_mm: f64) -> f64 {
        let whole = self.otf.as_ref().and_then(|otf| {
            let place = otf.lp_mm.iter().position(|f| *f == lp_mm)?;
            Some(otf.contrast(place)[axis])
        });
        whole.unwrap_or_else(|| self.mtf_curve(axis, &[lp_mm])[0])
    }

    /// Optical transfer function of the window's light at a frequency along x and y (line pairs a millimetre), one at zero frequency; the
    /// phase counts from the window's middle. What lies outside the window is left out.
    pub fn window_otf(&self, lp_mm: [f64; 2]) -> Complex64 {
        let [x, y] = [0, 1].map(|axis| self.phasors(lp_mm[axis]));
        let rows = self.values.rows().into_iter().zip(&y);
        let sum: Complex64 = rows
            .map(|(row, y)| y * row.iter().zip(&x).map(|(v, x)| x * v).sum::<Complex64>())
            .sum();
        sum / self.values.sum()
    }

    /// Contrast at a frequency along x and y (line pairs a millimetre), without the pixel: see [`pixel_mtf`].
    pub fn mtf(&self, lp_mm: [f64; 2]) -> f64 {
        self.window_otf(lp_mm).norm()
    }

    /// Contrast along one axis (0 is x) at many frequencies (line pairs a millimetre).
    pub fn mtf_curve(&self, axis: usize, lp_mm: &[f64]) -> Vec<f64> {
        let line = self.line_spread(axis);
        let total: f64 = line.iter().sum();
        let contrast = |f: &f64| {
            let sum: Complex64 = line.iter().zip(self.phasors(*f)).map(|(v, p)| p * v).sum();
            sum.norm() / total
        };
        lp_mm.iter().map(contrast).collect()
    }

    fn phasors(&self, lp_mm: f64) -> Vec<Complex64> {
        let middle = 0.5 * (self.window.samples as f64 - 1.0);
        let step = std::f64::consts::TAU * 1e-3 * lp_mm * self.window.step_um;
        let phasor = |i: usize| Complex64::cis(-step * (i as f64 - middle));
        (0..self.window.samples).map(phasor).collect()
    }
}

/// Contrast that is left by a square pixel at a frequency along its edge (line pairs a millimetre).
pub fn pixel_mtf(pixel_um: f64, lp_mm: f64) -> f64 {
    sinc(pixel_um * lp_mm * 1e-3).abs()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{BAND, gaussian};
    use super::*;

    #[test]
    fn contrast_of_a_gaussian_is_a_gaussian() {
        let sigma = 1.4;
        let psf = gaussian(sigma, [100.3, -41.2]);
        for f in [0.0, 42.7, 85.3, 150.0] {
            let want = (-2.0 * (std::f64::consts::PI * sigma * f * 1e-3).powi(2)).exp();
            assert!((psf.mtf([f, 0.0]) - want).abs() < BAND);
            assert!((psf.mtf([0.6 * f, 0.8 * f]) - want).abs() < BAND);
            for axis in 0..2 {
                assert!((psf.mtf_curve(axis, &[f])[0] - want).abs() < BAND);
            }
        }
        // Displaced to higher x, the phase falls with frequency.
        assert!(psf.window_otf([10.0, 0.0]).arg() < 0.0 && psf.window_otf([0.0, 10.0]).arg() > 0.0);
    }

    #[test]
    fn frequencies_are_those_of_the_pixel() {
        /// Three digits are off by half a hundredth at most.
        const THREE_DIGITS: f64 = 5e-3;
        let known = PixelFrequencies::of(5.86);
        assert_eq!(known.reported(), [42.7, 85.3]);
        assert_eq!(known.drawn(), [5.0, 20.0, 42.7, 63.0, 85.3, 110.0]);
        for pixel_um in [0.1, 0.7235, 1.4, 2.2, 12.0, 100.0] {
            let own = PixelFrequencies::of(pixel_um);
            assert!((pixel_mtf(pixel_um, own.nyquist_lp_mm) - std::f64::consts::FRAC_2_PI).abs() < THREE_DIGITS);
            assert!((own.half_nyquist_lp_mm / own.nyquist_lp_mm - 0.5).abs() < THREE_DIGITS);
            assert!(own.drawn().windows(2).all(|pair| pair[0] < pair[1]), "{own:?}");
        }
    }

    #[test]
    fn a_pixel_leaves_two_over_pi_at_its_nyquist_frequency() {
        const ROUNDING: f64 = 1e-12;
        assert!((pixel_mtf(5.86, 500.0 / 5.86) - std::f64::consts::FRAC_2_PI).abs() < ROUNDING);
        assert!(pixel_mtf(5.86, 1000.0 / 5.86) < ROUNDING);
    }
}
