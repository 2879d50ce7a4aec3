//! Spectra of the pixels of a picture.
//!
//! Red, green and blue become reflectances by a basis of the kind of Mallett and Yuksel, Spectral Primary Decomposition
//! for Rendering with sRGB Reflectance, Eurographics Symposium on Rendering (2019): three curves, each not negative, that
//! add up to one at every wavelength and are as smooth as they can be while each has, in D65, the colour of its primary.
//! They are solved for here, for the observer of [`metalith_sensor::observer`].

use std::sync::OnceLock;

use metalith_sensor::{Illuminant, observer};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::Serialize;

/// A curve of the scene over wavelength: straight lines between its samples, and level beyond them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneSpectrum {
    pub nm: Vec<f64>,
    pub values: Vec<f64>,
}

impl SceneSpectrum {
    /// Value at a wavelength (nm).
    pub fn at(&self, nm: f64) -> f64 {
        let after = self.nm.partition_point(|at| *at <= nm);
        match (after.checked_sub(1), self.nm.get(after)) {
            (Some(i), Some(next)) => {
                let share = (nm - self.nm[i]) / (next - self.nm[i]);
                self.values[i] * (1.0 - share) + self.values[after] * share
            }
            (Some(i), None) => self.values[i],
            (None, _) => self.values[0],
        }
    }
}

const FIRST_NM: f64 = 380.0;
const STEP_NM: f64 = 10.0;
const SAMPLES: usize = 41;

/// Chromaticities of the primaries of sRGB (IEC 61966-2-1).
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Reflectances whose sums have the colours of sRGB in daylight: of red, green and blue.
pub fn rgb_basis() -> &'static [SceneSpectrum; 3] {
    static BASIS: OnceLock<[SceneSpectrum; 3]> = OnceLock::new();
    BASIS.get_or_init(solve)
}

/// Linear sRGB of a reflectance in D65, white being one.
pub fn linear_rgb(reflectance: impl Fn(f64) -> f64) -> [f64; 3] {
    let rows = colour_rows();
    let xyz = Vector3::from_fn(|c, _| {
        (0..SAMPLES)
            .map(|i| rows[(c, i)] * reflectance(wavelength(i)))
            .sum::<f64>()
    });
    let rgb = from_xyz(&rows) * xyz;
    [rgb[0], rgb[1], rgb[2]]
}

fn wavelength(i: usize) -> f64 {
    FIRST_NM + STEP_NM * i as f64
}

/// Tristimulus values of a reflectance in D65, as rows over its samples.
fn colour_rows() -> DMatrix<f64> {
    let mut rows = DMatrix::from_fn(3, SAMPLES, |c, i| {
        let nm = wavelength(i);
        Illuminant::D65.power(nm) * observer(nm)[c]
    });
    let white: f64 = rows.row(1).sum();
    rows /= white;
    rows
}

/// Matrix from tristimulus values to linear sRGB whose white is the white of a flat reflectance.
fn from_xyz(rows: &DMatrix<f64>) -> Matrix3<f64> {
    let primaries = Matrix3::from_fn(|c, p| {
        let [x, y] = PRIMARIES[p];
        [x, y, 1.0 - x - y][c] / y
    });
    let white = Vector3::from_fn(|c, _| rows.row(c).sum());
    let inverse = primaries.try_inverse().expect("primaries are independent");
    let share = inverse * white;
    Matrix3::from_diagonal(&share.map(|s| 1.0 / s)) * inverse
}

/// The least sum of squared steps of all three curves, with their colours and their sum as stated and none negative: by
/// the alternating direction method of multipliers; then exactly, with what came out as zero held there.
fn solve() -> [SceneSpectrum; 3] {
    let n = 3 * SAMPLES;
    let rows = colour_rows();
    let to_rgb = from_xyz(&rows);
    let rgb = DMatrix::from_fn(3, SAMPLES, |c, i| (0..3).map(|k| to_rgb[(c, k)] * rows[(k, i)]).sum());
    let mut smooth = DMatrix::zeros(n, n);
    for b in 0..3 {
        for i in 0..SAMPLES - 1 {
            let (p, q) = (b * SAMPLES + i, b * SAMPLES + i + 1);
            smooth[(p, p)] += 1.0;
            smooth[(q, q)] += 1.0;
            smooth[(p, q)] -= 1.0;
            smooth[(q, p)] -= 1.0;
        }
    }
    // Colours of red and green, and the sum at each wavelength; the colour of blue follows from both.
    let mut equal = DMatrix::zeros(6 + SAMPLES, n);
    let mut wanted = DVector::zeros(6 + SAMPLES);
    for b in 0..2 {
        for c in 0..3 {
            for i in 0..SAMPLES {
                equal[(3 * b + c, b * SAMPLES + i)] = rgb[(c, i)];
            }
            wanted[3 * b + c] = f64::from(u8::from(b == c));
        }
    }
    for i in 0..SAMPLES {
        for b in 0..3 {
            equal[(6 + i, b * SAMPLES + i)] = 1.0;
        }
        wanted[6 + i] = 1.0;
    }
    let positive = least(&smooth, &equal, &wanted);
    let zero: Vec<usize> = (0..n).filter(|i| positive[*i] < NOTHING).collect();
    let mut held = DMatrix::zeros(equal.nrows() + zero.len(), n);
    held.rows_mut(0, equal.nrows()).copy_from(&equal);
    let mut values = DVector::zeros(held.nrows());
    values.rows_mut(0, equal.nrows()).copy_from(&wanted);
    for (k, i) in zero.iter().enumerate() {
        held[(equal.nrows() + k, *i)] = 1.0;
    }
    let exact = with_equalities(&smooth, &held, &DVector::zeros(n), &values, 0.0);
    let curve = |b: usize| SceneSpectrum {
        nm: (0..SAMPLES).map(wavelength).collect(),
        values: (0..SAMPLES).map(|i| exact[b * SAMPLES + i].max(0.0)).collect(),
    };
    [curve(0), curve(1), curve(2)]
}

/// Reflectances below it are taken to be held at zero.
const NOTHING: f64 = 1e-4;

/// Minimum of x P x / 2 with G x = h and x not negative.
fn least(smooth: &DMatrix<f64>, equal: &DMatrix<f64>, wanted: &DVector<f64>) -> DVector<f64> {
    const PENALTY: f64 = 0.05;
    const ROUNDS: usize = 4000;
    let n = smooth.nrows();
    let inverse = kkt(smooth, equal, PENALTY);
    let (mut split, mut price) = (DVector::zeros(n), DVector::zeros(n));
    for _ in 0..ROUNDS {
        let mut right = DVector::zeros(n + equal.nrows());
        right.rows_mut(0, n).copy_from(&((&split - &price) * PENALTY));
        right.rows_mut(n, equal.nrows()).copy_from(wanted);
        let x = (&inverse * right).rows(0, n).into_owned();
        split = (&x + &price).map(|v: f64| v.max(0.0));
        price += x - &split;
    }
    split
}

fn with_equalities(
    smooth: &DMatrix<f64>,
    equal: &DMatrix<f64>,
    linear: &DVector<f64>,
    wanted: &DVector<f64>,
    penalty: f64,
) -> DVector<f64> {
    let n = smooth.nrows();
    let mut right = DVector::zeros(n + equal.nrows());
    right.rows_mut(0, n).copy_from(linear);
    right.rows_mut(n, equal.nrows()).copy_from(wanted);
    (kkt(smooth, equal, penalty) * right).rows(0, n).into_owned()
}

/// Inverse of the system of first-order conditions; in the sense of least squares where equalities repeat one another.
fn kkt(smooth: &DMatrix<f64>, equal: &DMatrix<f64>, penalty: f64) -> DMatrix<f64> {
    const SINGULAR: f64 = 1e-10;
    let (n, m) = (smooth.nrows(), equal.nrows());
    let mut system = DMatrix::zeros(n + m, n + m);
    system.view_mut((0, 0), (n, n)).copy_from(smooth);
    for i in 0..n {
        system[(i, i)] += penalty;
    }
    system.view_mut((n, 0), (m, n)).copy_from(equal);
    system.view_mut((0, n), (n, m)).copy_from(&equal.transpose());
    system
        .pseudo_inverse(SINGULAR)
        .expect("a small matrix has singular values")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tolerance of sums over 41 samples, solved through singular values.
    const ROUNDING: f64 = 1e-6;

    #[test]
    fn colours_come_back() {
        let basis = rgb_basis();
        for want in [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.2, 0.7, 0.4],
        ] {
            let got = linear_rgb(|nm| (0..3).map(|b| want[b] * basis[b].at(nm)).sum());
            assert!((0..3).all(|c| (got[c] - want[c]).abs() < ROUNDING), "{want:?}: {got:?}");
        }
    }

    #[test]
    fn curves_are_reflectances_and_smooth() {
        let basis = rgb_basis();
        for i in 0..SAMPLES {
            let sum: f64 = basis.iter().map(|b| b.values[i]).sum();
            assert!((sum - 1.0).abs() < ROUNDING, "{} nm: {sum}", wavelength(i));
            assert!(basis.iter().all(|b| (0.0..=1.0 + ROUNDING).contains(&b.values[i])));
        }
        // Red is at its most at the long end, blue at the short one, green between.
        assert!(basis[0].at(650.0) > 0.8 && basis[2].at(440.0) > 0.8 && basis[1].at(540.0) > 0.8);
        let step = basis
            .iter()
            .flat_map(|b| b.values.windows(2).map(|w| (w[1] - w[0]).abs()));
        // A jump would be one; the published curves rise by up to 0.2 in 10 nm.
        assert!(step.fold(0.0, f64::max) < 0.35);
    }
}
