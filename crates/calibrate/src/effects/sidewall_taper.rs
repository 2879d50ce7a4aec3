//! Sidewall taper: the top keeps its width, the foot is wider or narrower.

use super::{Effect, Parameter, Stage};
use metalith_optics::Perturbation;

/// Angle of the wall from the vertical; positive if the foot is wider.
pub struct SidewallTaper;

impl Effect for SidewallTaper {
    fn name(&self) -> String {
        "sidewall_taper".into()
    }

    fn unit(&self) -> &str {
        "deg"
    }

    fn stage(&self) -> Stage {
        Stage::Stack
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-3.0, 3.0, 0.6)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.cell.taper_deg = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "cd_bias",
                "widths by SEM, from above, with an offset known to better than the bias",
            ),
            ("corner_rounding", "a cross-section by SEM"),
        ]
    }
}
