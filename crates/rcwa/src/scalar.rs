//! Numbers that the operators of a layer are made of: real where nothing absorbs, complex elsewhere.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, evd_cplx, evd_real, evd_scratch};
use faer::prelude::default;
use faer::{Mat, MatRef, Par};
use num_complex::Complex64;

use super::{Error, Result};

/// Number type that the layers need.
pub(super) trait Scalar:
    faer::traits::ComplexField
    + Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// The number itself, or its real part where only real numbers are at hand.
    fn of(value: Complex64) -> Self;

    fn real(value: f64) -> Self {
        Self::of(Complex64::new(value, 0.0))
    }

    /// Eigenvalues and right eigenvectors.
    fn eigen(matrix: MatRef<'_, Self>) -> Result<Eigen<Self>>;

    /// The complex matrix that `packed` stands for: the columns of a conjugate pair of a real matrix
    /// hold real and imaginary part. Linear maps of packed columns may be done before unpacking.
    fn unpack(packed: Mat<Self>, values: &[Complex64]) -> Mat<Complex64>;
}

/// Eigenvalues, and eigenvectors as [`Scalar::unpack`] takes them.
pub(super) struct Eigen<T> {
    pub values: Vec<Complex64>,
    pub packed: Mat<T>,
}

fn no_convergence<E: std::fmt::Debug>(error: E) -> Error {
    Error::NoModes {
        reason: format!("{error:?}"),
    }
}

impl Scalar for f64 {
    fn of(value: Complex64) -> Self {
        value.re
    }

    fn eigen(matrix: MatRef<'_, Self>) -> Result<Eigen<Self>> {
        let n = matrix.nrows();
        let mut packed = Mat::zeros(n, n);
        let (mut re, mut im) = (Diag::zeros(n), Diag::zeros(n));
        let need = evd_scratch::<Self>(
            n,
            ComputeEigenvectors::No,
            ComputeEigenvectors::Yes,
            Par::Seq,
            default(),
        );
        evd_real(
            matrix,
            re.as_mut(),
            im.as_mut(),
            None,
            Some(packed.as_mut()),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(need)),
            default(),
        )
        .map_err(no_convergence)?;
        let values = (0..n).map(|i| Complex64::new(re[i], im[i])).collect();
        Ok(Eigen { values, packed })
    }

    fn unpack(packed: Mat<Self>, values: &[Complex64]) -> Mat<Complex64> {
        let n = packed.nrows();
        Mat::from_fn(n, values.len(), |i, j| {
            let im = values[j].im;
            if im == 0.0 {
                Complex64::new(packed[(i, j)], 0.0)
            } else if im > 0.0 {
                Complex64::new(packed[(i, j)], packed[(i, j + 1)])
            } else {
                Complex64::new(packed[(i, j - 1)], -packed[(i, j)])
            }
        })
    }
}

impl Scalar for Complex64 {
    fn of(value: Complex64) -> Self {
        value
    }

    fn eigen(matrix: MatRef<'_, Self>) -> Result<Eigen<Self>> {
        let n = matrix.nrows();
        let mut packed = Mat::zeros(n, n);
        let mut s = Diag::zeros(n);
        let need = evd_scratch::<Self>(
            n,
            ComputeEigenvectors::No,
            ComputeEigenvectors::Yes,
            Par::Seq,
            default(),
        );
        evd_cplx(
            matrix,
            s.as_mut(),
            None,
            Some(packed.as_mut()),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(need)),
            default(),
        )
        .map_err(no_convergence)?;
        let values = (0..n).map(|i| s[i]).collect();
        Ok(Eigen { values, packed })
    }

    fn unpack(packed: Mat<Self>, _values: &[Complex64]) -> Mat<Complex64> {
        packed
    }
}
