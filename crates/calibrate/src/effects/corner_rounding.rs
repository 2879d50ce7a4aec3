//! Vertical edges are round: resist and etch do not resolve corners.

use super::{Effect, Parameter, Stage};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// Radius of the vertical edges. Area and phase fall with its square, which is what is fitted.
pub struct CornerRounding;

impl Effect for CornerRounding {
    fn name(&self) -> String {
        "corner_rounding".into()
    }

    fn unit(&self) -> &str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Stack
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(0.0, 4900.0, 625.0)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.cell.corner_rounding_nm = parameters[0].max(0.0).sqrt();
    }

    fn parameter(&self, amount: f64) -> f64 {
        amount * amount.abs()
    }

    fn value(&self, parameter: f64, _set: &MeasuredSet) -> f64 {
        parameter.max(0.0).sqrt()
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "cd_bias",
                "widths by SEM, from above, with an offset known to better than the bias",
            ),
            ("sidewall_taper", "a cross-section by SEM"),
        ]
    }
}
