//! The wavefront behind the lens is bent: by the substrate, by stress, or by the writer.

use super::{Effect, Parameter, Stage, ValueError};
use metalith_optics::{DeclaredQuantity, Perturbation};

/// Optical path over every lens by some Zernike polynomials of one kind, the same at all colours.
pub(crate) struct Aberration {
    pub name: &'static str,
    /// Noll's numbers of the polynomials, each normalised to an rms of one over the aperture.
    pub noll: &'static [u32],
    pub value_error: ValueError,
}

/// Aberrations through third order; tilts are registration, defocus is a separate effect.
pub(crate) const ABERRATIONS: [Aberration; 4] = [
    Aberration {
        name: "astigmatism",
        noll: &[5, 6],
        value_error: ValueError::of_typical(2e-4),
    },
    Aberration {
        name: "coma",
        noll: &[7, 8],
        value_error: ValueError::of_typical(5e-5),
    },
    Aberration {
        name: "trefoil",
        noll: &[9, 10],
        value_error: ValueError::of_typical(7e-5),
    },
    Aberration {
        name: "spherical_aberration",
        noll: &[11],
        value_error: ValueError::of_value(1e-4),
    },
];

impl Effect for Aberration {
    fn name(&self) -> String {
        self.name.into()
    }

    fn unit(&self) -> &'static str {
        "nm"
    }

    fn stage(&self) -> Stage {
        Stage::Geometry
    }

    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new(-200.0, 200.0, 12.0); self.noll.len()]
    }

    fn declared_form(&self, parameter: usize) -> Option<(DeclaredQuantity, String)> {
        let j = self.noll.get(parameter)?;
        Some((DeclaredQuantity::OpdNm, format!("zernike({j}, x / R, y / R)")))
    }

    fn value_error(&self) -> ValueError {
        self.value_error
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        for (j, nm) in self.noll.iter().zip(parameters) {
            to.geometry.set_wavefront(*j, *nm);
        }
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("defocus", "measurements at more distances"),
            ("source_distance", "measurements at two distances of the source"),
            ("tilt", "measurements at more angles"),
        ]
    }
}
