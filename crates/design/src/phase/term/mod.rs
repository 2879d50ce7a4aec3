//! Phases over the plane of an element that are added to the radial phase of the lens.

mod grid_phase;
mod map;
mod optic_studio;

use std::path::PathBuf;

use serde::Serialize;

use super::RadialPhase;
use metalith_core::{Error, Result, Zernike};

pub use map::MapTable;

/// A phase over the plane of an element, and the elements that have it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseTerm {
    pub form: TermForm,
    /// Factor of the phase.
    pub scale: f64,
    /// Middle of the phase, from that of the element (um).
    pub centre_um: [f64; 2],
    /// Indices of the elements that have it; all where none is named.
    pub elements: Vec<(i32, i32)>,
    /// The file that its numbers come from, if they come from one.
    #[serde(skip)]
    pub file: Option<PathBuf>,
}

/// Source of a phase.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TermForm {
    /// A phase over the radius.
    Radial(RadialPhase),
    /// A table over the plane.
    Map(MapTable),
    /// Sum of Zernike polynomials.
    Zernike {
        order: ZernikeOrder,
        /// Coefficients of the first polynomials of that order (waves).
        coefficients: Vec<f64>,
        /// Radius of the disc that they are orthogonal over (um).
        radius_um: f64,
    },
    /// Sum of `a x^i y^j`, with lengths in parts of a radius: "Binary 1" in optical design programs.
    Polynomial {
        /// Powers of x and y, and the coefficient (rad).
        terms: Vec<(u32, u32, f64)>,
        /// Length by which lengths are divided (um).
        radius_um: f64,
    },
    /// A surface of a lens file of OpticStudio, still to be read.
    OpticStudio {
        #[serde(skip)]
        file: PathBuf,
        surface: Option<u32>,
    },
}

/// The order in which Zernike polynomials are counted, and how they are normalised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ZernikeOrder {
    /// Noll's order, an rms of one over the disc.
    Standard,
    /// The order of the University of Arizona, a largest value of one: a set of [`Zernike::FRINGE_SET`].
    Fringe,
}

impl PhaseTerm {
    /// Read the file that it names, if it does, for a lens of this radius (um) whose aperture has these least and greatest places
    /// from the middle along x and along y (um), before the element is rotated: phases turn with it.
    ///
    /// # Errors
    /// If the file is not what it should be, or does not cover the lens; a map has to cover the box about the aperture.
    pub fn load(&mut self, lens_radius_um: f64, ends_um: [[f64; 2]; 2]) -> Result<()> {
        let reach_um = lens_radius_um + self.centre_um[0].hypot(self.centre_um[1]);
        let box_um = [0, 1].map(|axis| {
            let far = ends_um[axis].map(|end| (end - self.centre_um[axis]).abs());
            far[0].max(far[1])
        });
        match &mut self.form {
            TermForm::Radial(radial) => radial.load(reach_um),
            TermForm::Map(map) => map.load(box_um),
            TermForm::OpticStudio { file, surface } => {
                let form = optic_studio::read(file, *surface)?;
                if let TermForm::Map(map) = &form {
                    map.covers(box_um)?;
                    if map.is_wrapped() && self.scale.fract() != 0.0 {
                        return Err(Error::refused(
                            "phase/scaled-jumps",
                            format!("{}: phases that jump by waves, times {}", file.display(), self.scale),
                            "take a whole number as `scale`, or a grid of phases without jumps",
                        ));
                    }
                }
                self.form = form;
                Ok(())
            }
            TermForm::Zernike { .. } | TermForm::Polynomial { .. } => Ok(()),
        }
    }

    /// True if an element has it.
    pub fn is_of(&self, element: (i32, i32)) -> bool {
        self.elements.is_empty() || self.elements.contains(&element)
    }

    /// True if its phase is known up to whole waves: it jumps by them between places, which has no effect behind a
    /// lens.
    pub fn is_wrapped(&self) -> bool {
        matches!(&self.form, TermForm::Map(map) if map.is_wrapped())
    }

    /// True if places on both sides of the x axis have equal phases, to the last bit.
    pub fn is_mirrored(&self) -> bool {
        matches!(self.form, TermForm::Radial(_)) && self.centre_um[1] == 0.0
    }

    /// Phase at a place from the middle of the element (um), in turns, not reduced.
    pub fn turns(&self, x_um: f64, y_um: f64) -> f64 {
        let (x, y) = (x_um - self.centre_um[0], y_um - self.centre_um[1]);
        self.scale
            * match &self.form {
                TermForm::Radial(radial) => radial.turns(x * x + y * y),
                TermForm::Map(map) => map.turns(x, y),
                TermForm::Zernike {
                    order,
                    coefficients,
                    radius_um,
                } => {
                    let (x, y) = (x / radius_um, y / radius_um);
                    let each = coefficients.iter().zip(1..).filter(|(c, _)| **c != 0.0);
                    each.map(|(c, j)| c * order.value(j, x, y)).sum()
                }
                TermForm::Polynomial { terms, radius_um } => {
                    let (x, y) = (x / radius_um, y / radius_um);
                    let sum: f64 = terms
                        .iter()
                        .map(|&(i, j, a)| a * x.powi(i as i32) * y.powi(j as i32))
                        .sum();
                    sum / std::f64::consts::TAU
                }
                TermForm::OpticStudio { .. } => 0.0,
            }
    }
}

impl ZernikeOrder {
    fn value(self, j: u32, x: f64, y: f64) -> f64 {
        match self {
            Self::Standard => Zernike::noll(j).norm() * Zernike::noll(j).value(x, y),
            Self::Fringe => Zernike::fringe(j).value(x, y),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of phases of a few turns.
    const ROUNDING: f64 = 1e-12;

    fn term(form: TermForm) -> PhaseTerm {
        PhaseTerm {
            form,
            scale: 1.0,
            centre_um: [0.0; 2],
            elements: Vec::new(),
            file: None,
        }
    }

    #[test]
    fn zernike_terms_have_the_sizes_that_their_orders_say() {
        let of = |order, coefficients: &[f64]| {
            term(TermForm::Zernike {
                order,
                coefficients: coefficients.to_vec(),
                radius_um: 50.0,
            })
        };
        // Defocus at the rim: sqrt 3 of an rms of one, or one.
        let standard = of(ZernikeOrder::Standard, &[0.0, 0.0, 0.0, 0.5]);
        let fringe = of(ZernikeOrder::Fringe, &[0.0, 0.0, 0.0, 0.5]);
        assert!((standard.turns(30.0, 40.0) - 0.5 * 3f64.sqrt()).abs() < ROUNDING);
        assert!((fringe.turns(30.0, 40.0) - 0.5).abs() < ROUNDING);
        // Tilt along x.
        assert!((of(ZernikeOrder::Fringe, &[0.0, 2.0]).turns(25.0, 7.0) - 1.0).abs() < ROUNDING);
    }

    #[test]
    fn polynomials_scales_and_centres() {
        let polynomial = PhaseTerm {
            scale: -2.0,
            centre_um: [1.0, 0.0],
            ..term(TermForm::Polynomial {
                terms: vec![(2, 1, 3.0), (0, 0, 1.0)],
                radius_um: 10.0,
            })
        };
        let want = -2.0 * (3.0 * 0.4 * 0.4 * 0.5 + 1.0) / std::f64::consts::TAU;
        assert!((polynomial.turns(5.0, 5.0) - want).abs() < ROUNDING);
    }
}
