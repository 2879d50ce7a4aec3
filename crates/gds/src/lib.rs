#![doc = include_str!("../README.md")]

mod cell;
mod cells;
mod circle;
mod element;
mod error;
pub mod extract;
mod fast;
mod input;
mod items;
mod layout;
mod limits;
mod names;
mod oasis;
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
pub mod write;

pub use cell::{Child, LayerTally, LayoutCell};
pub use cells::FileFormat;
pub use circle::circle_of;
pub use error::{Error, ExtractionError, LayoutError, Limit, Result};
pub use items::{CellConsumer, CellItem};
pub use layout::{Faulty, Layout};
pub use limits::ReadLimits;
pub use metalith_core::LayerNumber;
pub use shape::{Point, Rect, Shape, ShapeKind, Text};
pub use shape::{pillar_of, rectangle_of, simplified};
pub use transform::Transform;
pub use visit::{Selection, Visitor};
