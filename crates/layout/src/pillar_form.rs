//! The outline of one pillar of each width or rotation, as it is written.

use metalith_design::Design;
use metalith_pillars::{CHORD_ERROR, PillarId, PillarShape};

/// Form in which pillars are drawn: their shape, and the tolerance of the polygons of circles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PillarForm {
    shape: PillarShape,
    /// Chord error of circles (nm).
    chord_error_nm: f64,
}

impl PillarForm {
    /// The pillars of a design.
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

    /// This chord error for pillars of another shape.
    #[must_use]
    pub fn with_shape(self, shape: PillarShape) -> Self {
        Self { shape, ..self }
    }

    /// Shape of the pillars.
    pub fn shape(&self) -> PillarShape {
        self.shape
    }

    /// True if a pillar is an upright square, which both formats have a short record for.
    pub fn is_square(&self) -> bool {
        self.shape.is_square()
    }

    /// Corners of a pillar of an even width (nm) or a number about its middle, counter-clockwise, the first not repeated.
    pub fn corners(&self, number: u16) -> Vec<(i64, i64)> {
        self.shape.corners(PillarId(number), self.chord_error_nm)
    }

    /// Reach of a pillar from its middle along x and y (nm).
    pub fn reach(&self, number: u16) -> (i64, i64) {
        self.shape.reach(PillarId(number))
    }

    /// Name of the cell of one of these pillars: by its width, its rotation in steps, or its widths along x and y.
    pub fn cell_name(&self, number: u16) -> String {
        self.shape.cell_name(PillarId(number))
    }
}
