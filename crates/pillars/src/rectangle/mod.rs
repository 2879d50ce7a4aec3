//! Rectangular pillars, which give each polarisation a phase: of one size, by their rotation; or upright, by their size.

mod rotated;
mod upright;

use serde::Serialize;

pub use rotated::RotatedRectangles;
pub use upright::UprightRectangles;

/// The rectangular pillars of a layout, each known by a number from 1 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(untagged)]
pub enum Rectangles {
    /// Rectangles of one size, by their rotation: geometric phase.
    Rotated(RotatedRectangles),
    /// Upright, by their edges along x and y: a separate phase for light polarised along each.
    Upright(UprightRectangles),
}

impl From<RotatedRectangles> for Rectangles {
    fn from(pillars: RotatedRectangles) -> Self {
        Self::Rotated(pillars)
    }
}

impl From<UprightRectangles> for Rectangles {
    fn from(pillars: UprightRectangles) -> Self {
        Self::Upright(pillars)
    }
}
