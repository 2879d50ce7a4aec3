//! The centre wavelength of one LED differs from the stated one: temperature, current, or batch.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::Perturbation;

/// Added to the centre of one LED.
pub(crate) struct LedCentre {
    /// Index of the LED in the set.
    pub led: usize,
    /// `led_centre_` and its stated centre.
    pub name: String,
}

impl Effect for LedCentre {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn unit(&self) -> &'static str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Source
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-12.0, 12.0, 2.0)]
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_typical(6e-3)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        *to.light.shift_mut(self.led) = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("defocus", "the spectrum of the LED")]
    }
}
