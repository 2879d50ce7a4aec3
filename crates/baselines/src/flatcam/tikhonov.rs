//! Tikhonov's solution of Y = A X B^T in closed form, by singular values of A and of B.

use faer::Mat;
use metalith_core::{Error, Result};
use ndarray::{Array2, ArrayView2};

/// Correlation of neighbouring pixels of a picture that is expected beforehand, along each axis: with it slopes are those of
/// photographs, 0.075 (root mean square) for a deviation of a quarter.
const CORRELATION: f64 = 0.95;

/// The way from places of a scene to pixels along one axis, decomposed.
pub(crate) struct Factor {
    /// `[pixel, mode]`.
    left: Mat<f64>,
    values: Vec<f64>,
    /// Modes as pictures: `[place, mode]`.
    right: Mat<f64>,
}

impl Factor {
    /// Factor of every second pixel from the first on: those that count one channel.
    ///
    /// # Errors
    /// If the decomposition fails.
    pub(crate) fn new(all: &Mat<f64>, first: usize) -> Result<Self> {
        let places = all.ncols();
        let root = correlated(places);
        let own = Mat::from_fn((all.nrows() - first).div_ceil(2), places, |i, j| {
            all[(2 * i + first, j)]
        });
        let svd = (&own * &root).thin_svd().map_err(|e| {
            Error::refused(
                "flatcam/svd-failed",
                format!("the singular values of the mask were not found: {e:?}"),
                "use another size of the scene",
            )
        })?;
        Ok(Self {
            left: svd.U().to_owned(),
            values: svd.S().column_vector().iter().copied().collect(),
            right: &root * svd.V(),
        })
    }
}

/// A root of the covariance of a line of pixels with this correlation of neighbours: lower triangle.
fn correlated(n: usize) -> Mat<f64> {
    let new = (1.0 - CORRELATION * CORRELATION).sqrt();
    Mat::from_fn(n, n, |i, j| {
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
        let y = Mat::from_fn(pixels.nrows(), pixels.ncols(), |i, j| f64::from(pixels[[i, j]]));
        let modes = self.down.left.transpose() * y * &self.across.left;
        let largest = self.down.values[0] * self.across.values[0];
        let solved = |strength: &f64| {
            let noise = strength * largest * largest;
            let filtered = Mat::from_fn(modes.nrows(), modes.ncols(), |i, j| {
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
        let a = Mat::from_fn(40, n, |i, j| f64::from(u8::from((i * 7 + j * 5) % 11 < 5)));
        let b = Mat::from_fn(36, n, |i, j| f64::from(u8::from((i * 3 + j * 8) % 13 < 6)));
        let pixels = Array2::from_shape_fn((20, 18), |(i, j)| ((i * 5 + j * 3) % 17) as f32 / 17.0);
        let two = TwoFactors::new(Factor::new(&a, 1).unwrap(), Factor::new(&b, 0).unwrap());
        let strength = 1e-3;
        let x = two.solve(&pixels.view(), &[strength]).remove(0);
        let noise = strength * (two.down.values[0] * two.across.values[0]).powi(2);
        // A* (Y - A X B^T) B = noise C1^-1 X C2^-1, multiplied by both covariances.
        let own = |m: &Mat<f64>, first: usize, rows: usize| Mat::from_fn(rows, n, |i, j| m[(2 * i + first, j)]);
        let (a, b) = (own(&a, 1, 20), own(&b, 0, 18));
        let picture = Mat::from_fn(n, n, |i, j| f64::from(x[[i, j]]));
        let seen = Mat::from_fn(20, 18, |i, j| f64::from(pixels[[i, j]])) - &a * &picture * b.transpose();
        let root = correlated(n);
        let covariance = &root * root.transpose();
        let left = &covariance * a.transpose() * seen * &b * &covariance;
        let most = picture.norm_max() * noise;
        for i in 0..n {
            for j in 0..n {
                let off = left[(i, j)] - noise * picture[(i, j)];
                assert!(off.abs() < ROUNDING * most * 1e2, "{off} {most}");
            }
        }
    }
}
