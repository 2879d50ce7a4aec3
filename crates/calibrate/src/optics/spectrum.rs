//! Quadrature over the spectrum of an LED.

use crate::set::Led;

/// Equidistant wavelengths over a Gaussian: for smooth integrands this sum converges faster than any power
/// of its step.
#[derive(Clone, Debug)]
pub struct Quadrature {
    /// Wavelengths (nm).
    pub wavelengths_nm: Vec<f64>,
    led: Led,
}

/// Half range in standard deviations, with margin for an LED that is shifted or wider than stated.
const REACH_SIGMAS: f64 = 3.6;

impl Quadrature {
    /// Wavelengths not more than `step_nm` apart, within `range_nm`.
    pub fn new(led: Led, step_nm: f64, range_nm: (f64, f64)) -> Self {
        let reach = REACH_SIGMAS * led.sigma_nm();
        let half = (reach / step_nm).ceil();
        let step = reach / half;
        let wavelengths_nm = (0..=2 * half as usize)
            .map(|k| led.centre_nm + (k as f64 - half) * step)
            .filter(|l| (range_nm.0..=range_nm.1).contains(l))
            .collect();
        Self { wavelengths_nm, led }
    }

    /// Weights, with a sum of one, of an LED whose centre is shifted by `shift_nm` and whose width is scaled.
    pub fn weights(&self, shift_nm: f64, width: f64) -> Vec<f64> {
        let sigma = self.led.sigma_nm() * width;
        let raw: Vec<f64> = self
            .wavelengths_nm
            .iter()
            .map(|l| (-0.5 * ((l - self.led.centre_nm - shift_nm) / sigma).powi(2)).exp())
            .collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|w| w / sum).collect()
    }
}
