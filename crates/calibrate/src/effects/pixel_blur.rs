//! The camera blurs: its relay, or charge that diffuses.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// Standard deviation of a Gaussian; its square is what is fitted.
pub struct PixelBlur;

impl Effect for PixelBlur {
    fn name(&self) -> String {
        "pixel_blur".into()
    }

    fn unit(&self) -> &str {
        "um"
    }

    fn stage(&self) -> Stage {
        Stage::Camera
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(0.0, 9.0, 0.09)]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(1e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.camera.pixel_blur_um = parameters[0].max(0.0).sqrt();
    }

    fn parameter(&self, amount: f64) -> f64 {
        amount * amount.abs()
    }

    fn value(&self, parameter: f64, _set: &MeasuredSet) -> f64 {
        parameter.max(0.0).sqrt()
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("source_size", "a capture with the source stopped down"),
            ("led_width", "the spectra of the LEDs"),
        ]
    }
}
