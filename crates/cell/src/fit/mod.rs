//! The two polynomials of the paper, fitted to the rigorous cell by least squares.

mod fitted_cell;
mod forward;
mod inverse;
mod rotation;

use num_complex::Complex64;
use serde::Serialize;

pub use fitted_cell::FittedCell;
pub use forward::{ForwardFit, curves_over, fit_forward, forward_errors};
pub use inverse::{InverseFit, fit_inverse, round_trip};
pub use rotation::{RotationCurve, RotationFit};

use metalith_core::{Error, Result};

/// Highest degree of a fit; past it monomials in nm lose too many digits.
const HIGHEST_DEGREE: usize = 8;

/// Phase error of a mapping, its mean taken off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MappingError {
    /// Root mean square (rad).
    pub rms_rad: f64,
    /// Largest (rad).
    pub worst_rad: f64,
}

impl MappingError {
    /// Error from phase errors in waves, less their mean on the circle, which no image shows.
    pub fn of_turns(errors: impl Iterator<Item = f64> + Clone) -> Self {
        let tau = std::f64::consts::TAU;
        let mean: Complex64 = errors.clone().map(|e| Complex64::cis(tau * e)).sum();
        let shift = mean.arg() / tau;
        let (mut sum, mut worst, mut count) = (0.0, 0.0_f64, 0.0);
        for error in errors {
            let left = error - shift;
            let rad = tau * (left - left.round());
            sum += rad * rad;
            worst = worst.max(rad.abs());
            count += 1.0;
        }
        Self {
            rms_rad: f64::sqrt(sum / f64::max(count, 1.0)),
            worst_rad: worst,
        }
    }
}

fn check_degree(degree: usize) -> Result<()> {
    if (1..=HIGHEST_DEGREE).contains(&degree) {
        return Ok(());
    }
    Err(Error::refused(
        "fit/degree-out-of-range",
        format!("a polynomial of degree {degree}"),
        format!("use a degree from 1 to {HIGHEST_DEGREE}"),
    ))
}
