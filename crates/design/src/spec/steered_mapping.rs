//! `[[mapping.steered]]`: mappings of elements by how many steps they are from the middle of the array.

use serde::{Serialize, Serializer};

use super::mapping::{COEFFICIENT, check_widths};
use super::{ArraySpec, CellSpec};
use metalith_cell::InversePolynomial;
use metalith_core::document::{Limits, Section};

/// Steps of an element from the middle of the grid along the two axes, the larger first: what it is steered by. Along an axis
/// with an even number of elements they are odd multiples of a half.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct SteeringSteps(pub f64, pub f64);

impl SteeringSteps {
    /// Steering of an element that looks straight ahead.
    pub const NONE: Self = Self(0.0, 0.0);

    /// Steering of the element of a grid with this index; `None` where elements are placed one by one.
    pub fn of(array: &ArraySpec, index: (i32, i32)) -> Option<Self> {
        let along = |index: i32, count: u32| {
            let steps = f64::from(index.unsigned_abs());
            // The two beside the middle are -1 and 1, half a step from it.
            if count.is_multiple_of(2) { steps - 0.5 } else { steps }
        };
        let (x, y) = (along(index.0, array.count.0), along(index.1, array.count.1));
        array.placed.is_empty().then_some(Self(x.max(y), x.min(y)))
    }
}

impl Serialize for SteeringSteps {
    /// Whole steps as whole numbers.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.fract() == 0.0 && self.1.fract() == 0.0 {
            return (self.0 as u32, self.1 as u32).serialize(serializer);
        }
        (self.0, self.1).serialize(serializer)
    }
}

/// The mapping of the elements that are steered by so many steps, to whichever side: their phase is steep, and what a pillar
/// does depends on its neighbours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SteeredMapping {
    /// Steps from the middle of the array along the two axes, the larger first.
    pub steps: SteeringSteps,
    /// Duty cycle over phase.
    pub polynomial: InversePolynomial,
}

impl SteeredMapping {
    pub(super) fn read(s: &Section<'_, '_>, cell: &CellSpec, array: &ArraySpec, common: &InversePolynomial) -> Self {
        let [first, second] = s.array::<2>("steps", Limits::new(0.0..=49.0, "steps from the middle of the array"));
        let steps = SteeringSteps(first, second);
        let there = array.elements();
        let mut there = there.iter().filter_map(|e| SteeringSteps::of(array, e.index));
        if !array.placed.is_empty() {
            s.fault(
                "steps",
                "elements that are placed one by one are no steps from the middle of a grid",
                "leave `[[mapping.steered]]` out, or use `elements` and `spacing_um` of [array] in place of [[element]]",
            );
        } else if steps == SteeringSteps::NONE || !there.any(|of_element| of_element == steps) {
            s.fault_given(
                &["array.elements"],
                "steps",
                format!("no steered elements are {first} and {second} steps from the middle of the array"),
                "give steps of elements that there are, the larger first, such as [1, 0]; along an axis with an even number of \
                 elements they are 0.5, 1.5, ...",
            );
        }
        let polynomial = InversePolynomial {
            coefficients: s.floats("coefficients", COEFFICIENT),
            ..common.clone()
        };
        if polynomial.coefficients.is_empty() && s.has("coefficients") {
            s.fault(
                "coefficients",
                "a mapping of no coefficients gives no width",
                "list those of u^0, u^1, ...",
            );
        }
        check_widths(s, cell, &polynomial);
        s.finish();
        Self { steps, polynomial }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Design;

    fn design(array: &str, steps: &str) -> metalith_core::Result<Design> {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/mini_3x3.toml"));
        let steered = format!("[[mapping.steered]]\nsteps = {steps}\ncoefficients = [0.3, 0.5]\n\n[layout]");
        let text = std::fs::read_to_string(path).unwrap();
        let text = text
            .replacen("elements = [3, 3]", array, 1)
            .replacen("steering_deg = 15 ", "steering_deg = 5 ", 1)
            .replacen("[layout]", &steered, 1)
            .replacen("size_um = [", "size_um = [2000, 2000] #", 1);
        Design::parse(path, &text)
    }

    /// Of four columns and five rows, (2, 1) is 1.5 and 1 steps from the middle, (1, 2) 0.5 and 2.
    #[test]
    fn elements_of_even_numbers_are_told_by_half_steps() {
        let of = |array: &str, steps: &str| -> Vec<(i32, i32)> {
            let design = design(array, steps).unwrap();
            let own = |index| SteeringSteps::of(&design.array, index).and_then(|steps| design.mapping.steered(steps));
            let all = design.elements().into_iter().map(|e| e.index);
            all.filter(|index| own(*index).is_some()).collect()
        };
        let mixed = "elements = [4, 5]";
        assert_eq!(of(mixed, "[1.5, 1]"), [(-2, -1), (2, -1), (-2, 1), (2, 1)]);
        assert_eq!(of(mixed, "[2, 0.5]"), [(-1, -2), (1, -2), (-1, 2), (1, 2)]);
        assert_eq!(of("elements = [2, 2]", "[0.5, 0.5]").len(), 4);
        for (array, steps) in [
            (mixed, "[2, 1]"),
            ("elements = [2, 2]", "[1, 1]"),
            ("elements = [3, 3]", "[1, 0.5]"),
        ] {
            let error = design(array, steps).unwrap_err();
            assert_eq!(
                error.ids(),
                ["mapping.steered#0.steps/inconsistent"],
                "{array} {steps}: {error}"
            );
        }
    }

    /// Half steps stand in digests and reports as they are, whole ones as before there were halves.
    #[test]
    fn whole_steps_are_written_as_whole_numbers() {
        let text = |steps| serde_json::to_string(&steps).unwrap();
        assert_eq!(
            (text(SteeringSteps(2.0, 1.0)), text(SteeringSteps(1.5, 1.0))),
            ("[2,1]".into(), "[1.5,1.0]".into())
        );
    }

    #[test]
    fn elements_placed_one_by_one_have_no_steps() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/hologram.toml"));
        let text = std::fs::read_to_string(path).unwrap();
        let steered = "[[mapping.steered]]\nsteps = [1, 0]\ncoefficients = [0.3, 0.5]\n\n[layout]";
        let error = Design::parse(path, &text.replacen("[layout]", steered, 1)).unwrap_err();
        assert_eq!(error.ids(), ["mapping.steered#0.steps/inconsistent"], "{error}");
        insta::assert_snapshot!(metalith_testing::without_folder(error, path.parent().unwrap()), @"
            hologram.toml:48:9: elements that are placed one by one are no steps from the middle of a grid
              help: leave `[[mapping.steered]]` out, or use `elements` and `spacing_um` of [array] in place of [[element]]
            ");
    }
}
