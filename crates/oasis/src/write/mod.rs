//! Writing: records of cells into buffers, buffers into a file.

mod block;
mod file;
mod records;

pub use block::CompressedBlock;
pub use file::{CellBounds, OasisWriter};
pub use records::{Placing, RecordBuffer};
