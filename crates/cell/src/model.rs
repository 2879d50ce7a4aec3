//! What the rest of the program knows of a cell: complex transmission by width.

use std::fmt;
use std::str::FromStr;

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

use metalith_core::{Error, Progress, Result};
use metalith_pillars::{LatticeKind, PillarShape};

use crate::{BandResponse, FittedNeighbours, PolarisedTables, RotatedCell};

/// How truly a cell is described. Every result names the one it was made with.
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
    /// Those that a design alone has, from the least to the most true.
    pub const ALL: [Self; 4] = [Self::Published, Self::Fitted, Self::Rigorous, Self::Neighbours];

    /// The cell that answers where the width of a pillar is all that is known: neighbours are then taken for equals.
    #[must_use]
    pub fn of_width_alone(self) -> Self {
        match self {
            Self::Neighbours => Self::Rigorous,
            other => other,
        }
    }

    /// Why pillars of a shape on such a lattice cannot be judged by it, and what to do instead; none if they can.
    pub fn refusal(self, shape: PillarShape, lattice: LatticeKind) -> Option<(String, &'static str)> {
        let square_lattices_alone = matches!(self, Self::Published | Self::Neighbours);
        let for_rectangles = matches!(self, Self::Rigorous | Self::Calibrated);
        if shape.basis().is_some() && !for_rectangles {
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
            Some((what, hint)) => Err(Error::invalid(what, hint)),
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
            Error::invalid(
                format!("`{text}` is not a fidelity of the cell"),
                "use published, fitted, rigorous or neighbours",
            )
        })
    }
}

/// Transmissions of obliquely lit cells by the width of the pillar (nm).
///
/// Fields that arrive in different polarisations, or leave in different ones, do not interfere: unpolarised light is the
/// mean over those that arrive of the sum over those that leave.
#[derive(Clone, Debug, PartialEq)]
pub struct ObliqueTables {
    /// What leaves in the polarisation in which it arrived: across the plane of incidence (s), and in it (p).
    pub kept: [Vec<Complex64>; 2],
    /// What arrives as s and leaves as p, and what arrives as p and leaves as s. All zero in planes of symmetry of the
    /// cell.
    pub turned: [Vec<Complex64>; 2],
}

/// Of light that is not polarised, what arrives in either polarisation.
pub const POLARISATION_SHARE: f64 = 0.5;

impl ObliqueTables {
    /// The tables that light passes by, each for half of the light that arrives.
    pub fn passed(&self) -> impl Iterator<Item = &Vec<Complex64>> {
        let turned = self.turned.iter().filter(|t| !dark(t));
        self.kept.iter().chain(turned)
    }
}

/// Transmissions below this are rounding errors of what symmetry forbids.
const DARK: f64 = 1e-9;

/// Whether a table passes nothing.
pub fn dark(table: &[Complex64]) -> bool {
    table.iter().all(|t| t.norm() < DARK)
}

/// How a cell of the lattice passes light into its zero order, by the width of its pillar.
pub trait CellModel: Sync {
    /// What the model is.
    fn fidelity(&self) -> Fidelity;

    /// Complex transmission of the zero order at one wavelength, with the width (nm) as index from zero
    /// to `max_width_nm`.
    ///
    /// A field ratio, from a plane wave in the substrate at the plane of the pillar base to air at the
    /// plane of the pillar tops; exp(-i w t), so that a wider pillar has a larger phase. Entry 0 stands
    /// for a site without pillar, where the layout is blocked: it is 0.
    ///
    /// # Errors
    /// If the wavelength is outside what the model or its materials cover, or a width does not fit.
    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>>;

    /// The same for one of many wavelengths that a band is averaged over, where a resonance that is off its place by a
    /// fraction of a nanometre does not show: a model may solve it more coarsely.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`].
    fn transmissions_in_band(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.transmissions(wavelength_um, max_width_nm)
    }

    /// Of a cell that tells polarisations apart: what it does to light of both. Its transmissions are of the light that it
    /// focuses. Nothing of cells that tell none apart.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`].
    fn polarised(&self, _wavelength_um: f64, _max_width_nm: u16) -> Result<Option<PolarisedTables>> {
        Ok(None)
    }

    /// The model itself, if it is that of rotated rectangles: what their rotations do can be asked of it.
    fn rotated(&self) -> Option<&RotatedCell> {
        None
    }

    /// As [`CellModel::polarised`], for one of many wavelengths that a band is averaged over.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`].
    fn polarised_in_band(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Option<PolarisedTables>> {
        self.polarised(wavelength_um, max_width_nm)
    }

    /// The same as [`CellModel::transmissions`] for light that arrives obliquely, by polarisation. `sines` are those of
    /// the direction in air along x and y.
    ///
    /// Scaled so that |t| of a cell that passes all its power in the zero order is that of
    /// [`CellModel::full_transmission`], as at normal incidence. Nothing if the model knows no angles.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`]; also if no light arrives so steeply.
    fn oblique(&self, _wavelength_um: f64, _sines: [f64; 2], _max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        Ok(None)
    }

    /// As [`CellModel::oblique`], for one of many wavelengths that a band is averaged over; a model may solve it more
    /// coarsely.
    ///
    /// # Errors
    /// As [`CellModel::oblique`].
    fn oblique_in_band(&self, wavelength_um: f64, sines: [f64; 2], max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        self.oblique(wavelength_um, sines, max_width_nm)
    }

    /// What pillars transmit among unlike neighbours, for light that arrives from the direction with these sines in air
    /// along x and y, x >= y >= 0. Nothing if the model takes all neighbours for
    /// equals; one that does not gives the answers above as a lattice of equal pillars would.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`]; also if no light arrives so steeply, or the user stopped it.
    fn among_neighbours(
        &self,
        _wavelength_um: f64,
        _sines: [f64; 2],
        _progress: &dyn Progress,
    ) -> Result<Option<FittedNeighbours>> {
        Ok(None)
    }

    /// The same for one of many wavelengths that a band is averaged over, s and p as one: without a table of its own, between
    /// the wavelengths that have one. `looks` is the direction that light of a wavelength (um) arrives from, as above. Nothing
    /// also of a model that knows no wavelengths with tables.
    ///
    /// # Errors
    /// As [`CellModel::among_neighbours`].
    fn among_neighbours_in_band(
        &self,
        _wavelength_um: f64,
        _looks: &dyn Fn(f64) -> [f64; 2],
        _progress: &dyn Progress,
    ) -> Result<Option<BandResponse>> {
        Ok(None)
    }

    /// |t| of a cell that passes all its power in the zero order: sqrt(n) of the substrate for the
    /// rigorous cell, 1 for one without amplitude. Strehl ratios are against this.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`].
    fn full_transmission(&self, wavelength_um: f64) -> Result<f64>;
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
