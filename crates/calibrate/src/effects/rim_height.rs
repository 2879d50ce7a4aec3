//! Pillars at the rim of a lens are higher or lower than in its middle, on a flat substrate: the film is not flat, or masks and tops
//! wear unevenly, because the etch is loaded by what is open around them (C. J. Mogab, J. Electrochem. Soc. 124, 1262 (1977)).
//! An etch that goes deeper at the rim is another change: tops are level there, and film or a trench is left between the pillars.

use super::{Effect, Parameter, Stage};
use metalith_optics::Perturbation;

/// Height added at the rim over that in the middle, with the square of the radius between: the first term of any smooth
/// change that is the same all around. It is the same in every lens.
pub struct RimHeight;

impl Effect for RimHeight {
    fn name(&self) -> String {
        "rim_height".into()
    }

    fn unit(&self) -> &str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Stack
    }

    fn parameters(&self) -> Vec<Parameter> {
        // As of the height of the film, whose cells then serve both.
        vec![Parameter::new(-60.0, 60.0, 10.0)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.cell.rim_height_nm = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "gap",
                "heights by AFM in the middle and at the rim of a lens, or the distance by another way",
            ),
            (
                "source_distance",
                "heights by AFM in the middle and at the rim of a lens",
            ),
            ("film_height", "heights by AFM in the middle and at the rim of a lens"),
            (
                "spherical_aberration",
                "heights by AFM in the middle and at the rim of a lens",
            ),
            (
                "cd_bias_density",
                "widths by SEM in the middle and at the rim of a lens",
            ),
        ]
    }
}
