//! Overlay error: the aperture is shifted against the pillars by the second exposure.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::Perturbation;

/// Offset from the pillars to their aperture along x and y. Light through the crescent that opens on the far side is
/// not deflected and left out.
pub struct ApertureOffset;

impl Effect for ApertureOffset {
    fn name(&self) -> String {
        "aperture_offset".into()
    }

    fn unit(&self) -> &str {
        "um"
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-20.0, 20.0, 2.0); 2]
    }

    fn kinked(&self) -> bool {
        // The derivative jumps at zero: the rim covers other pillars on either side.
        true
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(1e-2)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.geometry.aperture_offset_um = [parameters[0], parameters[1]];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("tilt", "a micrograph of the aperture's rim")]
    }
}
