//! Light passes the aperture without interacting with pillars.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// Amplitude of that light relative to the incident wave.
pub struct ZeroOrder;

impl Effect for ZeroOrder {
    fn name(&self) -> String {
        "zero_order".into()
    }

    fn unit(&self) -> &str {
        ""
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        // In phase with the incident wave and in quadrature: the path of that light is not known.
        vec![Parameter::new(-0.6, 0.6, 0.05); 2]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(2e-3)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.geometry.zero_order = parameters[0].hypot(parameters[1]);
        to.geometry.zero_order_phase = parameters[1].atan2(parameters[0]);
    }

    fn reported(&self, numbers: &[f64], half_widths: &[f64], _set: &MeasuredSet) -> Vec<(f64, [f64; 2])> {
        let amplitude = numbers[0].hypot(numbers[1]);
        let along = numbers.iter().zip(half_widths).map(|(n, w)| n * w);
        let width = along.fold(0.0, f64::hypot) / amplitude.max(f64::MIN_POSITIVE);
        vec![(amplitude, [(amplitude - width).max(0.0), amplitude + width])]
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[(
            "missing_pillars",
            "a dark-field micrograph, which shows single missing pillars",
        )]
    }
}
