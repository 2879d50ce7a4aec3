//! The cell: a square pillar on its lattice site, and how light passes it.

mod material;
mod model;
mod polynomial;
mod published;
pub mod rcwa;
mod stack;

pub use material::Material;
pub use model::{CellModel, Fidelity};
pub use polynomial::{Basis, ForwardPolynomial, InversePolynomial};
pub use published::PublishedCell;
pub use stack::CellStack;
