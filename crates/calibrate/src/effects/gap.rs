//! The camera's plane is farther from the chip than stated.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::{DeclaredQuantity, Perturbation};

/// Added to every distance.
pub struct Gap;

impl Effect for Gap {
    fn name(&self) -> String {
        "gap".into()
    }

    fn unit(&self) -> &str {
        "um"
    }

    fn stage(&self) -> Stage {
        Stage::Diffraction
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-60.0, 60.0, 4.0)]
    }

    fn declared_form(&self, _parameter: usize) -> Option<(DeclaredQuantity, String)> {
        Some((DeclaredQuantity::DistanceUm, "1".into()))
    }

    fn as_gradient(&self) -> Option<&'static str> {
        Some("a sensor that is tilted against the chip: um per mm are mrad")
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(1e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.path.gap_um = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("source_distance", "a capture at another distance of the source"),
            ("led_centre", "the spectrum of the LED"),
        ]
    }
}
