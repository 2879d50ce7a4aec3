//! Rotated rectangles: what they do to light of both hands.

use std::f64::consts::FRAC_1_SQRT_2;

use num_complex::Complex64;

use super::tables::{Part, there};
use super::{Analyser, FocusedLight, PolarisedLight};
use crate::{Handedness, RotationResponse};

/// Tables of pillars for light of both hands: transmissions as [`CellResponse`] has them, by the number of the
/// rotation. The first of each pair is for light that arrives in the hand that is focused, the second for the other.
///
/// [`CellResponse`]: crate::CellResponse
#[derive(Clone, Debug, PartialEq)]
pub struct CircularTables {
    /// The hand of the light that is focused.
    pub focused: Handedness,
    /// Light that leaves in the other hand than it arrived in.
    pub converted: [Vec<Complex64>; 2],
    /// Light that leaves in the hand that it arrived in.
    pub unconverted: [Vec<Complex64>; 2],
    /// Response at any rotation, of a model of one size of pillars.
    pub rotation: Option<RotationResponse>,
}

impl CircularTables {
    /// Parts of the light that reaches the sensor: those of one list interfere, and no others.
    pub(super) fn leaving<'a>(&'a self, light: PolarisedLight) -> Vec<Vec<Part<'a>>> {
        let mut leaving = Vec::new();
        for [left, right] in light.arriving_at(FocusedLight::Circular(self.focused)).circular_parts() {
            let [own, other] = match self.focused {
                Handedness::Left => [left, right],
                Handedness::Right => [right, left],
            };
            // In the hand that focused light is converted to, and in the other.
            let first = there([(own, &self.converted[0], 1), (other, &self.unconverted[1], 0)]);
            let second = there([(own, &self.unconverted[0], 0), (other, &self.converted[1], -1)]);
            match light.analyser {
                None => leaving.extend([first, second]),
                Some(Analyser::Circular) => leaving.push(first),
                Some(Analyser::Linear(deg)) => {
                    // Along the analyser the field of a hand is this times its amplitude, and the other's its conjugate.
                    let left = Complex64::cis(deg.to_radians()) * FRAC_1_SQRT_2;
                    let [of_first, of_second] = match self.focused {
                        Handedness::Left => [left.conj(), left],
                        Handedness::Right => [left, left.conj()],
                    };
                    let along =
                        |parts: Vec<Part<'a>>, by: Complex64| parts.into_iter().map(move |(a, t, o)| (a * by, t, o));
                    leaving.push(along(first, of_first).chain(along(second, of_second)).collect());
                }
            }
        }
        leaving
    }
}
