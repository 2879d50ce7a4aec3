//! Squares and circles in one lens, as other programs draw them.

use crate::circle::Circle;
use crate::kind::{OutlineForm, PillarId, PillarKind};
use crate::square::Square;

/// Upright squares and circles in one lens, each by its width: numbers from [`SquaresAndCircles::CIRCLE`] on stand for circles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SquaresAndCircles;

/// Delegates to the kind of a pillar.
macro_rules! of_pillar {
    ($id:expr, $kind:ident, $width:ident => $answer:expr) => {
        match SquaresAndCircles::width($id) {
            (true, $width) => {
                let $kind = Circle;
                $answer
            }
            (false, $width) => {
                let $kind = Square;
                $answer
            }
        }
    };
}

impl SquaresAndCircles {
    /// What the number of a circle is more than its diameter (nm): the number of a square is its width.
    pub const CIRCLE: u16 = 1 << 15;

    /// True for a circle, and the width of a pillar.
    #[inline]
    pub fn width(PillarId(number): PillarId) -> (bool, PillarId) {
        (number >= Self::CIRCLE, PillarId(number % Self::CIRCLE))
    }

    /// The pillar with such a width (nm), if numbers reach so far.
    pub fn number(is_circle: bool, width_nm: u16) -> Option<PillarId> {
        let first = if is_circle { Self::CIRCLE } else { 0 };
        (1..Self::CIRCLE)
            .contains(&width_nm)
            .then_some(PillarId(first + width_nm))
    }
}

impl PillarKind for SquaresAndCircles {
    fn name(&self) -> &'static str {
        "square or circle"
    }

    fn plural(&self) -> &'static str {
        "squares and circles"
    }

    fn design_name(&self) -> &'static str {
        "mixed"
    }

    #[inline]
    fn outline(&self) -> OutlineForm {
        OutlineForm::Mixed
    }

    #[inline]
    fn has_width(&self) -> bool {
        false
    }

    #[inline]
    fn edges_nm(&self, id: PillarId) -> [u16; 2] {
        [Self::width(id).1.0; 2]
    }

    fn axis_edges_nm(&self, id: PillarId) -> Vec<u16> {
        of_pillar!(id, kind, width => kind.axis_edges_nm(width))
    }

    fn corners(&self, id: PillarId, chord_error_nm: f64) -> Vec<(i64, i64)> {
        of_pillar!(id, kind, width => kind.corners(width, chord_error_nm))
    }

    fn area_nm2(&self, id: PillarId) -> f64 {
        of_pillar!(id, kind, width => kind.area_nm2(width))
    }

    fn widest_nm(&self, PillarId(last): PillarId) -> f64 {
        f64::from(last.min(Self::CIRCLE - 1))
    }

    fn gap(&self, pair: [PillarId; 2], apart: [f64; 2]) -> f64 {
        // Of unlike ones the squares around them, which are never farther apart.
        match pair.map(Self::width) {
            [(true, a), (true, b)] => Circle.gap([a, b], apart),
            [(_, a), (_, b)] => Square.gap([a, b], apart),
        }
    }

    fn least_gap(&self, last: PillarId, apart: [f64; 2]) -> f64 {
        let widest = PillarId(self.widest_nm(last) as u16);
        Square.gap([widest; 2], apart)
    }

    fn words(&self, id: PillarId) -> String {
        let (is_circle, PillarId(width)) = Self::width(id);
        format!(
            "a {} {width} nm wide",
            if is_circle { Circle.name() } else { Square.name() }
        )
    }

    fn cell_name(&self, id: PillarId) -> String {
        let (is_circle, PillarId(width)) = Self::width(id);
        format!("{}{width}", if is_circle { "C" } else { "W" })
    }
}
