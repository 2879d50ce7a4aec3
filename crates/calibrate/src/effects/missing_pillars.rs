//! Pillars are missing at random positions.

use super::{Effect, Parameter, Stage};
use metalith_optics::Perturbation;

/// Share of the pillars that are missing.
pub struct MissingPillars;

impl Effect for MissingPillars {
    fn name(&self) -> String {
        "missing_pillars".into()
    }

    fn unit(&self) -> &str {
        ""
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(0.0, 0.3, 0.02)]
    }

    fn random(&self) -> bool {
        true
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.geometry.missing_pillars = parameters[0].max(0.0);
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "zero_order",
                "a dark-field micrograph, which shows single missing pillars",
            ),
            ("stray_light", "a dark-field micrograph, or the light beside the window"),
        ]
    }
}
