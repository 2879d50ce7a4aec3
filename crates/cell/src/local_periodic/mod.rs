//! Local periodic approximation (LPA): each pillar transmits what it would in a lattice of pillars that are all equal to it.
//!
//! - [`PointwiseCell`]: every width of a list solved by RCWA at each wavelength that is asked for.
//! - [`RigorousCell`]: the same from a [`CellTable`], which is solved once over a band and cached.
//!
//! Rectangles have the same approximation by [`crate::RotatedCell`] and [`crate::UprightCell`]. The coupled model
//! ([`crate::NeighbourCell`]) does without it.

mod barycentric;
mod column;
mod mixed;
mod pointwise;
mod rational_spectrum;
mod table;
mod table_file;
mod tabulated;
mod width_spectrum;

pub use mixed::MixedCell;
pub use pointwise::{BAND_ORDERS, OBLIQUE_BAND_ORDERS, OBLIQUE_ORDERS, ORDERS, PointwiseCell};
pub use table::{CellTable, Origin, TableInterpolation, TableSpec};
pub use tabulated::RigorousCell;
