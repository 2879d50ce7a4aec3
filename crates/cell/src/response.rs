//! Response: the answer of a cell model.

use num_complex::Complex64;

use metalith_core::{Error, Result};

use crate::{BandResponse, FittedNeighbours, PolarisedLight, PolarisedTables};

/// Response of pillars to light. Transmissions are by the width (nm) or the number of the pillar, from zero to the
/// largest that was asked for: field ratios, from a plane wave in the substrate at the plane of the pillar base to air
/// at the plane of the pillar tops; exp(-i w t), so that a wider pillar has a larger phase. Entry 0 stands for a site
/// without pillar, where the layout is blocked: it is 0.
#[derive(Clone, Debug)]
pub enum CellResponse {
    /// Transmissions of light of any polarisation, which pillars keep.
    Scalar(Vec<Complex64>),
    /// Transmissions by polarisation.
    Jones(JonesTables),
    /// Transmissions by the pillar and its neighbours.
    Neighbours(NeighbourTables),
}

/// Transmissions by the polarisation that arrives and the one that leaves.
#[derive(Clone, Debug, PartialEq)]
pub enum JonesTables {
    /// Tables of pillars in oblique light, for s and p.
    Oblique(ObliqueTables),
    /// Tables of pillars that give polarisations dissimilar phases, along the normal.
    Polarised(PolarisedTables),
}

/// Transmissions of pillars among dissimilar neighbours.
#[derive(Clone, Debug)]
pub enum NeighbourTables {
    /// Tables at a single wavelength, for s and p.
    Fitted(FittedNeighbours),
    /// Tables at one of many wavelengths of a band, between those that have tables, s and p as one.
    Band(BandResponse),
}

impl CellResponse {
    /// Transmissions of the light that is focused, by the pillar alone.
    ///
    /// # Errors
    /// If no single table has it: of oblique light, and among neighbours.
    pub fn focused(self) -> Result<Vec<Complex64>> {
        match self {
            Self::Scalar(table) => Ok(table),
            Self::Jones(JonesTables::Polarised(tables)) => Ok(tables.own().to_vec()),
            Self::Jones(JonesTables::Oblique(_)) | Self::Neighbours(_) => Err(Error::refused(
                "cell/several-transmissions",
                "a pillar of this cell has more than one transmission",
                "use normal incidence and a model of equal pillars",
            )),
        }
    }

    /// Tables of pillars that give polarisations dissimilar phases.
    pub fn polarised(&self) -> Option<&PolarisedTables> {
        match self {
            Self::Jones(JonesTables::Polarised(tables)) => Some(tables),
            _ => None,
        }
    }
}

impl JonesTables {
    /// Tables of light that does not interfere, and the share of the light that arrives for each: their energies add. `light` counts
    /// where pillars give polarisations unlike phases; oblique light is unpolarised.
    pub fn incoherent(&self, light: PolarisedLight) -> (Vec<Vec<Complex64>>, f64) {
        match self {
            Self::Oblique(tables) => (tables.passed().cloned().collect(), POLARISATION_SHARE),
            Self::Polarised(tables) => (tables.passed(light).into_iter().map(|p| p.table).collect(), 1.0),
        }
    }
}

/// Transmissions of obliquely lit cells, scaled so that |t| of a cell that passes all its power in the zero order is that of
/// [`CellModel::full_transmission`](crate::CellModel::full_transmission), as at normal incidence.
///
/// Fields that arrive in different polarisations, or leave in different ones, do not interfere: unpolarised light is the
/// mean over those that arrive of the sum over those that leave.
#[derive(Clone, Debug, PartialEq)]
pub struct ObliqueTables {
    /// Light that leaves in the polarisation in which it arrived: across the plane of incidence (s), and in it (p).
    pub kept: [Vec<Complex64>; 2],
    /// Light that arrives as s and leaves as p, and light that arrives as p and leaves as s. All zero in planes of
    /// symmetry of the cell.
    pub turned: [Vec<Complex64>; 2],
}

/// Share of unpolarised light that arrives in either polarisation.
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

/// True if a table passes nothing.
pub fn dark(table: &[Complex64]) -> bool {
    table.iter().all(|t| t.norm() < DARK)
}
