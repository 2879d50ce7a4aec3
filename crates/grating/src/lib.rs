//! Diffraction orders of blazed rows of pillars, predicted from supercells.
//!
//! The models in `metalith-cell` take each pillar for one of a lattice of equal pillars. That holds for a lens where the
//! widths change slowly. Where the phase is steep the width changes from site to site, the orders leave at large
//! angles, and the resonances of a lattice of equal pillars do not form.
//!
//! - [`Blaze`]: one place of a lens is nearly a blazed grating whose vector is the gradient of the phase. One period of
//!   it is solved as a supercell; its orders are what this place of the lens sends out. Power and amplitude of each
//!   order follow, for s and p.
//! - [`CoarseCell`]: the pillar with few diffraction orders that makes this fast, with its widths corrected so that the
//!   single cell is right on average.
//! - [`RealRow`]: consecutive pillars of an element, solved together; it measures how far any model of single sites, such
//!   as the local cell, is from the supercell. [`site_transmissions`] are the values it compares with.
//!
//! - [`GratingTable`]: amplitudes of the orders of local gratings in one light, solved at chosen grating vectors and
//!   smooth between them; kept in a folder.
//! - [`GratingPillars`]: an element as an aperture whose sites transmit as in the local grating of [`SlopeMap`], read
//!   from the widths by [`Mapping`].
//!
//! ```text
//! mapping, light, disc of grating vectors  ->  GratingTable
//! phase of a design                        ->  SlopeMap
//! both, widths as read                     ->  GratingPillars, an aperture for any propagator
//! ```
//!
//! This is a prediction by a solver that is held to an independent one (`golden/truth/supercell.csv`). `metalith run` and
//! `verify` judge by [`NeighbourCell`], whose tables for the shipped designs come with this crate; gratings are a stage of no
//! command. [`GratingTable`]s give what a place of a lens sends
//! out, where all phases of the grating occur. They do not give how the orders of a row of three to nine pillars that
//! repeats exactly change with where its phase starts; that is [`Blaze`].
//! `examples/blazed_rows.rs` prints the shares by the truth, by single cells and by [`Blaze`].
//!
//! Conventions are those of `metalith-rcwa`: exp(-i w t), light arrives from the substrate, phases are counted from the
//! middle of site 0 in the plane of the pillar tops.

mod aperture;
mod blaze;
mod cell;
mod fit;
mod linear;
mod mapping;
mod neighbour_cell;
mod neighbour_pillars;
mod neighbour_table;
mod node;
mod orientation;
mod rows;
mod shipped;
mod site_grid;
mod sites;
mod slopes;
mod surface;
mod table;
mod training;

pub use aperture::{GratingPillars, LocalCell};
pub use blaze::{Blaze, BlazeOrder, BlazeOrders};
pub use cell::{COARSE, CoarseCell};
pub use mapping::Mapping;
pub use neighbour_cell::NeighbourCell;
pub use neighbour_pillars::NeighbourPillars;
pub use neighbour_table::{NeighbourTable, NeighbourTableSpec, sites_by};
pub use node::{FIRST_KEPT, GratingVector, KEPT, OrderAmplitudes};
pub use orientation::Orientation;
pub use rows::{ElementRow, RealRow, SolvedRow};
pub use site_grid::SiteGrid;
pub use sites::site_transmissions;
pub use slopes::SlopeMap;
pub use surface::Surface;
pub use table::{GratingTable, GratingTableSpec};
