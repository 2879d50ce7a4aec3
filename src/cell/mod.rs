//! The cell: a square pillar on its lattice site, and how light passes it.

mod model;

pub use model::{CellModel, Fidelity};
