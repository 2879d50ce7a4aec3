//! The refractive index of the film differs from the ellipsometry: another position on the wafer, or densified since.

use super::{Effect, Parameter, Stage};
use metalith_optics::Perturbation;

/// Added to n at every wavelength.
pub struct FilmIndex;

impl Effect for FilmIndex {
    fn name(&self) -> String {
        "film_index".into()
    }

    fn unit(&self) -> &str {
        "delta n"
    }

    fn stage(&self) -> Stage {
        Stage::Stack
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-0.15, 0.15, 0.02)]
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        to.cell.index = parameters[0];
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            (
                "film_height",
                "ellipsometry of the film on the chip, or a height by profilometer",
            ),
            (
                "cd_bias",
                "widths by SEM, from above, with an offset known to better than the bias",
            ),
        ]
    }
}
