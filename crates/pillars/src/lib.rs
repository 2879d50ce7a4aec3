//! Lattices, the kinds of pillars that stand on them, and maps of pillars by site.

mod circle;
mod eighth_map;
mod element_site;
mod kind;
mod lattice;
mod like_numbers;
mod mixed;
mod packed_numbers;
mod pillar_check;
mod pillar_map;
mod pitch;
mod rectangle;
mod rows;
mod shape;
mod square;
mod steepness;

pub use circle::{CHORD_ERROR, Circle, circle_corners};
pub use eighth_map::EighthMap;
pub use element_site::{ElementSite, PillarReader};
pub use kind::{OutlineForm, PillarId, PillarKind, PolarisationBasis, Quantity};
pub use lattice::{Lattice, LatticeKind};
pub use mixed::SquaresAndCircles;
pub use pillar_check::PillarCheck;
pub use pillar_map::PillarMap;
pub use pitch::{DatabaseUnit, Pitch};
pub use rectangle::{Rectangles, RotatedRectangles, UprightRectangles};
pub use rows::{PillarRows, RowExtent};
pub use shape::PillarShape;
pub use square::Square;
pub use steepness::Steepness;
