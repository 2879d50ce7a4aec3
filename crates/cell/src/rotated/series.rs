//! Response of a rotated pillar to light, over its rotation.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use num_complex::Complex64;

use crate::Handedness;

/// Converted light less its geometric phase, and unconverted light, as ratios of fields.
pub(super) type Channels = [Complex64; 2];

/// Fourier series over a quarter turn, after which all repeats: coefficients of `exp(4 i m rotation)`, for m from minus half their
/// number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Series {
    coefficients: Vec<Channels>,
}

/// Rotations (rad) that are solved for so many intervals of an eighth of a turn, from upright on. The lattice has the symmetries of
/// the square, so that these and their mirror images are evenly spaced over a quarter turn.
pub(super) fn solved_rotations(intervals: usize) -> impl Iterator<Item = f64> {
    (0..=intervals).map(move |k| FRAC_PI_4 * k as f64 / intervals as f64)
}

/// Places of the solved rotations for fewer intervals among those of `samples`.
pub(super) fn every(intervals: usize, samples: &[Channels]) -> impl Iterator<Item = Channels> {
    samples.iter().copied().step_by(samples.len() / (2 * intervals))
}

/// Samples over a quarter turn from Jones matrices in circular polarisation, `[out][in]`, at [`solved_rotations`].
pub(super) fn samples(jones: &[[[Complex64; 2]; 2]], arriving: Handedness) -> Vec<Channels> {
    let (from, to) = match arriving {
        Handedness::Left => (0, 1),
        Handedness::Right => (1, 0),
    };
    let intervals = jones.len() - 1;
    let rotations: Vec<f64> = solved_rotations(intervals).collect();
    let less_geometric =
        |converted: Complex64, rotation: f64| converted * Complex64::cis(-arriving.geometric_phase(rotation));
    let solved = (0..=intervals).map(|k| {
        let j = &jones[k];
        [less_geometric(j[to][from], rotations[k]), j[from][from]]
    });
    // A mirror turns the pillar back and one handedness into the other.
    let mirrored = (1..intervals).rev().map(|k| {
        let j = &jones[k];
        [less_geometric(j[from][to], -rotations[k]), j[to][to]]
    });
    solved.chain(mirrored).collect()
}

impl Series {
    /// Series of samples evenly spaced over a quarter turn.
    pub(super) fn of(samples: &[Channels]) -> Self {
        let count = samples.len() as f64;
        let coefficient = |m: usize| {
            let order = m as f64 - (count / 2.0);
            let mut sum = [Complex64::ZERO; 2];
            for (k, sample) in samples.iter().enumerate() {
                let wave = Complex64::cis(-4.0 * order * FRAC_PI_2 * k as f64 / count);
                sum = [0, 1].map(|c| sum[c] + sample[c] * wave);
            }
            sum.map(|s| s / count)
        };
        Self {
            coefficients: (0..samples.len()).map(coefficient).collect(),
        }
    }

    /// Channels at a rotation (rad).
    pub(super) fn at(&self, rotation: f64) -> Channels {
        let half = self.coefficients.len() as f64 / 2.0;
        let mut sum = [Complex64::ZERO; 2];
        for (m, c) in self.coefficients.iter().enumerate() {
            let wave = match m {
                // The fastest of an even number of samples has no sign.
                0 => Complex64::from((4.0 * half * rotation).cos()),
                _ => Complex64::cis(4.0 * (m as f64 - half) * rotation),
            };
            sum = [0, 1].map(|channel| sum[channel] + c[channel] * wave);
        }
        sum
    }
}
