//! Rectangular pillars: of one size, by their rotation; or upright, by their size.

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
    /// Upright, by their edges along x and y: a phase of its own for light polarised along each.
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

impl Rectangles {
    /// The last number.
    pub fn last(self) -> u16 {
        match self {
            Self::Rotated(pillars) => pillars.steps,
            Self::Upright(pillars) => pillars.count(),
        }
    }

    /// Corners of a pillar about its middle on the grid of whole nanometres, counter-clockwise.
    pub fn corners(self, number: u16) -> [(i64, i64); 4] {
        match self {
            Self::Rotated(pillars) => pillars.corners(number),
            Self::Upright(pillars) => pillars.corners(number),
        }
    }

    /// Reach of a pillar from its middle along x and y (nm).
    pub fn reach(self, number: u16) -> (i64, i64) {
        match self {
            Self::Rotated(pillars) => pillars.reach(number),
            Self::Upright(pillars) => pillars.reach(number),
        }
    }

    /// Edges of a pillar as it would stand upright (nm): the shorter and the longer one of rotated pillars, those along x and y of
    /// upright ones.
    pub fn edges_nm(self, number: u16) -> [u16; 2] {
        match self {
            Self::Rotated(pillars) => [pillars.width_nm, pillars.length_nm],
            Self::Upright(pillars) => pillars.edges_nm(number),
        }
    }

    /// The longest diagonal of the pillars up to a number, as drawn (nm).
    pub fn longest_diagonal_nm(self, number: u16) -> f64 {
        match self {
            Self::Rotated(pillars) => pillars.longest_diagonal_nm(),
            Self::Upright(pillars) => pillars.longest_diagonal_nm(number),
        }
    }

    /// Distance of two pillars of these numbers whose centres are (dx, dy) apart (nm), as drawn; negative where they overlap.
    pub fn gap(self, numbers: [u16; 2], apart: [f64; 2]) -> f64 {
        match self {
            Self::Rotated(pillars) => pillars.gap(numbers, apart),
            Self::Upright(pillars) => pillars.gap(numbers, apart),
        }
    }

    /// The number of the pillar whose outline is this one about its middle (nm), in any order of its corners, if each is within
    /// `slack_nm` of one of the pillar's.
    pub fn recognised(self, corners: &[[f64; 2]; 4], slack_nm: f64) -> Option<u16> {
        match self {
            Self::Rotated(pillars) => pillars.recognised(corners, slack_nm),
            Self::Upright(pillars) => pillars.recognised(corners, slack_nm),
        }
    }

    /// Words for a pillar with this number.
    pub fn words(self, number: u16) -> String {
        match self {
            Self::Rotated(pillars) => format!("rotated by {} degrees", short_deg(pillars.rotation(number))),
            Self::Upright(pillars) => {
                let [x, y] = pillars.edges_nm(number);
                format!("{x} x {y} nm")
            }
        }
    }
}

/// An angle in degrees, without the digits that steps of it do not have.
fn short_deg(rad: f64) -> f64 {
    (rad.to_degrees() * 1e6).round() / 1e6
}
