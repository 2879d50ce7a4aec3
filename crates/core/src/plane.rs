//! Parts of a plane of values.

use std::ops::Range;

use ndarray::{ArrayBase, Axis, Dimension, RawData, Slice};

/// Some rows and columns of a plane, or of all planes behind one another: of a view, a view of them. Rows and columns are its first two
/// axes.
///
/// # Panics
/// If the plane does not have them.
pub fn part<S: RawData, D: Dimension>(
    plane: ArrayBase<S, D>,
    rows: Range<usize>,
    columns: Range<usize>,
) -> ArrayBase<S, D> {
    let mut plane = plane;
    plane.slice_axis_inplace(Axis(0), Slice::from(rows));
    plane.slice_axis_inplace(Axis(1), Slice::from(columns));
    plane
}
