//! A spectral cube as a few planes, each with a spectrum.

use nalgebra::{DMatrix, SymmetricEigen};
use ndarray::{Array2, Array3};

use crate::spectra::SceneSpectrum;

/// Most planes that a cube becomes.
const MOST_PLANES: usize = 6;
/// Share of the light, root mean square, below which no more planes are taken.
const ENOUGH: f64 = 2e-3;

/// Planes and spectra whose products add up to a cube `[row, column, band]` with the least square error, and the share
/// that they leave out (root mean square): its principal components, the mean kept.
pub(super) fn planes(cube: &Array3<f64>, nm: &[f64]) -> (Vec<SceneSpectrum>, Vec<Array2<f32>>, f64) {
    let bands = nm.len();
    let (rows, columns, _) = cube.dim();
    let mut moment = DMatrix::<f64>::zeros(bands, bands);
    for pixel in cube.rows() {
        for i in 0..bands {
            for j in i..bands {
                moment[(i, j)] += pixel[i] * pixel[j];
            }
        }
    }
    moment.fill_lower_triangle_with_upper_triangle();
    let all = moment.trace().max(f64::MIN_POSITIVE);
    let eigen = SymmetricEigen::new(moment);
    let mut order: Vec<usize> = (0..bands).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let (mut spectra, mut found, mut left) = (Vec::new(), Vec::new(), all);
    for k in order.into_iter().take(MOST_PLANES.min(bands)) {
        if (left / all).sqrt() < ENOUGH {
            break;
        }
        left = (left - eigen.eigenvalues[k]).max(0.0);
        let spectrum = eigen.eigenvectors.column(k);
        // Of a size near one, so that planes are of the size of the light.
        let scale = spectrum.amax().max(f64::MIN_POSITIVE) * spectrum.sum().signum();
        found.push(Array2::from_shape_fn((rows, columns), |(y, x)| {
            ((0..bands).map(|b| cube[[y, x, b]] * spectrum[b]).sum::<f64>() * scale) as f32
        }));
        spectra.push(SceneSpectrum {
            nm: nm.to_vec(),
            values: spectrum.iter().map(|v| v / scale).collect(),
        });
    }
    (spectra, found, (left / all).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_of_two_spectra_needs_two_planes() {
        // Single precision of the planes.
        const SINGLE: f64 = 1e-5;
        let nm: Vec<f64> = (0..12).map(|i| 400.0 + 25.0 * f64::from(i)).collect();
        let cube = Array3::from_shape_fn((5, 7, 12), |(y, x, b)| {
            (1.0 + y as f64) * (0.3 + 0.05 * b as f64) + x as f64 * (-0.1 * (b as f64 - 6.0).powi(2)).exp()
        });
        let (spectra, planes, left) = planes(&cube, &nm);
        assert_eq!(spectra.len(), 2);
        assert!(left < SINGLE);
        for ((y, x, b), want) in cube.indexed_iter() {
            let got: f64 = spectra
                .iter()
                .zip(&planes)
                .map(|(s, p)| s.values[b] * f64::from(p[[y, x]]))
                .sum();
            assert!((got - want).abs() < SINGLE * 10.0, "{got} {want}");
        }
    }
}
