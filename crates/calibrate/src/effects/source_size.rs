//! The source is larger or smaller than stated.

use super::{Effect, Parameter, Stage, ValueError};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// Ratio of the diameter to the stated one; the ratio less one is fitted.
pub struct SourceSize;

impl Effect for SourceSize {
    fn name(&self) -> String {
        "source_size".into()
    }

    fn unit(&self) -> &str {
        ""
    }

    fn stage(&self) -> Stage {
        Stage::Source
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-1.0, 6.0, 0.5)]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(1e-4)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.light.source_size = parameters[0];
    }

    fn value(&self, parameter: f64, _set: &MeasuredSet) -> f64 {
        1.0 + parameter
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("pixel_blur", "a capture with the source stopped down"),
            ("led_width", "the spectra of the LEDs"),
        ]
    }
}
