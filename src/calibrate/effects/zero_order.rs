//! Light passes the aperture without seeing pillars.

use super::{Effect, Parameter, Stage};
use crate::calibrate::departure::Departure;

/// Amplitude of that light over what arrives.
pub struct ZeroOrder;

impl Effect for ZeroOrder {
    fn name(&self) -> String {
        "zero_order".into()
    }

    fn unit(&self) -> &'static str {
        ""
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-0.6, 0.6, 0.05)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Departure) {
        to.geometry.zero_order = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[(
            "missing_pillars",
            "a dark-field micrograph, which shows single missing pillars",
        )]
    }
}
