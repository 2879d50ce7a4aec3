//! Parts of a plane of values.

use std::ops::Range;

use ndarray::{ArrayBase, Axis, Ix2, RawData, Slice};

/// Some rows and columns of a plane: of a view, a view of them.
///
/// # Panics
/// If the plane does not have them.
pub fn part<S: RawData>(plane: ArrayBase<S, Ix2>, rows: Range<usize>, columns: Range<usize>) -> ArrayBase<S, Ix2> {
    let mut plane = plane;
    plane.slice_axis_inplace(Axis(0), Slice::from(rows));
    plane.slice_axis_inplace(Axis(1), Slice::from(columns));
    plane
}
