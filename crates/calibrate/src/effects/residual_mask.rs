//! Alumina of the etch mask was left on the pillars.

use super::{Effect, Parameter, Stage};
use metalith_optics::Perturbation;

/// Thickness of the residual alumina.
pub struct ResidualMask;

impl Effect for ResidualMask {
    fn name(&self) -> String {
        "residual_mask".into()
    }

    fn unit(&self) -> &str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Stack
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(0.0, 80.0, 15.0)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.cell.residual_mask_nm = parameters[0].max(0.0);
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "film_height",
                "a height by profilometer or AFM, before and after stripping the mask",
            ),
            ("film_index", "ellipsometry of the film on the chip"),
        ]
    }
}
