//! The rotation that a phase asks for, fitted to the rigorous cell.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use serde::Serialize;

use super::MappingError;
use crate::{Handedness, RotationMapping, RotationResponse};

/// Phases over half a turn, after which what a lattice adds repeats, that a series is fitted to: four times as many as the
/// fastest term of [`RotatedCell`](crate::RotatedCell) has.
const PHASES: usize = 48;

/// Rounds of an equation whose error shrinks by what the lattice adds for a radian of phase, some hundredths, in each.
const ROUNDS: usize = 40;

/// Phase of converted light over rotation, for light that arrives left circularly polarised: that of the other handedness over
/// the opposite rotation.
#[derive(Debug)]
pub struct RotationCurve {
    response: RotationResponse,
    /// Phase of all rotations together (rad): what the lattice adds is counted from it.
    mean: f64,
}

/// A mapping of phase to rotation with what it leaves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RotationFit {
    pub mapping: RotationMapping,
    /// Phase of pillars as drawn against the phase that the mapping has them for.
    pub error: MappingError,
}

impl RotationCurve {
    /// The curve of a cell at a wavelength.
    pub fn new(response: RotationResponse) -> Self {
        let mut curve = Self { response, mean: 0.0 };
        let sum = (0..PHASES).map(|k| curve.beyond(PI / 2.0 * k as f64 / PHASES as f64));
        curve.mean = sum.sum::<Complex64>().arg();
        curve
    }

    /// A rotation (rad) as light of the handedness that arrives has it.
    fn seen(&self, rotation: f64) -> f64 {
        match self.response.arriving() {
            Handedness::Left => rotation,
            Handedness::Right => -rotation,
        }
    }

    /// Amplitude of converted light with twice the rotation taken off its phase.
    fn beyond(&self, rotation: f64) -> Complex64 {
        let [converted, _] = self.response.at(self.seen(rotation));
        converted * Complex64::cis(-2.0 * rotation)
    }

    /// Phase that the lattice adds to twice a rotation (rad).
    pub fn added(&self, rotation: f64) -> f64 {
        (self.beyond(rotation) * Complex64::cis(-self.mean)).arg()
    }

    /// Rotation (rad) whose phase is this one (rad) and a constant.
    fn rotation(&self, phase: f64, constant: f64) -> f64 {
        (0..ROUNDS).fold(0.5 * phase, |rotation, _| {
            0.5 * (phase + constant - self.added(rotation))
        })
    }

    /// The series of so many terms that takes back what the lattice adds, with what it leaves of the pillars as drawn.
    pub fn fit(&self, terms: usize) -> RotationFit {
        let phases = (0..PHASES).map(|k| PI * k as f64 / PHASES as f64);
        let off = |constant: f64| -> Vec<f64> {
            let each = phases.clone().map(|phase| self.rotation(phase, constant) - 0.5 * phase);
            each.collect()
        };
        // The constant is free: that which leaves no mean.
        let mut constant = 0.0;
        let mut left = off(constant);
        for _ in 0..ROUNDS {
            constant -= 2.0 * left.iter().sum::<f64>() / PHASES as f64;
            left = off(constant);
        }
        let coefficient = |k: usize, wave: fn(f64) -> f64| -> f64 {
            let each = phases.clone().zip(&left);
            let sum: f64 = each.map(|(phase, off)| off * wave(2.0 * k as f64 * phase)).sum();
            2.0 * sum / PHASES as f64
        };
        let mapping = RotationMapping {
            sines: (1..=terms).map(|k| coefficient(k, f64::sin)).collect(),
            cosines: (1..=terms).map(|k| coefficient(k, f64::cos)).collect(),
        };
        let error = self.error(&mapping);
        RotationFit { mapping, error }
    }

    /// Phase of pillars as drawn, all numbers, against the phase that a mapping has them for; their mean is taken off. What a site
    /// is rounded to a number by is not in it.
    pub fn error(&self, mapping: &RotationMapping) -> MappingError {
        let pillars = self.response.pillars();
        let turns: Vec<f64> = (1..=pillars.steps)
            .map(|number| {
                let rotation = self.seen(pillars.drawn_rotation(number));
                let own = 2.0 * rotation + self.added(rotation);
                (own - mapping.phase(rotation)) / TAU
            })
            .collect();
        MappingError::of_turns(turns.into_iter())
    }
}

impl RotationMapping {
    /// The phase (rad) that asks for a rotation (rad).
    pub fn phase(&self, rotation: f64) -> f64 {
        (0..ROUNDS).fold(2.0 * rotation, |phase, _| 2.0 * (rotation - self.added(phase)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RotatedCell;
    use crate::rotated::jones::tests::{PILLARS, titania};

    /// Residual of the phase (rad): 0.004 by the harmonics beyond the second, and rounding. Without the series it is
    /// 0.014.
    const LEFT: f64 = 0.005;

    #[test]
    fn a_phase_and_the_rotation_that_it_asks_for_are_one_another() {
        let mapping = RotationMapping {
            sines: vec![0.01, -0.004],
            cosines: vec![0.02],
        };
        for k in 0..60 {
            let phase = 0.1 * f64::from(k);
            let rotation = 0.5 * phase + mapping.added(phase);
            // Rounding of a few sums of numbers below ten.
            assert!((mapping.phase(rotation) - phase).abs() < 1e-12);
        }
        assert!(RotationMapping::default().is_half() && !mapping.is_half());
    }

    #[test]
    fn a_series_takes_back_what_the_lattice_adds() {
        let fits = [Handedness::Left, Handedness::Right].map(|arriving| {
            let cell = RotatedCell::new(titania(), PILLARS, arriving);
            let curve = RotationCurve::new(cell.at(0.532).unwrap());
            let half = curve.error(&RotationMapping::default());
            let fit = curve.fit(2);
            println!("{half:?} {fit:?}");
            assert!(fit.error.worst_rad < LEFT && fit.error.worst_rad < 0.5 * half.worst_rad);
            fit.mapping
        });
        // A mirror takes one handedness to the other.
        for (a, b) in fits[0].sines.iter().zip(&fits[1].sines) {
            assert!((a - b).abs() < 1e-9, "{fits:?}");
        }
    }
}
