//! The pillars of one element on its lattice, all in memory.

use ndarray::Array2;

use super::{Lattice, PillarRows};

/// The pillars of one element on its lattice: the array that a layout is written from, and that is
/// read back from one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PillarMap {
    /// Lattice of the sites.
    pub lattice: Lattice,
    /// Number that identifies the pillar at each site among others of its shape, zero where there is none: the width of
    /// a square or a circle (nm), the number of a rectangle. Shape `[sites, sites]`, row index along +y, column index
    /// along +x. It is its own index into tables of the cell.
    pub number: Array2<u16>,
}

impl PillarMap {
    /// A lattice without pillars.
    pub fn empty(lattice: Lattice) -> Self {
        let n = lattice.sites();
        Self {
            lattice,
            number: Array2::zeros((n, n)),
        }
    }

    /// Number of sites with a pillar.
    pub fn pillars(&self) -> u64 {
        PillarRows::pillars(self)
    }

    /// Radius of the circle about the element's centre that holds the centres of all of its pillars (um); zero
    /// without pillars.
    pub fn circle_um(&self) -> f64 {
        PillarRows::circle_um(self)
    }

    /// Number of pillars of each width (nm), or of each number of a rectangle, which is the index; the first entry
    /// counts empty sites.
    pub fn histogram(&self) -> Vec<u64> {
        PillarRows::histogram(self)
    }
}
