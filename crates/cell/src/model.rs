//! Interface of a cell: complex transmission by width.

use std::fmt;
use std::str::FromStr;

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

use metalith_core::{Error, Progress, Result, Silent};
use metalith_pillars::{LatticeKind, PillarShape};

use crate::{CellResponse, Illumination};

/// Fidelity of the description of a cell. Every result names the one it was made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fidelity {
    /// Phase polynomials with the published coefficients; no amplitude.
    Published,
    /// Polynomials of the same form fitted to the rigorous cell; no amplitude.
    Fitted,
    /// Complex transmission of the zero order by rigorous coupled-wave analysis.
    Rigorous,
    /// Each pillar among the neighbours that it has, by a sum over pairs fitted to rigorous supercells of unlike pillars.
    Neighbours,
    /// The rigorous cell of the pillars as a measured line makes them, by a model that `calibrate` wrote.
    Calibrated,
}

impl Fidelity {
    /// Fidelities that a design alone has, from the least to the most true.
    pub const ALL: [Self; 4] = [Self::Published, Self::Fitted, Self::Rigorous, Self::Neighbours];

    /// The cell that answers where the width of a pillar is all that is known: neighbours are then taken for equals.
    #[must_use]
    pub fn of_width_alone(self) -> Self {
        match self {
            Self::Neighbours => Self::Rigorous,
            other => other,
        }
    }

    /// Reason why pillars of a shape on such a lattice cannot be simulated with it, and what to do instead; `None` if
    /// they can.
    pub fn refusal(self, shape: PillarShape, lattice: LatticeKind) -> Option<(String, &'static str)> {
        let square_lattices_alone = matches!(self, Self::Published | Self::Neighbours);
        let for_rectangles = matches!(self, Self::Rigorous | Self::Calibrated);
        if shape == PillarShape::Mixed && self != Self::Rigorous {
            Some((
                format!("squares and circles in one lens by the `{self}` cell"),
                "ask for `rigorous`: no other is made for both in one lens",
            ))
        } else if shape.basis().is_some() && !for_rectangles {
            Some((
                format!("rectangular pillars by the `{self}` cell"),
                "ask for `rigorous`, as `fidelity` in [verify] of a design or with --fidelity: no other is made for rectangles",
            ))
        } else if square_lattices_alone && !lattice.is_square() {
            Some((
                format!("a hexagonal lattice by the `{self}` cell"),
                "ask for `rigorous` or `fitted`, as `fidelity` in [verify] of a design or with --fidelity: this one is made of \
                 square lattices",
            ))
        } else {
            None
        }
    }

    /// Check that pillars of a shape on such a lattice can be judged by it.
    ///
    /// # Errors
    /// If they cannot.
    pub fn check(self, shape: PillarShape, lattice: LatticeKind) -> Result<()> {
        match self.refusal(shape, lattice) {
            Some((what, hint)) => Err(Error::refused("cell/fidelity-not-for-pillars", what, hint)),
            None => Ok(()),
        }
    }

    /// The name used in options, files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Fitted => "fitted",
            Self::Rigorous => "rigorous",
            Self::Neighbours => "neighbours",
            Self::Calibrated => "calibrated",
        }
    }
}

impl fmt::Display for Fidelity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Fidelity {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|f| f.name() == text).ok_or_else(|| {
            Error::refused(
                "cell/unknown-fidelity",
                format!("there is no simulation model `{text}`"),
                "use published, fitted, rigorous or neighbours",
            )
        })
    }
}

/// Model of how pillars of a lattice pass light into its zeroth order. A model is one implementation of this:
/// [`CellModel::response`] answers, the others are facts.
pub trait CellModel: Sync {
    /// Fidelity of the model.
    fn fidelity(&self) -> Fidelity;

    /// Response of pillars up to a width (nm) or number to light.
    ///
    /// A model of lattices of equal pillars that knows oblique light answers for [`Illumination::cell_sines`], one that does not answers
    /// for light along the normal. A coupled model answers for [`Illumination::coupled_sines`]. Directions of cells on a square
    /// lattice have x >= y >= 0.
    ///
    /// # Errors
    /// If the wavelength is outside what the model or its materials cover, a width does not fit, no light arrives so steeply, or the
    /// user stopped it.
    fn response(&self, light: &Illumination<'_>, largest_number: u16, progress: &dyn Progress) -> Result<CellResponse>;

    /// |t| of a cell that passes all its power in the zero order: sqrt(n) of the substrate for the
    /// rigorous cell, 1 for one without amplitude. Strehl ratios are against this.
    ///
    /// # Errors
    /// If the wavelength is outside what the model or its materials cover.
    fn full_transmission(&self, wavelength_um: f64) -> Result<f64>;

    /// Model of lattices of equal pillars, for a coupled model, that answers where the neighbours of a pillar are not
    /// known.
    fn uncoupled(&self) -> Option<&dyn CellModel> {
        None
    }

    /// Transmissions of focused light along the normal at a single wavelength, by width (nm) or number, with equal neighbours.
    ///
    /// # Errors
    /// As [`CellModel::response`].
    fn transmissions(&self, wavelength_um: f64, largest_number: u16) -> Result<Vec<Complex64>> {
        match self.uncoupled() {
            Some(cell) => cell.transmissions(wavelength_um, largest_number),
            None => (self.response(&Illumination::normal(wavelength_um), largest_number, &Silent)?).focused(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for fidelity in Fidelity::ALL {
            assert_eq!(fidelity.to_string().parse::<Fidelity>().unwrap(), fidelity);
        }
        assert!("exact".parse::<Fidelity>().is_err());
    }
}
