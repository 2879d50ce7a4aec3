//! Upright squares, which differ by their width.

use crate::kind::{OutlineForm, PillarId, PillarKind};

/// Upright squares; the width is the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square;

impl PillarKind for Square {
    fn name(&self) -> &'static str {
        "square"
    }

    fn plural(&self) -> &'static str {
        "squares"
    }

    fn four_corners(&self, PillarId(width): PillarId) -> Option<[(i64, i64); 4]> {
        let h = i64::from(width) / 2;
        Some([(-h, -h), (h, -h), (h, h), (-h, h)])
    }

    #[inline]
    fn outline(&self) -> OutlineForm {
        OutlineForm::Square
    }
}
