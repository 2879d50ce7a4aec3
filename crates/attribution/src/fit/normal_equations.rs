//! Normal equations of linear least squares: chi-square as a quadratic form, summed over measurements.
//!
//! With whitened columns C and residual r, a form is the matrix of inner products of [C r]; the residual stands
//! last: chi2(p) = r.r - 2 p.(C'r) + p.(C'C)p. Forms of independent data add.

use nalgebra::{DMatrix, DVector};

use crate::index::PerMeasurement;

/// Half of a 95 % interval in standard deviations, as it is rounded in reports.
pub const SIGMAS_95: f64 = 2.0;

/// The forms of all data over the same columns: shared nuisances, further parameters, residual.
#[derive(Clone)]
pub struct NormalEquations {
    /// Of each measurement, its own nuisances eliminated.
    pub measurements: PerMeasurement<DMatrix<f64>>,
    /// Of the reference values, their common offset eliminated.
    pub references: DMatrix<f64>,
}

impl NormalEquations {
    /// Rows of a form: the number of columns and one for the residual.
    pub fn size(&self) -> usize {
        self.references.nrows()
    }

    /// Sum over the measurements in `used` and the reference values.
    pub fn sum(&self, used: &PerMeasurement<bool>) -> DMatrix<f64> {
        let counted = self.measurements.iter().zip(used).filter(|(_, used)| **used);
        sum(counted.map(|(f, _)| f).chain([&self.references]), self.size())
    }

    /// Sum over some measurements.
    pub fn sum_of<'a, I>(&self, measurements: I) -> DMatrix<f64>
    where
        I: IntoIterator<Item = &'a crate::index::MeasurementIndex>,
    {
        sum(measurements.into_iter().map(|m| &self.measurements[*m]), self.size())
    }

    /// The forms over other columns: each new column is a combination of old ones, the columns of `mix`.
    #[must_use]
    pub fn mixed(&self, mix: &DMatrix<f64>) -> Self {
        let mixed = |f: &DMatrix<f64>| mix.transpose() * f * mix;
        Self {
            measurements: self.measurements.iter().map(mixed).collect(),
            references: mixed(&self.references),
        }
    }

    /// Chi-square of the reference values at the present parameters.
    pub fn references_chi2(&self) -> f64 {
        let last = self.size() - 1;
        self.references[(last, last)]
    }
}

fn sum<'a>(forms: impl IntoIterator<Item = &'a DMatrix<f64>>, size: usize) -> DMatrix<f64> {
    forms.into_iter().fold(DMatrix::zeros(size, size), |sum, f| sum + f)
}

/// The minimum over the parameters in `free`, all others zero: their values in that order, and chi-square there.
pub fn minimise(form: &DMatrix<f64>, free: &[usize]) -> (DVector<f64>, f64) {
    let last = form.nrows() - 1;
    let n = free.len();
    let a = DMatrix::from_fn(n, n, |i, j| form[(free[i], free[j])]);
    let b = DVector::from_fn(n, |i, _| form[(free[i], last)]);
    let x = solve(a, &b);
    let chi2 = form[(last, last)] - b.dot(&x);
    (x, chi2)
}

/// The form with some parameters held at given values: their columns move into the residual.
pub(crate) fn hold(form: &DMatrix<f64>, at: &[(usize, f64)]) -> DMatrix<f64> {
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

/// Covariance of the parameters in `free` where the noise is as stated: the inverse of their inner products.
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

/// The inner products of all columns but the shared nuisances and the residual, with the nuisances projected out.
pub fn projected(form: &DMatrix<f64>, shared: usize) -> DMatrix<f64> {
    let n = form.nrows() - 1 - shared;
    let nuisances = form.view((0, 0), (shared, shared)).into_owned();
    let cross = form.view((0, shared), (shared, n)).into_owned();
    let inverse = nuisances
        .try_inverse()
        .unwrap_or_else(|| DMatrix::zeros(shared, shared));
    form.view((shared, shared), (n, n)) - cross.transpose() * inverse * &cross
}

/// Ridge that keeps a singular system solvable, relative to columns of norm one; far below any precision of the
/// data.
const RIDGE: f64 = 1e-12;

/// Cholesky decomposition with columns normalised; a ridge is added, and raised while the system is singular.
fn solve(mut a: DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = b.len();
    let size: Vec<f64> = (0..n).map(|i| a[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    for i in 0..n {
        for j in 0..n {
            a[(i, j)] /= size[i] * size[j];
        }
    }
    let rhs = DVector::from_fn(n, |i, _| b[i] / size[i]);
    let mut ridge = RIDGE;
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
        /// Absolute, of values of a few: the ridge of 1e-12 times the condition of the line.
        const TOLERANCE: f64 = 1e-9;
        // y = 2 + 3 x exactly, columns 1 and x.
        let columns = [[1.0, 1.0, 1.0], [0.0, 1.0, 2.0], [2.0, 5.0, 8.0]];
        let form = DMatrix::from_fn(3, 3, |i, j| (0..3).map(|k| columns[i][k] * columns[j][k]).sum());
        let (x, chi2) = minimise(&form, &[0, 1]);
        assert!((x[0] - 2.0).abs() < TOLERANCE && (x[1] - 3.0).abs() < TOLERANCE && chi2.abs() < TOLERANCE);
        // With the slope held, the intercept alone is fitted.
        let (x, chi2) = minimise(&hold(&form, &[(1, 3.0)]), &[0]);
        assert!((x[0] - 2.0).abs() < TOLERANCE && chi2.abs() < TOLERANCE);
    }
}
