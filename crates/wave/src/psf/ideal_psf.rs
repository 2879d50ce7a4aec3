//! Reference: the best possible element of the same shape.

use num_complex::Complex32;

use crate::Aperture;

/// Ideal PSF: the same aperture passing all its power in the zeroth order with the perfect phase. Strehl ratios and
/// shares of energy are relative to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdealPsf {
    /// |E|^2 / |E_inc|^2 where all sites arrive in phase.
    pub peak: f64,
    /// |E|^2 / |E_inc|^2 behind the aperture, summed over its area (um^2).
    pub power_um2: f64,
}

impl IdealPsf {
    /// Ideal PSF for the sites of `aperture` that pass anything, each with |t| = `full_transmission`, in focus at
    /// `focus_um`, x, y and z from the element's centre.
    ///
    /// In phase, moduli add: the Rayleigh-Sommerfeld sum of A Z / (2 pi R^2) |1/R - i k|, with A the area of the cell of a site.
    pub fn of(aperture: &dyn Aperture, focus_um: [f64; 3], wavelength_um: f64, full_transmission: f64) -> Self {
        let lattice = aperture.lattice();
        let n = lattice.sites();
        let [px, py, z] = focus_um;
        let k = std::f64::consts::TAU / wavelength_um;
        let x2: Vec<f64> = (0..n).map(|i| (lattice.place_um(0, i) - px).powi(2)).collect();
        let mut row = vec![Complex32::ZERO; n];
        let (mut sum, mut sites) = (0.0, 0u64);
        let [_, rows] = lattice.reach();
        for iy in rows {
            aperture.fill_row(iy, &mut row);
            let rest = (lattice.place_um(1, iy) - py).powi(2) + z * z;
            let mut line = 0.0;
            for (_, x2) in row.iter().zip(&x2).filter(|(t, _)| **t != Complex32::ZERO) {
                let r2 = x2 + rest;
                line += (k * k + 1.0 / r2).sqrt() / r2;
                sites += 1;
            }
            sum += line;
        }
        let site_um2 = lattice.cell_um2();
        let amplitude = full_transmission * site_um2 * z / std::f64::consts::TAU * sum;
        Self {
            peak: amplitude * amplitude,
            power_um2: full_transmission * full_transmission * site_um2 * sites as f64,
        }
    }

    /// Same PSF with sites of another modulus, in place of one.
    #[must_use]
    pub fn scaled(&self, full_transmission: f64) -> Self {
        let power = full_transmission * full_transmission;
        Self {
            peak: self.peak * power,
            power_um2: self.power_um2 * power,
        }
    }
}
