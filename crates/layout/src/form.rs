//! The outline of one pillar of each width, as it is written.

use metalith_core::{CHORD_ERROR, PillarShape, circle_corners};
use metalith_design::Design;

/// How the pillars of a design are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PillarForm {
    shape: PillarShape,
    /// Of circles (nm).
    chord_error_nm: f64,
}

impl PillarForm {
    pub fn of(design: &Design) -> Self {
        let plain = Self::plain(design.cell.shape);
        Self {
            chord_error_nm: design.layout.circle_chord_error_nm.unwrap_or(plain.chord_error_nm),
            ..plain
        }
    }

    /// Pillars of this shape, where nothing else is said.
    pub fn plain(shape: PillarShape) -> Self {
        Self {
            shape,
            chord_error_nm: CHORD_ERROR,
        }
    }

    /// Whether a pillar is an upright square, which both formats have a short record for.
    pub fn is_square(&self) -> bool {
        self.shape.is_square()
    }

    /// Corners of a pillar of an even width (nm) about its middle, counter-clockwise, the first not repeated.
    pub fn corners(&self, width_nm: u16) -> Vec<(i64, i64)> {
        let h = i64::from(width_nm) / 2;
        match self.shape {
            PillarShape::Square => vec![(-h, -h), (h, -h), (h, h), (-h, h)],
            PillarShape::Circle => circle_corners(width_nm.into(), self.chord_error_nm),
        }
    }
}
