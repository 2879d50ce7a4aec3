//! Smooth surfaces through scattered values over the plane of grating vectors.

use nalgebra::DMatrix;
use num_complex::Complex64;

use metalith_core::{Error, Result};

use crate::linear::solve;

/// The cubic spline in two dimensions: sum of |K - K_i|^3 weights and a plane through places K_i, by solving the dense
/// equations (Duchon 1977; Wendland, Scattered Data Approximation, 2004, chapter 8).
#[derive(Clone, Debug)]
pub struct Surface<const N: usize> {
    places: Vec<[f64; 2]>,
    /// Weight of each place, then constant and slopes of the plane.
    weights: Vec<[Complex64; N]>,
}

/// Pivots below this are those of a singular matrix: distances between places are 0.01 to 1.
const LEAST_PIVOT: f64 = 1e-12;

/// Unknowns of the plane.
const PLANE: usize = 3;

impl<const N: usize> Surface<N> {
    /// The surface through values at places; with `smoothing` above zero, near them: it is added to the diagonal of
    /// the equations, where the cubes of distances stand elsewhere.
    ///
    /// # Errors
    /// If places coincide, or all lie on a line.
    pub fn through(places: &[[f64; 2]], values: &[[Complex64; N]], smoothing: f64) -> Result<Self> {
        let n = places.len();
        let size = n + PLANE;
        let mut matrix = DMatrix::zeros(size, size);
        for (i, a) in places.iter().enumerate() {
            for (j, b) in places.iter().enumerate() {
                matrix[(i, j)] = cube(a, b);
            }
            matrix[(i, i)] += smoothing;
            for (k, value) in plane(a).into_iter().enumerate() {
                matrix[(i, n + k)] = value;
                matrix[(n + k, i)] = value;
            }
        }
        let mut weights = values.to_vec();
        weights.resize(size, [Complex64::ZERO; N]);
        solve(matrix, &mut weights, LEAST_PIVOT).ok_or_else(|| {
            Error::refused(
                "grating/vectors",
                "grating vectors that coincide or lie on one line",
                "give at least three that span the plane",
            )
        })?;
        Ok(Self {
            places: places.to_vec(),
            weights,
        })
    }

    /// Its values at a place.
    pub fn at(&self, place: [f64; 2]) -> [Complex64; N] {
        let kernels = self.places.iter().map(|own| cube(own, &place)).chain(plane(&place));
        let mut sum = [Complex64::ZERO; N];
        for (kernel, weights) in kernels.zip(&self.weights) {
            for (sum, weight) in sum.iter_mut().zip(weights) {
                *sum += weight * kernel;
            }
        }
        sum
    }
}

fn cube(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1]).powi(3)
}

fn plane([x, y]: &[f64; 2]) -> [f64; PLANE] {
    [1.0, *x, *y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_reproduced_and_values_met() {
        let places = [[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.13, 0.08], [0.05, 0.21]];
        let value = |[x, y]: [f64; 2]| [Complex64::new(1.0 + 2.0 * x, 3.0 * y - x), Complex64::I];
        let surface = Surface::through(&places, &places.map(value), 1e-4).unwrap();
        for place in [[0.03, 0.04], [0.2, -0.1]] {
            let (found, wanted) = (surface.at(place), value(place));
            for (f, w) in found.iter().zip(wanted) {
                assert!((f - w).norm() < 1e-10, "{f} {w}");
            }
        }
        let mut values = places.map(value);
        values[3][0] += 1.0;
        let surface = Surface::through(&places, &values, 0.0).unwrap();
        assert!((surface.at(places[3])[0] - values[3][0]).norm() < 1e-10);
    }

    #[test]
    fn places_on_a_line_are_refused() {
        let line = [[0.0, 0.0], [0.1, 0.1], [0.2, 0.2], [0.3, 0.3]];
        assert!(Surface::through(&line, &[[Complex64::ONE]; 4], 0.0).is_err());
    }
}
