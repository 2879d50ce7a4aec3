//! Dense linear equations.

use num_complex::Complex64;

/// Gauss's elimination with partial pivots; the solution takes the place of the right-hand sides. Nothing where a pivot is
/// below `least_pivot`.
pub(crate) fn eliminate<const N: usize>(
    matrix: &mut [Vec<f64>],
    right: &mut [[Complex64; N]],
    least_pivot: f64,
) -> Option<()> {
    let size = matrix.len();
    for column in 0..size {
        let pivot = (column..size)
            .max_by(|&a, &b| matrix[a][column].abs().total_cmp(&matrix[b][column].abs()))
            .expect("rows are left");
        if matrix[pivot][column].abs() < least_pivot {
            return None;
        }
        matrix.swap(column, pivot);
        right.swap(column, pivot);
        let (above, below) = matrix.split_at_mut(column + 1);
        let (right_above, right_below) = right.split_at_mut(column + 1);
        let (own, right_own) = (&above[column], &right_above[column]);
        for (row, right) in below.iter_mut().zip(right_below) {
            let factor = row[column] / own[column];
            if factor == 0.0 {
                continue;
            }
            for (value, own) in row[column..].iter_mut().zip(&own[column..]) {
                *value -= factor * own;
            }
            for (value, own) in right.iter_mut().zip(right_own) {
                *value -= own * factor;
            }
        }
    }
    for row in (0..size).rev() {
        let (left, solved) = right.split_at_mut(row + 1);
        let own = &mut left[row];
        for (solved, factor) in solved.iter().zip(&matrix[row][row + 1..]) {
            for (value, solved) in own.iter_mut().zip(solved) {
                *value -= solved * factor;
            }
        }
        for value in own {
            *value /= matrix[row][row];
        }
    }
    Some(())
}
