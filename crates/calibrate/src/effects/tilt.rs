//! The angle of incidence differs from the stated one, by the same angle for every capture.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::Perturbation;

/// Added to the angle of incidence along x and y.
pub struct Tilt;

impl Effect for Tilt {
    fn name(&self) -> String {
        "tilt".into()
    }

    fn unit(&self) -> &str {
        "mrad"
    }

    fn stage(&self) -> Stage {
        Stage::Diffraction
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-40.0, 40.0, 3.0); 2]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(1e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.path.tilt_mrad = [parameters[0], parameters[1]];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("aperture_offset", "a micrograph of the aperture's rim")]
    }
}
