//! Foundation of every part of the project: errors, progress, whole files, documents with spans, tables, NPY, PNG, TIFF and FITS.

mod alignment_cross;
pub mod cpu_time;
mod csv;
#[cfg(feature = "documents")]
pub mod document;
mod error;
pub mod expression;
pub mod file;
#[cfg(feature = "frames")]
pub mod file_kind;
#[cfg(feature = "frames")]
pub mod fits;
mod lagrange;
mod layer;
mod memo;
#[cfg(feature = "npy")]
pub mod npy;
mod plane;
#[cfg(feature = "frames")]
pub mod png;
mod processor;
mod progress;
pub mod srgb;
pub mod text;
#[cfg(feature = "frames")]
pub mod tiff;
mod warning;
mod wedge;
mod zernike;

pub use alignment_cross::cross_corners;
pub use csv::{CsvRow, csv_columns, csv_field, csv_rows};
#[cfg(feature = "documents")]
pub use document::{Fault, FaultKind, Faults};
pub use error::{Error, Result};
pub use file::{AtomicFile, AtomicFolder, FolderLock};
pub use lagrange::lagrange_weight;
pub use layer::LayerNumber;
pub use memo::Memo;
pub use plane::part;
pub use processor::vector_instructions;
pub use progress::{Named, Progress, Quiet, Silent, Steps};
pub use warning::Warning;
pub use wedge::{Wedge, numerical_aperture, turned_sine};
pub use zernike::Zernike;
