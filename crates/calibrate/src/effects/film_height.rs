//! The film, and so every pillar, is thicker or thinner than stated.

use super::{Effect, Parameter, Stage};
use crate::set::MeasuredSet;
use metalith_optics::Perturbation;

/// Added to the height; the height itself is reported.
pub struct FilmHeight;

impl Effect for FilmHeight {
    fn name(&self) -> String {
        "film_height".into()
    }

    fn unit(&self) -> &str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Stack
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-60.0, 60.0, 10.0)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.cell.height_nm = parameters[0];
    }

    fn value(&self, parameter: f64, set: &MeasuredSet) -> f64 {
        set.stack.cell.height_nm + parameter
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "residual_mask",
                "a height by profilometer or AFM, before and after stripping the mask",
            ),
            ("film_index", "ellipsometry of the film on the chip"),
            (
                "cd_bias",
                "widths by SEM, from above, with an offset known to better than the bias",
            ),
        ]
    }
}
