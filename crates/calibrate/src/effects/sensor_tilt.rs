//! The sensor is tilted against the chip: elements stand at unlike distances from it.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_made::Perturbation;

/// Difference of distance at the outermost element for a tilt of typical size, and for the largest (um).
const TYPICAL_UM: f64 = 2.0;
const MOST_UM: f64 = 60.0;

/// The tilt along x and y, about the middle of all elements. Captures of elements side by side tell nothing of a tilt
/// about the line that they are on: such an axis is left out.
pub struct SensorTilt {
    pivot_um: [f64; 2],
    /// Axis and distance of the outermost element from the pivot along it (um).
    axes: Vec<(usize, f64)>,
}

impl SensorTilt {
    /// For the elements of a set; none if all of them are in one place.
    pub fn of(set: &MeasuredSet) -> Option<Self> {
        let ends = [0, 1].map(|axis| {
            let along = set.elements.iter().map(|e| e.centre_um[axis]);
            along.fold((f64::MAX, f64::MIN), |(a, b), c| (a.min(c), b.max(c)))
        });
        let half = ends.map(|(a, b)| 0.5 * (b - a));
        let axes: Vec<_> = half.into_iter().enumerate().filter(|(_, h)| *h > 0.0).collect();
        (!axes.is_empty()).then_some(Self {
            pivot_um: ends.map(|(a, b)| 0.5 * (a + b)),
            axes,
        })
    }
}

impl Effect for SensorTilt {
    fn name(&self) -> String {
        match self.axes.as_slice() {
            [(0, _)] => "sensor_tilt_x".into(),
            [(1, _)] => "sensor_tilt_y".into(),
            _ => "sensor_tilt".into(),
        }
    }

    fn unit(&self) -> &str {
        "mrad"
    }

    fn stage(&self) -> Stage {
        Stage::Diffraction
    }

    fn parameters(&self) -> Vec<Parameter> {
        let mrad = |um: f64, half: f64| 1e3 * um / half;
        let of = |(_, half): &(usize, f64)| {
            Parameter::new(-mrad(MOST_UM, *half), mrad(MOST_UM, *half), mrad(TYPICAL_UM, *half))
        };
        self.axes.iter().map(of).collect()
    }

    fn gradient_of(&self) -> Option<&'static str> {
        Some("gap")
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(5e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        for ((axis, _), mrad) in self.axes.iter().zip(parameters) {
            to.path.sensor_tilt_mrad[*axis] = *mrad;
            to.path.sensor_pivot_um = self.pivot_um;
        }
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("gap", "captures of elements farther apart")]
    }
}
