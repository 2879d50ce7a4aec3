//! Every pillar is wider or narrower than drawn by the same amount.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::{DeclaredQuantity, Perturbation};

/// Width added to every pillar.
pub struct CdBias;

impl Effect for CdBias {
    fn name(&self) -> String {
        "cd_bias".into()
    }

    fn unit(&self) -> &str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-30.0, 30.0, 5.0)]
    }

    fn declared_form(&self, _parameter: usize) -> Option<(DeclaredQuantity, String)> {
        Some((DeclaredQuantity::WidthNm, "1".into()))
    }

    fn as_gradient(&self) -> Option<&'static str> {
        Some("a dose or an etch that is not the same all over the chip")
    }

    fn value_error(&self) -> ValueError {
        ValueError::of_value(1e-3)
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.geometry.cd_bias_nm = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "corner_rounding",
                "widths by SEM, from above, with an offset known to better than the bias",
            ),
            (
                "sidewall_taper",
                "widths by SEM, from above, with an offset known to better than the bias",
            ),
            ("film_index", "ellipsometry of the film on the chip, or widths by SEM"),
            (
                "cd_bias_density",
                "widths by SEM in the middle and at the rim of a lens",
            ),
        ]
    }
}
