//! The design of a metalens array: its text, the phase of every site, the width of every pillar.

pub mod array;
mod cell_file;
mod cells;
mod design;
mod digest;
mod files;
mod focus;
mod lattice_orders;
pub mod phase;
mod spec;
mod warnings;

pub use array::{PillarArray, PillarRule};
pub use cell_file::CellFile;
pub use cells::{VISIBLE_UM, band_about, cell_models, mappings, neighbour_cell};
pub use design::Design;
pub use lattice_orders::{AskedLight, LatticeOrders, Medium};
pub use metalith_cell::NeighbourCell;
pub use spec::*;
pub use warnings::MOST_NORMAL_DEG;
