//! Shapes that stand where pillars do and were not understood, in words.

use serde::Serialize;

use super::plan::Extraction;
use super::unrecognised_shapes::UnrecognisedShape;
use metalith_core::LayerNumber;
use metalith_core::text::count;

/// Share of the shapes of elements that may be left out; from there on what is simulated is not what is drawn.
pub const MOST_LEFT_OUT: f64 = 1e-3;

/// Shapes of elements that are no pillars.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// Number of them.
    pub count: u64,
    /// The first of them.
    pub first: UnrecognisedShape,
    /// Number and place, for the first line of output.
    pub words: String,
    /// True if they are [`MOST_LEFT_OUT`] of the shapes or more.
    pub is_much: bool,
}

impl LeftOut {
    /// Shapes of the elements of an extraction that are no pillars; none if all are.
    pub fn of<W>(found: &Extraction<W>, layer: LayerNumber) -> Option<Self> {
        let left_out = found.oddities.in_elements;
        let first = found.oddities.first?;
        let all = found.pillars + left_out;
        let [x, y] = first.centre_nm.map(|nm| nm * 1e-3);
        Some(Self {
            count: left_out,
            first,
            words: format!(
                "not understood: {} of {} shapes on layer {layer} ({}); the first is {} at ({x:.3}, {y:.3}) um",
                count(left_out),
                count(all),
                found.oddities.by_why.words(),
                first.why.words(),
            ),
            is_much: left_out as f64 >= MOST_LEFT_OUT * all as f64,
        })
    }
}
