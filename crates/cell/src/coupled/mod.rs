//! Pillars among dissimilar neighbours, from supercells.
//!
//! The other models of this crate take each pillar for one of a lattice of equal pillars. That holds for a lens where the
//! widths change slowly. Where the phase is steep the width changes from site to site, the orders leave at large
//! angles, and the resonances of a lattice of equal pillars do not form.
//!
//! - [`NeighbourResponse`]: the transmission of a site as a sum over pairs of its pillar with each neighbour.
//! - [`NeighbourTable`]: the responses of one light, fitted to supercells of unlike pillars; those of the shipped designs come
//!   with this crate. [`BandResponse`]: the response at a wavelength between those that have tables.
//! - [`NeighbourCell`]: both as the cell model that `metalith run` and `verify` simulate with.
//! - [`CoarseCell`]: the pillar with few diffraction orders that makes supercells fast, with its widths corrected so that the
//!   single cell is right on average.
//! - [`RealRow`]: consecutive pillars of an element, solved together; it measures how far any model of single sites is from the
//!   supercell.
//!
//! ```text
//! mapping of a design, light  ->  supercells of unlike pillars  ->  NeighbourTable  ->  NeighbourCell
//! ```
//!
//! The solver is held to an independent one (`golden/truth/supercell.csv`). Conventions are those of `metalith-rcwa`:
//! exp(-i w t), light arrives from the substrate, phases are counted from the middle of site 0 in the plane of the pillar tops.

mod band;
mod blaze;
mod cell;
mod coarse_cell;
mod fit;
mod linear;
mod mapping;
mod orientation;
mod pair_sum;
mod rows;
mod shipped;
mod site_grid;
mod sites;
mod table;
#[cfg(test)]
mod tests;
mod training;

pub use band::{BandNode, BandResponse};
pub use blaze::Blaze;
pub use cell::NeighbourCell;
pub use coarse_cell::CoarseCell;
pub use mapping::Mapping;
pub use orientation::Orientation;
pub use pair_sum::{
    FittedNeighbours, NEIGHBOUR_DEGREE, NEIGHBOUR_TERMS, NEIGHBOURS, NeighbourBasis, NeighbourResponse, SiteResponse,
    neighbours,
};
pub use rows::{ElementRow, RealRow, SolvedRow};
pub use site_grid::SiteGrid;
pub use table::{NeighbourTable, NeighbourTableSpec, sites_by};
