//! Jones response of a rotated rectangle: what its cell does to both polarisations of light.

use std::fmt;

use num_complex::Complex64;
use serde::Serialize;

use metalith_core::{Error, Result};
use metalith_rcwa::{Incidence, LayerStack, Orders, Outline, Side, solve};

use crate::CellStack;

/// Handedness: the way in which circularly polarised light turns, seen against it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Handedness {
    /// (x + i y) / sqrt 2, with exp(-i w t) and a wave along +z.
    #[default]
    Left,
    Right,
}

impl Handedness {
    /// Name and value of each, as design files and options have them.
    pub const CHOICES: [(&'static str, Self); 2] = [("left", Self::Left), ("right", Self::Right)];

    /// Phase (rad) that a pillar that is rotated by an angle (rad) adds to light that arrives in this hand and leaves
    /// in the other.
    pub fn geometric_phase(self, rotation: f64) -> f64 {
        match self {
            Self::Left => 2.0 * rotation,
            Self::Right => -2.0 * rotation,
        }
    }
}

impl fmt::Display for Handedness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// The cross-section of a rectangular pillar at its top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotatedRectangle {
    /// Edge along the direction of `rotation` (nm).
    pub width_nm: f64,
    /// Edge across it (nm).
    pub length_nm: f64,
    /// Angle from x towards y (rad).
    pub rotation: f64,
}

impl CellStack {
    /// Layers of a rectangular pillar at a wavelength (um), from the substrate upwards; the shape of the stack itself does not
    /// count, its taper widens both edges alike. An edge of zero leaves the bare substrate.
    ///
    /// # Errors
    /// If corners are rounded, an edge is not a number, the foot is wider than the pitch along x or y, or the wavelength is
    /// outside the range of a material.
    pub fn rectangle_layers(&self, pillar: &RotatedRectangle, wavelength_um: f64) -> Result<LayerStack> {
        let RotatedRectangle {
            width_nm,
            length_nm,
            rotation,
        } = *pillar;
        if ![width_nm, length_nm, rotation].iter().all(|v| v.is_finite()) {
            return Err(Error::refused(
                "cell/edges-out-of-range",
                format!("a pillar of {width_nm} x {length_nm} nm, rotated by {rotation} rad"),
                "give both edges in nm and the angle in rad",
            ));
        }
        self.check_sharp()?;
        self.layers_of(wavelength_um, |wider_nm| {
            let [width, length] = [width_nm, length_nm].map(|edge| (edge + wider_nm).max(0.0));
            if width <= 0.0 || length <= 0.0 {
                Outline::empty()
            } else {
                Outline::rotated_rectangle(width, length, rotation)
            }
        })
    }

    /// Refuses rounded corners, which no rectangle is solved with.
    pub(crate) fn check_sharp(&self) -> Result<()> {
        if self.corner_radius_nm > 0.0 {
            return Err(Error::refused(
                "cell/rounded-rectangles",
                "the cell has rectangles with rounded corners",
                "leave the corner radius at 0: rectangles are solved with sharp corners",
            ));
        }
        Ok(())
    }

    /// Jones matrix of the zero order of a rectangular pillar for light from the substrate whose direction has these sines in
    /// air along x and y: `[out][in]`, 0 for x and 1 for y. Ratios of the transverse field where the stack ends to that which
    /// arrives at the foot; in circular polarisation by [`metalith_rcwa::circular`].
    ///
    /// # Errors
    /// As [`CellStack::rectangle_layers`]; also if no light arrives at that angle.
    pub fn jones(
        &self,
        pillar: &RotatedRectangle,
        wavelength_um: f64,
        sines: [f64; 2],
        orders: Orders,
    ) -> Result<[[Complex64; 2]; 2]> {
        let layers = self.rectangle_layers(pillar, wavelength_um)?;
        let incidence = Incidence::of_sines(wavelength_um, Side::Below, sines);
        Ok(solve(&layers, &incidence, orders)?.jones)
    }
}

/// Message on what cells of rectangles are not solved for, and what to do instead.
pub const OBLIQUE_RECTANGLES: [&str; 2] = [
    "rectangular pillars in light that arrives at an angle",
    "leave out --oblique, or set `incidence = \"normal\"` in [verify]: their cells are solved along the normal",
];

/// Error for cells of rectangles in light that arrives at an angle.
pub fn oblique_refused() -> Error {
    let [what, hint] = OBLIQUE_RECTANGLES;
    Error::refused("cell/oblique-rectangles", what, hint)
}

#[cfg(test)]
pub(crate) mod tests {
    use metalith_pillars::RotatedRectangles;
    use metalith_rcwa::{Material, circular};

    use super::*;

    /// Phase that the lattice, which does not turn with the pillar, may add to the geometric phase (rad): 0.0126 for
    /// the pillar of the test with 13 orders, 0.0137 with 17; others, that reach nearer to their neighbours, have some
    /// hundredths.
    const GEOMETRIC: f64 = 0.015;

    /// A quarter of a turn leaves the lattice alike: what it does to the phase is exact, but for what tells x from y in the
    /// solver, 1e-9, felt more at resonances.
    const QUARTER: f64 = 1e-6;

    /// Nearly half-wave plates at 532 nm, in steps of a degree.
    pub(crate) const PILLARS: RotatedRectangles = RotatedRectangles {
        width_nm: 100,
        length_nm: 250,
        steps: 180,
    };

    pub(crate) fn titania() -> CellStack {
        CellStack {
            film: Material::named("tio2_siefke_2016").unwrap(),
            ..CellStack::paper(355.0, 600.0).unwrap()
        }
    }

    fn rotated(degrees: f64) -> RotatedRectangle {
        RotatedRectangle {
            width_nm: 100.0,
            length_nm: 250.0,
            rotation: degrees.to_radians(),
        }
    }

    fn converted(degrees: f64) -> Complex64 {
        let orders = Orders::new(13).unwrap();
        circular(titania().jones(&rotated(degrees), 0.532, [0.0; 2], orders).unwrap())[1][0]
    }

    #[test]
    fn a_half_wave_pillar_has_the_geometric_phase() {
        // Share of the light that is converted, at least.
        const CONVERTED: f64 = 0.9;
        let upright = converted(0.0);
        for degrees in (0..=180).step_by(15).map(f64::from) {
            let t = converted(degrees);
            assert!(t.norm_sqr() / 1.46 > CONVERTED, "{degrees}: {t}");
            let apart = (t / upright * Complex64::cis(-2.0 * degrees.to_radians())).arg();
            assert!(apart.abs() < GEOMETRIC, "{degrees} degrees: {apart} rad");
            if degrees % 90.0 == 0.0 {
                assert!(apart.abs() < QUARTER, "{degrees} degrees: {apart} rad");
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refused = |stack: CellStack, pillar: RotatedRectangle, id: &str| {
            let error = stack.rectangle_layers(&pillar, 0.532).unwrap_err();
            assert_eq!(error.id(), id, "{error}");
        };
        let round = CellStack {
            corner_radius_nm: 10.0,
            ..titania()
        };
        refused(round, rotated(0.0), "cell/rounded-rectangles");
        refused(titania(), rotated(f64::NAN), "cell/edges-out-of-range");
        let long = RotatedRectangle {
            length_nm: 400.0,
            ..rotated(30.0)
        };
        let error = titania().jones(&long, 0.532, [0.0; 2], Orders::new(3).unwrap());
        assert_eq!(error.unwrap_err().id(), "rcwa/width-out-of-range");
    }
}
