//! The sensor is tilted against the chip: elements stand at unlike distances from it.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_attribution::Extent;
use metalith_optics::Perturbation;

/// Difference of distance at the outermost element for a tilt of typical size, and for the largest (um).
const TYPICAL_UM: f64 = 2.0;
const MOST_UM: f64 = 60.0;

/// The tilt along x and y, about the middle of all elements, or along the one line that they are in: measurements of elements side by
/// side tell nothing of a tilt about this line.
pub(crate) struct SensorTilt {
    extent: Extent,
}

impl SensorTilt {
    /// Tilt for the elements of a set; none if all of them are in one place.
    pub(crate) fn of(set: &MeasuredSet) -> Option<Self> {
        let at: Vec<[f64; 2]> = set.elements.iter().map(|e| e.centre_um).collect();
        Some(Self {
            extent: Extent::of(&at)?,
        })
    }
}

impl Effect for SensorTilt {
    fn name(&self) -> String {
        match self.extent.directions.as_slice() {
            [[1.0, 0.0]] => "sensor_tilt_x".into(),
            [[0.0, 1.0]] => "sensor_tilt_y".into(),
            [_] => "sensor_tilt_along".into(),
            _ => "sensor_tilt".into(),
        }
    }

    fn unit(&self) -> &'static str {
        "mrad"
    }

    fn stage(&self) -> Stage {
        Stage::Diffraction
    }

    fn parameters(&self) -> Vec<Parameter> {
        let mrad = |um: f64, half: f64| 1e3 * um / half;
        let of = |half: &f64| Parameter::new(-mrad(MOST_UM, *half), mrad(MOST_UM, *half), mrad(TYPICAL_UM, *half));
        self.extent.half_spans.iter().map(of).collect()
    }

    fn gradient_of(&self) -> Option<&'static str> {
        Some("defocus")
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(5e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.path.sensor_pivot_um = self.extent.middle;
        for (direction, mrad) in self.extent.directions.iter().zip(parameters) {
            for (tilt, part) in to.path.sensor_tilt_mrad.iter_mut().zip(direction) {
                *tilt += part * mrad;
            }
        }
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("defocus", "measurements of elements farther apart")]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Elements on a diagonal tell of the tilt along it: one number, by which each stands as far from the sensor as it should. A
    /// millionth of a micrometre beside the line is no second direction.
    #[test]
    fn elements_on_an_oblique_line_have_one_tilt() {
        /// Relative: rounding, and the place beside the line.
        const ROUNDING: f64 = 1e-6;
        let at = [[-150.0, -150.0], [1e-6, 0.0], [150.0, 150.0]];
        let tilt = SensorTilt {
            extent: Extent::of(&at).unwrap(),
        };
        assert_eq!(
            (tilt.name().as_str(), tilt.parameters().len()),
            ("sensor_tilt_along", 1)
        );
        let typical = tilt.parameters()[0].typical;
        let mut made = Perturbation::default();
        tilt.apply(&[typical], &mut made);
        let lean = |centre: [f64; 2]| -> f64 {
            let along = |axis: usize| 1e-3 * made.path.sensor_tilt_mrad[axis] * centre[axis];
            along(0) + along(1)
        };
        assert!((lean(at[2]) / TYPICAL_UM - 1.0).abs() < ROUNDING, "{}", lean(at[2]));
    }
}
