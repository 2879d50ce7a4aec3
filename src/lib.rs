//! metalith

mod cell;
#[allow(dead_code, unused_imports)] // read by the design, the rules and the measurements to come
mod document;
mod error;
mod file;
mod lattice;
mod progress;

pub use cell::{CellModel, Fidelity};
pub use document::{Fault, Faults};
pub use error::{Error, Result};
pub use file::WholeFile;
pub use lattice::{Lattice, WidthMap};
pub use progress::{Progress, Silent};
