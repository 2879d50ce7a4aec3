//! Transmission of one pillar over the band, sampled as finely as its resonances ask for.

use num_complex::Complex64;

use metalith_core::{Result, lagrange_weight};

/// Distance of the first samples (um). Between them t turns by less than an eighth of a turn; every
/// interval is checked in its middle, so none in the end is longer than half of this.
const FIRST_STEP_UM: f64 = 0.004;

/// Shortest interval that is still divided (um): a resonance narrower than this moves less light of any
/// LED than the camera's noise.
const LAST_STEP_UM: f64 = 5e-5;

/// An interval may be this much longer than its neighbour, so that the cubic through both stays tame.
const GRADING: f64 = 2.5;

/// Samples of one width over the band, unevenly spaced.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WidthSpectrum {
    pub wavelengths_um: Vec<f64>,
    pub t: Vec<Complex64>,
}

impl WidthSpectrum {
    /// Sample `t` until in the middle of every interval the cubic through the samples around it was
    /// within `tolerance` before the middle itself was added.
    pub(crate) fn sample(band_um: (f64, f64), tolerance: f64, t: impl Fn(f64) -> Result<Complex64>) -> Result<Self> {
        let (low, high) = band_um;
        let steps = ((high - low) / FIRST_STEP_UM - 1e-6).ceil().max(3.0) as usize;
        let wavelengths_um: Vec<f64> = (0..=steps)
            .map(|i| low + (high - low) * i as f64 / steps as f64)
            .collect();
        let values = wavelengths_um.iter().map(|&l| t(l)).collect::<Result<Vec<_>>>()?;
        let mut column = Self {
            wavelengths_um,
            t: values,
        };
        // Whether the interval before each sample is to be checked; there is none before the first.
        let mut open = vec![true; steps + 1];
        open[0] = false;
        while open.contains(&true) {
            open = column.divide(&open, tolerance, &t)?;
        }
        Ok(column)
    }

    /// Add the middles of all open intervals; the answer is which intervals are open then.
    fn divide(&mut self, open: &[bool], tolerance: f64, t: &impl Fn(f64) -> Result<Complex64>) -> Result<Vec<bool>> {
        let mut next = Self {
            wavelengths_um: Vec::new(),
            t: Vec::new(),
        };
        let mut next_open = Vec::new();
        for (i, &is_open) in open.iter().enumerate() {
            let here = self.wavelengths_um[i];
            let mut still = false;
            if is_open {
                let before = self.wavelengths_um[i - 1];
                let middle = 0.5 * (before + here);
                let value = t(middle)?;
                still = (self.at(middle) - value).norm() > tolerance && 0.5 * (here - before) > LAST_STEP_UM;
                next.wavelengths_um.push(middle);
                next.t.push(value);
                next_open.push(still);
            }
            next.wavelengths_um.push(here);
            next.t.push(self.t[i]);
            next_open.push(still);
        }
        *self = next;
        self.grade(&mut next_open);
        Ok(next_open)
    }

    /// Open intervals that are too long beside their neighbours.
    fn grade(&self, open: &mut [bool]) {
        let length = |i: usize| self.wavelengths_um[i] - self.wavelengths_um[i - 1];
        let last = self.wavelengths_um.len() - 1;
        for (i, open) in open.iter_mut().enumerate().skip(1) {
            let beside = [(i > 1).then(|| length(i - 1)), (i < last).then(|| length(i + 1))];
            let shortest = beside.into_iter().flatten().fold(f64::INFINITY, f64::min);
            if length(i) > GRADING * shortest {
                *open = true;
            }
        }
    }

    /// The cubic through the four samples around a wavelength.
    pub(crate) fn at(&self, wavelength_um: f64) -> Complex64 {
        lagrange(&self.wavelengths_um, |i| self.t[i], wavelength_um)
    }
}

/// The polynomial through the four places around `x`, two on each side where there are; fewer at the ends
/// of short lists. `places` rise.
pub(super) fn lagrange(places: &[f64], value: impl Fn(usize) -> Complex64, x: f64) -> Complex64 {
    let count = places.len().min(4);
    let after = places.partition_point(|&p| p <= x);
    let first = after.saturating_sub(2).min(places.len() - count);
    let near = &places[first..first + count];
    let mut sum = Complex64::ZERO;
    for (i, &place) in near.iter().enumerate() {
        let others = near.iter().enumerate().filter(|(j, _)| *j != i);
        sum += value(first + i) * lagrange_weight(x, place, others.map(|(_, other)| *other));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial of numbers below a hundred in double precision.
    const ROUNDING: f64 = 1e-12;

    /// A slow phase with a Fano resonance 0.5 nm wide.
    fn resonant(wavelength_um: f64) -> Complex64 {
        let detuning = (wavelength_um - 0.5173) / 2.5e-4;
        Complex64::cis(20.0 / wavelength_um) * (detuning / Complex64::new(detuning, 1.0))
    }

    #[test]
    fn a_narrow_resonance_near_a_sample_is_followed() {
        let tolerance = 0.01;
        let column = WidthSpectrum::sample((0.4, 0.7), tolerance, |l| Ok(resonant(l))).unwrap();
        assert!(column.t.len() < 300, "{}", column.t.len());
        let worst = (0..30_000)
            .map(|i| 0.4 + 1e-5 * f64::from(i))
            .map(|l| (column.at(l) - resonant(l)).norm())
            .fold(0.0, f64::max);
        // Each interval is half of one that was within the tolerance in its middle.
        assert!(worst < 2.0 * tolerance, "{worst}");
    }

    #[test]
    fn cubics_are_reproduced() {
        let places = [0.0, 1.0, 1.5, 4.0, 4.5];
        let cubic = |x: f64| Complex64::new(x * x * x - 2.0 * x, 3.0 - x * x);
        for x in [-0.5, 0.3, 1.2, 4.4, 4.5] {
            let got = lagrange(&places, |i| cubic(places[i]), x);
            assert!((got - cubic(x)).norm() < ROUNDING);
        }
        assert_eq!(lagrange(&[2.0], |_| Complex64::I, 7.0), Complex64::I);
    }
}
