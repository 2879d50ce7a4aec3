//! The outline of one pillar of each width or rotation, as it is written: in database units.

use metalith_design::Design;
use metalith_pillars::{CHORD_ERROR, DatabaseUnit, OutlineForm, PillarId, PillarShape, circle_corners};

/// Form in which pillars are drawn: their shape, and the tolerance of the polygons of circles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PillarForm {
    shape: PillarShape,
    /// Chord error of circles (nm).
    chord_error_nm: f64,
    unit: DatabaseUnit,
}

impl PillarForm {
    /// The pillars of a design.
    pub fn of(design: &Design) -> Self {
        let plain = Self::plain(design.cell.shape);
        Self {
            unit: design.cell.database_unit,
            chord_error_nm: design.layout.circle_chord_error_nm.unwrap_or(plain.chord_error_nm),
            ..plain
        }
    }

    /// Pillars of this shape, where nothing else is said.
    pub fn plain(shape: PillarShape) -> Self {
        Self {
            shape,
            chord_error_nm: CHORD_ERROR,
            unit: DatabaseUnit::Nanometre,
        }
    }

    /// Same form on the grid of this database unit.
    #[must_use]
    pub fn on_grid(self, unit: DatabaseUnit) -> Self {
        Self { unit, ..self }
    }

    /// Database unit of its corners.
    pub fn unit(&self) -> DatabaseUnit {
        self.unit
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

    /// Edge of a square or diameter of a circle of a width (database units).
    pub fn edge(&self, width_nm: u16) -> i64 {
        self.unit.units(width_nm.into())
    }

    /// Corners of a pillar of a width (nm), even on a grid of 1 nm, or a number about its middle (database units),
    /// counter-clockwise, the first not repeated. Corners of rectangles are whole nanometres on each grid: what a rotation
    /// transmits counts their rounding.
    pub fn corners(&self, number: u16) -> Vec<(i64, i64)> {
        let per_nm = self.unit.per_nm();
        match self.shape.outline() {
            OutlineForm::Circle => circle_corners(self.edge(number) as u32, self.chord_error_nm * per_nm as f64),
            OutlineForm::Square => {
                let h = self.edge(number) / 2;
                vec![(-h, -h), (h, -h), (h, h), (-h, h)]
            }
            OutlineForm::Polygon | OutlineForm::Mixed => {
                let corners = self.shape.corners(PillarId(number), self.chord_error_nm);
                corners.into_iter().map(|(x, y)| (x * per_nm, y * per_nm)).collect()
            }
        }
    }

    /// Reach of a pillar from its middle along x and y (database units).
    pub fn reach(&self, number: u16) -> (i64, i64) {
        match self.shape.outline() {
            OutlineForm::Polygon | OutlineForm::Mixed => {
                let (x, y) = self.shape.reach(PillarId(number));
                (self.unit.units(x), self.unit.units(y))
            }
            _ => (self.edge(number) / 2, self.edge(number) / 2),
        }
    }

    /// Name of the cell of one of these pillars: by its width, its rotation in steps, or its widths along x and y.
    pub fn cell_name(&self, number: u16) -> String {
        self.shape.cell_name(PillarId(number))
    }
}
