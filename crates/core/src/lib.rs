//! What every room of the project stands on: errors, progress, whole files, documents with spans, the lattice.

mod circle;
mod cross;
#[cfg(feature = "documents")]
pub mod document;
mod eighth;
mod error;
pub mod file;
mod lattice;
mod layer;
#[cfg(feature = "npy")]
pub mod npy;
mod pillar_check;
mod pillars;
mod plane;
mod progress;
mod rectangle;
mod rows;
mod shape;
pub mod srgb;
pub mod text;
mod wedge;
mod zernike;

pub use circle::{CHORD_ERROR, circle_corners};
pub use cross::cross_corners;
#[cfg(feature = "documents")]
pub use document::{Fault, Faults};
pub use eighth::EighthMap;
pub use error::{Error, Result};
pub use file::{FolderTurn, WholeFile, WholeFolder};
pub use lattice::{Lattice, LatticeKind, PillarMap};
pub use layer::LayerNumber;
pub use pillar_check::PillarCheck;
pub use pillars::{ElementSite, PillarReader};
pub use plane::part;
pub use progress::{Progress, Silent};
pub use rectangle::{Rectangles, RotatedRectangles, UprightRectangles};
pub use rows::PillarRows;
pub use shape::PillarShape;
pub use wedge::{Wedge, turned_sine};
pub use zernike::Zernike;
