//! The source is not at infinity: the incident wave is spherical.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// The reciprocal distance is fitted (1/m); the distance itself is reported.
pub struct SourceDistance;

impl Effect for SourceDistance {
    fn name(&self) -> String {
        "source_distance".into()
    }

    fn unit(&self) -> &str {
        "um"
    }

    fn stage(&self) -> Stage {
        Stage::Diffraction
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(0.0, 200.0, 25.0)]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(2e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.path.source_per_m = parameters[0].max(0.0);
    }

    fn parameter(&self, amount: f64) -> f64 {
        1e6 / amount
    }

    fn value(&self, parameter: f64, _set: &MeasuredSet) -> f64 {
        // 1e6 um to the metre; collimated light comes from infinitely far.
        1e6 / parameter.max(1e-6)
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("gap", "captures at two distances of the source")]
    }
}
