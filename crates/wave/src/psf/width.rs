//! Width of a PSF, and the power near its peak.

use metalith_fourier::{forward, inverse};
use num_complex::Complex64;

use super::Psf;

/// Points of a line for each sample: the PSF is band-limited, and the series through its samples is exact between them. Straight
/// lines between points this near are 1e-3 of the width of the narrowest PSF off.
const FINER: usize = 16;

/// Diameter of the circle that counts as the focus, in full widths at half maximum: the definition of papers on metalenses.
pub const FOCUS_FWHM: f64 = 3.0;

/// Full width at half maximum of the ideal PSF of a round aperture, in units of the wavelength over the numerical aperture.
pub const AIRY_FWHM: f64 = 0.514_5;

impl Psf {
    /// Full width at half maximum along x and y through the brightest sample (um); none if the window does not hold both sides.
    pub fn fwhm_um(&self) -> [Option<f64>; 2] {
        let (_, peak_um) = self.peak();
        [0, 1].map(|axis| {
            let across = self.window.sample_at(1 - axis, peak_um[1 - axis]);
            let line: Vec<f64> = match axis {
                0 => self.values.row(across).to_vec(),
                _ => self.values.column(across).to_vec(),
            };
            width(&finer(&line)).map(|points| points * self.window.step_um / FINER as f64)
        })
    }

    /// Power in a circle (um^2), in units of |E_inc|^2: in as much of it as the window holds. Each sample counts by the share of its
    /// step that the chord of its row covers.
    pub fn power_in_circle_um2(&self, centre_um: [f64; 2], diameter_um: f64) -> f64 {
        let (step_um, radius_um) = (self.window.step_um, 0.5 * diameter_um);
        let of_row = |iy: usize| {
            let away_um = self.window.coordinate_um(1, iy) - centre_um[1];
            if away_um.abs() >= radius_um {
                return 0.0;
            }
            let half_um = (radius_um * radius_um - away_um * away_um).sqrt();
            let covered = |ix: usize| {
                let from_um = (self.window.coordinate_um(0, ix) - centre_um[0]).abs();
                ((half_um - from_um) / step_um + 0.5).clamp(0.0, 1.0)
            };
            let row = self.values.row(iy);
            row.iter().enumerate().map(|(ix, v)| v * covered(ix)).sum::<f64>()
        };
        (0..self.window.samples).map(of_row).sum::<f64>() * step_um * step_um
    }
}

/// The finite Fourier series through samples, at [`FINER`] points for each.
fn finer(line: &[f64]) -> Vec<f64> {
    let (n, m) = (line.len(), FINER * line.len());
    let mut terms: Vec<Complex64> = line.iter().map(|&v| Complex64::new(v, 0.0)).collect();
    forward(n).process(&mut terms);
    let mut padded = vec![Complex64::ZERO; m];
    for (k, term) in terms.into_iter().enumerate() {
        match 2 * k {
            twice if twice < n => padded[k] = term,
            // The highest frequency of an even number of samples has no sign.
            twice if twice == n => {
                padded[k] += 0.5 * term;
                padded[m - k] += 0.5 * term;
            }
            _ => padded[m - n + k] = term,
        }
    }
    inverse(m).process(&mut padded);
    padded.into_iter().map(|v| v.re / n as f64).collect()
}

/// Distance of the two places about the largest point where a line falls to half of that (points).
fn width(points: &[f64]) -> Option<f64> {
    let (top, most) = points.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let half = 0.5 * most;
    let crossing = |inner: f64, outer: f64| (inner - half) / (inner - outer);
    let right = (top + 1..points.len())
        .find(|&i| points[i] < half)
        .map(|i| (i - 1 - top) as f64 + crossing(points[i - 1], points[i]))?;
    let left = (0..top)
        .rev()
        .find(|&i| points[i] < half)
        .map(|i| (top - i - 1) as f64 + crossing(points[i + 1], points[i]))?;
    Some(left + right)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{AT, SIGMA, gaussian};

    /// Straight lines between points, and the place of the brightest sample off the middle of the Gaussian.
    const TOLERANCE: f64 = 2e-3;

    #[test]
    fn a_gaussian_has_the_width_and_the_power_of_the_closed_form() {
        let psf = gaussian(SIGMA, AT);
        let fwhm = SIGMA * (8.0 * 2f64.ln()).sqrt();
        for found in psf.fwhm_um() {
            assert!((found.unwrap() / fwhm - 1.0).abs() < TOLERANCE, "{found:?} {fwhm}");
        }
        // Within the radius r a Gaussian has 1 - exp(-r^2 / (2 sigma^2)) of its power.
        let total = std::f64::consts::TAU * SIGMA * SIGMA;
        let radius = 1.5 * fwhm;
        let within = 1.0 - (-0.5 * (radius / SIGMA).powi(2)).exp();
        let found = psf.power_in_circle_um2(AT, 2.0 * radius) / total;
        assert!((found - within).abs() < TOLERANCE, "{found} {within}");
    }

    #[test]
    fn a_width_that_the_window_does_not_hold_is_none() {
        let psf = gaussian(20.0, AT);
        assert_eq!(psf.fwhm_um(), [None, None]);
    }
}
