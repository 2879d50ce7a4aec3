//! Pillars are wider where more is exposed around them: backscattered electrons, or loading of the etch.

use super::{Effect, Parameter, Stage};
use metalith_optics::{DeclaredQuantity, Perturbation};

/// Width added for each unit of area fraction, averaged over the range of the backscatter.
pub struct CdBiasDensity;

impl Effect for CdBiasDensity {
    fn name(&self) -> String {
        "cd_bias_density".into()
    }

    fn unit(&self) -> &str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-80.0, 80.0, 15.0)]
    }

    fn declared_form(&self, _parameter: usize) -> Option<(DeclaredQuantity, String)> {
        Some((DeclaredQuantity::WidthNm, "fill".into()))
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.geometry.cd_bias_density_nm = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[("cd_bias", "widths by SEM in the middle and at the rim of a lens")]
    }
}
