//! The design of a metalens array: its text, the phase of every site, the width of every pillar.

pub mod array;
mod cells;
mod design;
pub mod phase;
mod spec;

pub use array::{PillarArray, WidthRule};
pub use cells::{cell_models, mappings};
pub use design::Design;
pub use spec::*;
