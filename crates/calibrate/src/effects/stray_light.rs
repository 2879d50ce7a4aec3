//! A share of the light is spread uniformly: scatter in the relay.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::Perturbation;

/// Share of the light of a window that is spread over it.
pub struct StrayLight;

impl Effect for StrayLight {
    fn name(&self) -> String {
        "stray_light".into()
    }

    fn unit(&self) -> &str {
        ""
    }

    fn stage(&self) -> Stage {
        Stage::Camera
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(0.0, 0.6, 0.02)]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(8e-3)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.camera.stray_light = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("missing_pillars", "light beside the window, or a dark-field micrograph")]
    }
}
