//! Upright squares, which differ by their width.

use crate::kind::{OutlineForm, PillarId, PillarKind, PolarisationBasis, Quantity, WIDTH};

/// Upright squares; the width is the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square;

impl Square {
    /// Distance of two squares with these edges whose centres are (dx, dy) apart, all in one unit; negative where they overlap.
    pub fn gap_of_widths(widths: [f64; 2], [dx, dy]: [f64; 2]) -> f64 {
        let reach = 0.5 * (widths[0] + widths[1]);
        let (x, y) = (dx.abs() - reach, dy.abs() - reach);
        if x > 0.0 && y > 0.0 { x.hypot(y) } else { x.max(y) }
    }
}

impl PillarKind for Square {
    fn name(&self) -> &'static str {
        "square"
    }

    fn plural(&self) -> &'static str {
        "squares"
    }

    fn design_name(&self) -> &'static str {
        "square"
    }

    #[inline]
    fn outline(&self) -> OutlineForm {
        OutlineForm::Square
    }

    fn basis(&self) -> Option<PolarisationBasis> {
        None
    }

    #[inline]
    fn has_width(&self) -> bool {
        true
    }

    fn last(&self) -> Option<PillarId> {
        None
    }

    fn edge_range_nm(&self) -> Option<(u16, u16)> {
        None
    }

    #[inline]
    fn edges_nm(&self, PillarId(width): PillarId) -> [u16; 2] {
        [width; 2]
    }

    fn axis_edges_nm(&self, PillarId(width): PillarId) -> Vec<u16> {
        vec![width]
    }

    fn corners(&self, PillarId(width): PillarId, _chord_error_nm: f64) -> Vec<(i64, i64)> {
        let h = i64::from(width) / 2;
        vec![(-h, -h), (h, -h), (h, h), (-h, h)]
    }

    fn reach(&self, PillarId(width): PillarId) -> (i64, i64) {
        (i64::from(width) / 2, i64::from(width) / 2)
    }

    #[inline]
    fn half_nm(&self, PillarId(width): PillarId) -> [f64; 2] {
        [f64::from(width) / 2.0; 2]
    }

    fn widest_nm(&self, PillarId(width): PillarId) -> f64 {
        f64::from(width)
    }

    #[inline]
    fn gap(&self, pair: [PillarId; 2], apart: [f64; 2]) -> f64 {
        Self::gap_of_widths(pair.map(|PillarId(width)| f64::from(width)), apart)
    }

    fn least_gap(&self, last: PillarId, apart: [f64; 2]) -> f64 {
        self.gap([last; 2], apart)
    }

    fn keeps(&self, _mirrored: bool, _quarter_turns: u8) -> bool {
        true
    }

    fn words(&self, PillarId(width): PillarId) -> String {
        format!("{width} nm wide")
    }

    fn cell_name(&self, PillarId(width): PillarId) -> String {
        format!("W{width}")
    }

    fn quantity(&self) -> Quantity {
        WIDTH
    }

    fn value(&self, PillarId(width): PillarId) -> f64 {
        f64::from(width)
    }

    fn step(&self) -> Option<f64> {
        None
    }

    fn solver_revision(&self) -> u32 {
        0
    }
}
