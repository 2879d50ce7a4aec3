#![doc = include_str!("../README.md")]

mod error;
mod escape;
mod limits;
mod number;
mod read;
mod record;
mod repetition;
mod trapezoid;
mod write;

pub use error::{OasisError, OasisFault, OasisLimit};
pub use escape::StringKind;
pub use limits::OasisLimits;
pub use read::{
    CellReference, NameEntry, NameTable, OasisDetails, OasisElement, OasisItem, OasisPlace, OasisReader, OasisShape,
    OasisValue, OasisWarning,
};
pub use repetition::Repetition;
pub use trapezoid::compact_trapezoid;
pub use write::{CellBounds, CompressedBlock, OasisWriter, Placing, RecordBuffer};

/// The thirteen bytes that every OASIS file begins with.
pub const MAGIC: &[u8; 13] = b"%SEMI-OASIS\r\n";
