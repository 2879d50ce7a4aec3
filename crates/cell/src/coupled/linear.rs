//! Dense linear equations.

use nalgebra::DMatrix;
use num_complex::Complex64;

/// Solves with partial pivoting; the solution takes the place of the right-hand sides. Nothing where a pivot is below
/// `least_pivot`.
pub(crate) fn solve<const N: usize>(
    matrix: DMatrix<f64>,
    right: &mut [[Complex64; N]],
    least_pivot: f64,
) -> Option<()> {
    let lu = matrix.lu();
    let pivots = lu.u().diagonal();
    if !pivots.iter().all(|pivot| pivot.abs() >= least_pivot) {
        return None;
    }
    // Real and imaginary parts are separate columns.
    let columns = DMatrix::from_fn(right.len(), 2 * N, |row, column| {
        let value = right[row][column / 2];
        if column % 2 == 0 { value.re } else { value.im }
    });
    let solved = lu.solve(&columns)?;
    for (row, right) in right.iter_mut().enumerate() {
        *right = std::array::from_fn(|k| Complex64::new(solved[(row, 2 * k)], solved[(row, 2 * k + 1)]));
    }
    Some(())
}
