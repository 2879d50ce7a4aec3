//! Spectra are wider or narrower than stated.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// Ratio of the width of all spectra to the stated one; the ratio less one is fitted.
pub struct LedWidth;

impl Effect for LedWidth {
    fn name(&self) -> String {
        "led_width".into()
    }

    fn unit(&self) -> &str {
        ""
    }

    fn stage(&self) -> Stage {
        Stage::Source
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-0.6, 1.5, 0.15)]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_typical(3e-3)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.light.led_width = parameters[0];
    }

    fn value(&self, parameter: f64, _set: &MeasuredSet) -> f64 {
        1.0 + parameter
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("pixel_blur", "the spectra of the LEDs"),
            ("source_size", "the spectra of the LEDs"),
        ]
    }
}
