//! Tikhonov's solution of Y = A X B^T in closed form, by singular values of A and of B.

use metalith_core::{Error, Result};
use nalgebra::DMatrix;
use ndarray::{Array2, ArrayView2};

/// Correlation of neighbouring pixels of a picture that is expected beforehand, along each axis: with it slopes are those of
/// photographs, 0.075 (root mean square) for a deviation of a quarter.
const CORRELATION: f64 = 0.95;

/// Most sweeps of a decomposition; some for each singular value are enough.
const MOST_SWEEPS: usize = 100_000;

/// The way from places of a scene to pixels along one axis, decomposed.
pub(crate) struct Factor {
    /// `[pixel, mode]`.
    left: DMatrix<f64>,
    values: Vec<f64>,
    /// Modes as pictures: `[place, mode]`.
    right: DMatrix<f64>,
}

impl Factor {
    /// Factor of every second pixel from the first on: those that count one channel.
    ///
    /// # Errors
    /// If the decomposition fails.
    pub(crate) fn new(all: &DMatrix<f64>, first: usize) -> Result<Self> {
        let places = all.ncols();
        let root = correlated(places);
        let own = DMatrix::from_fn((all.nrows() - first).div_ceil(2), places, |i, j| {
            all[(2 * i + first, j)]
        });
        let refused = || {
            Error::refused(
                "flatcam/svd-failed",
                "the singular values of the mask were not found",
                "use another size of the scene",
            )
        };
        let svd = (own * &root)
            .try_svd(true, true, f64::EPSILON, MOST_SWEEPS)
            .ok_or_else(refused)?;
        let (left, right) = svd.u.zip(svd.v_t).ok_or_else(refused)?;
        Ok(Self {
            left,
            values: svd.singular_values.iter().copied().collect(),
            right: root * right.transpose(),
        })
    }
}

/// A root of the covariance of a line of pixels with this correlation of neighbours: lower triangle.
fn correlated(n: usize) -> DMatrix<f64> {
    let new = (1.0 - CORRELATION * CORRELATION).sqrt();
    DMatrix::from_fn(n, n, |i, j| {
        if i >= j {
            CORRELATION.powi((i - j) as i32) * if j == 0 { 1.0 } else { new }
        } else {
            0.0
        }
    })
}

/// Factors of both axes.
pub(crate) struct TwoFactors {
    down: Factor,
    across: Factor,
}

impl TwoFactors {
    /// Along columns of the frame, and along its rows.
    pub(crate) fn new(down: Factor, across: Factor) -> Self {
        Self { down, across }
    }

    /// The picture X that is likeliest for pixels Y, if both are normal: noise of one variance, and a picture whose
    /// covariance is a product of both axes. `strength` is the noise over the picture, of the largest singular value, squared.
    /// One picture for each strength.
    pub(crate) fn solve(&self, pixels: &ArrayView2<'_, f32>, strengths: &[f64]) -> Vec<Array2<f32>> {
        let y = DMatrix::from_fn(pixels.nrows(), pixels.ncols(), |i, j| f64::from(pixels[[i, j]]));
        let modes = self.down.left.transpose() * y * &self.across.left;
        let largest = self.down.values[0] * self.across.values[0];
        let solved = |strength: &f64| {
            let noise = strength * largest * largest;
            let filtered = DMatrix::from_fn(modes.nrows(), modes.ncols(), |i, j| {
                let s = self.down.values[i] * self.across.values[j];
                modes[(i, j)] * s / (s * s + noise)
            });
            let picture = &self.down.right * filtered * self.across.right.transpose();
            Array2::from_shape_fn((picture.nrows(), picture.ncols()), |at| picture[at] as f32)
        };
        strengths.iter().map(solved).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closed_form_solves_its_normal_equations() {
        /// Rounding, of a result in single precision.
        const ROUNDING: f64 = 1e-5;
        let n = 12;
        let a = DMatrix::from_fn(40, n, |i, j| f64::from(u8::from((i * 7 + j * 5) % 11 < 5)));
        let b = DMatrix::from_fn(36, n, |i, j| f64::from(u8::from((i * 3 + j * 8) % 13 < 6)));
        let pixels = Array2::from_shape_fn((20, 18), |(i, j)| ((i * 5 + j * 3) % 17) as f32 / 17.0);
        let two = TwoFactors::new(Factor::new(&a, 1).unwrap(), Factor::new(&b, 0).unwrap());
        let strength = 1e-3;
        let x = two.solve(&pixels.view(), &[strength]).remove(0);
        let noise = strength * (two.down.values[0] * two.across.values[0]).powi(2);
        // A* (Y - A X B^T) B = noise C1^-1 X C2^-1, multiplied by both covariances.
        let own = |m: &DMatrix<f64>, first: usize, rows: usize| DMatrix::from_fn(rows, n, |i, j| m[(2 * i + first, j)]);
        let (a, b) = (own(&a, 1, 20), own(&b, 0, 18));
        let picture = DMatrix::from_fn(n, n, |i, j| f64::from(x[[i, j]]));
        let seen = DMatrix::from_fn(20, 18, |i, j| f64::from(pixels[[i, j]])) - &a * &picture * b.transpose();
        let root = correlated(n);
        let covariance = &root * root.transpose();
        let left = &covariance * a.transpose() * seen * &b * &covariance;
        let most = picture.amax() * noise;
        for i in 0..n {
            for j in 0..n {
                let off = left[(i, j)] - noise * picture[(i, j)];
                assert!(off.abs() < ROUNDING * most * 1e2, "{off} {most}");
            }
        }
    }
}
