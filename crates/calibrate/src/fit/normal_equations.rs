//! Chi-square as a quadratic form, summed over captures.
//!
//! A form over parameters p is kept as the products of whitened columns and of the residual r, which stands
//! last: chi2(p) = r r - 2 p . (C r) + p (C C) p.

use nalgebra::{DMatrix, DVector};

/// Sum of some of the forms.
pub fn sum<'a>(forms: impl IntoIterator<Item = &'a DMatrix<f64>>, size: usize) -> DMatrix<f64> {
    forms.into_iter().fold(DMatrix::zeros(size, size), |sum, f| sum + f)
}

/// The minimum over the parameters in `free`, all others zero: their values, in that order, and chi-square
/// there.
pub fn minimise(form: &DMatrix<f64>, free: &[usize]) -> (DVector<f64>, f64) {
    let last = form.nrows() - 1;
    let n = free.len();
    let a = DMatrix::from_fn(n, n, |i, j| form[(free[i], free[j])]);
    let b = DVector::from_fn(n, |i, _| form[(free[i], last)]);
    let x = solve(a, &b);
    let chi2 = form[(last, last)] - b.dot(&x);
    (x, chi2)
}

/// The form with some parameters held at values: their columns move into the residual.
pub fn held(form: &DMatrix<f64>, at: &[(usize, f64)]) -> DMatrix<f64> {
    let last = form.nrows() - 1;
    let mut move_by = DVector::zeros(form.nrows());
    move_by[last] = 1.0;
    for &(k, value) in at {
        move_by[k] -= value;
    }
    let mut out = form.clone();
    let column = form * &move_by;
    let total = column.dot(&move_by);
    for i in 0..last {
        out[(i, last)] = column[i];
        out[(last, i)] = column[i];
    }
    out[(last, last)] = total;
    out
}

/// Inverse of the products of the parameters in `free`: their covariance where the noise is as stated.
pub fn covariance(form: &DMatrix<f64>, free: &[usize]) -> DMatrix<f64> {
    let n = free.len();
    let a = DMatrix::from_fn(n, n, |i, j| form[(free[i], free[j])]);
    let identity = DMatrix::<f64>::identity(n, n);
    let mut out = DMatrix::zeros(n, n);
    for j in 0..n {
        out.set_column(j, &solve(a.clone(), &identity.column(j).into_owned()));
    }
    out
}

/// Solves by Cholesky with columns brought to one size; what is singular is held by a trace of ridge.
fn solve(mut a: DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = b.len();
    let size: Vec<f64> = (0..n).map(|i| a[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    for i in 0..n {
        for j in 0..n {
            a[(i, j)] /= size[i] * size[j];
        }
    }
    let rhs = DVector::from_fn(n, |i, _| b[i] / size[i]);
    let mut ridge = 1e-12;
    loop {
        let mut held = a.clone();
        for i in 0..n {
            held[(i, i)] += ridge;
        }
        if let Some(c) = held.cholesky() {
            let x = c.solve(&rhs);
            return DVector::from_fn(n, |i, _| x[i] / size[i]);
        }
        if ridge > 1.0 {
            return DVector::zeros(n);
        }
        ridge *= 100.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points() {
        // y = 2 + 3 x exactly, columns 1 and x.
        let columns = [[1.0, 1.0, 1.0], [0.0, 1.0, 2.0], [2.0, 5.0, 8.0]];
        let form = DMatrix::from_fn(3, 3, |i, j| (0..3).map(|k| columns[i][k] * columns[j][k]).sum());
        let (x, chi2) = minimise(&form, &[0, 1]);
        assert!((x[0] - 2.0).abs() < 1e-9 && (x[1] - 3.0).abs() < 1e-9 && chi2.abs() < 1e-9);
        // With the slope held, the intercept is what is left.
        let (x, chi2) = minimise(&held(&form, &[(1, 3.0)]), &[0]);
        assert!((x[0] - 2.0).abs() < 1e-9 && chi2.abs() < 1e-9);
    }
}
