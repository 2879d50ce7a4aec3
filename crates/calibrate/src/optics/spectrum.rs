//! Quadrature over the spectrum of an LED.

use crate::set::BenchLed;
use metalith_optics::LightChange;

/// Equidistant wavelengths over a Gaussian: for smooth integrands this sum converges faster than any power
/// of its step.
#[derive(Clone, Debug)]
pub(crate) struct Quadrature {
    /// Wavelengths (nm).
    pub wavelengths_nm: Vec<f64>,
    led: BenchLed,
}

/// Half range in standard deviations, with margin for an LED that is shifted or wider than stated.
const REACH_SIGMAS: f64 = 3.6;

/// And for one so narrow that a shift of some nanometres is much of its width: a range in standard deviations, and in nanometres
/// beyond it.
const REACH_OF_NARROW: (f64, f64) = (2.8, 6.0);

/// Largest number of standard deviations, whatever the line: work goes with their number.
const MOST_SIGMAS: f64 = 5.2;

impl Quadrature {
    /// Wavelengths not more than `step_nm` apart, within `range_nm`.
    pub(crate) fn new(led: BenchLed, step_nm: f64, range_nm: (f64, f64)) -> Self {
        let (sigmas, beyond_nm) = REACH_OF_NARROW;
        let sigma_nm = led.sigma_nm();
        let reach = (REACH_SIGMAS * sigma_nm)
            .max(sigmas * sigma_nm + beyond_nm)
            .min(MOST_SIGMAS * sigma_nm);
        let half = (reach / step_nm).ceil();
        let step = reach / half;
        let wavelengths_nm = (0..=2 * half as usize)
            .map(|k| led.centre_nm + (k as f64 - half) * step)
            .filter(|l| (range_nm.0..=range_nm.1).contains(l))
            .collect();
        Self { wavelengths_nm, led }
    }

    /// Weights, with a sum of one, of this LED, the `led`-th of its set, where lamps are changed: shifted, scaled in
    /// width, and as declared; of wavelengths `every` so many, and zero between them.
    pub(crate) fn weights(&self, led: usize, change: &LightChange, every: usize) -> Vec<f64> {
        let (sigma, centre) = (self.led.sigma_nm() * (1.0 + change.led_width), self.led.centre_nm);
        let gaussian = |l: &f64| (-0.5 * ((l - centre - change.shift_nm(led)) / sigma).powi(2)).exp();
        let raw: Vec<f64> = self
            .wavelengths_nm
            .iter()
            .enumerate()
            .map(|(k, l)| {
                if k.is_multiple_of(every) {
                    gaussian(l) * change.spectral_factor(*l, centre)
                } else {
                    0.0
                }
            })
            .collect();
        let sum = raw.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        raw.iter().map(|w| w / sum).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lamp of 6 nm that is 5 nm off: its middle is where it is said to be.
    #[test]
    fn a_narrow_lamp_that_is_shifted_is_not_cut() {
        /// Error of the mean (nm): what a Gaussian has beyond 3 of its standard deviations on one side.
        const CUT_NM: f64 = 0.02;
        let led = BenchLed {
            centre_nm: 530.0,
            fwhm_nm: 6.0,
            channel: None,
        };
        let quadrature = Quadrature::new(led, 1.0, (400.0, 700.0));
        let change = LightChange {
            led_shift_nm: vec![5.0],
            ..LightChange::default()
        };
        let weights = quadrature.weights(0, &change, 1);
        let mean: f64 = quadrature.wavelengths_nm.iter().zip(&weights).map(|(l, w)| l * w).sum();
        assert!((mean - 535.0).abs() < CUT_NM, "{mean}");
    }
}
