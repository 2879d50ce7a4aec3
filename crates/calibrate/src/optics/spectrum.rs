//! Quadrature over the spectrum of an LED.

use crate::set::Led;
use metalith_made::LightChange;

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

    /// Weights, with a sum of one, of this LED, the `led`-th of its set, where lamps are changed: shifted, scaled in
    /// width, and as declared.
    pub fn weights(&self, led: usize, change: &LightChange) -> Vec<f64> {
        let (sigma, centre) = (self.led.sigma_nm() * (1.0 + change.led_width), self.led.centre_nm);
        let gaussian = |l: &f64| (-0.5 * ((l - centre - change.shift_nm(led)) / sigma).powi(2)).exp();
        let raw: Vec<f64> = self
            .wavelengths_nm
            .iter()
            .map(|l| gaussian(l) * change.spectral_factor(*l, centre))
            .collect();
        let sum = raw.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        raw.iter().map(|w| w / sum).collect()
    }
}
