//! Layout bytes -> shapes and where they stand: a streaming reader of GDSII stream format, release 6.
//!
//! Written from the format, not from our writer. A file is read in blocks through a fixed buffer and is
//! never held: [`Layout::open`] goes through it once and keeps what there is of each cell in number (byte
//! range, shapes a layer, references a child); [`Layout::visit`] goes through it again and hands every
//! shape, decoded once, to a [`Visitor`] together with all places its cell stands at.
//!
//! What the format allows is read: any order of records inside an element, optional records, several XY
//! records an element, padding after ENDLIB, any database unit. What it forbids, and what would cost
//! unbounded memory or time ([`ReadLimits`]), is an [`Error::Layout`] with the offset of the byte and a cause that
//! can be matched on.

mod cell;
mod element;
mod error;
pub mod extract;
mod fast;
mod input;
mod layout;
mod limits;
mod names;
mod outline;
mod place;
mod real;
mod record;
mod scan;
mod shape;
mod transform;
mod tree;
mod visit;
mod walk;

pub use cell::{Cell, Child, LayerTally};
pub use error::{Error, ExtractionError, LayoutError, Limit, Result};
pub use layout::{Faulty, Layout};
pub use limits::ReadLimits;
pub use metalith_core::LayerNumber;
pub use shape::{Point, Rect, Shape, ShapeKind, Text};
pub use shape::{rectangle_of, simplified};
pub use transform::Transform;
pub use visit::{Selection, Visitor};
