//! The duty cycle over the phase at one wavelength.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::{MappingError, check_degree};
use crate::{Basis, InversePolynomial, PhaseCurve};
use metalith_core::{Error, Result};

/// Phases over a turn at which a mapping is judged.
const ROUND_TRIP: usize = 1024;

/// An inverse polynomial and how well it inverts.
#[derive(Clone, Debug, Serialize)]
pub struct InverseFit {
    /// Duty cycle over phase.
    pub polynomial: InversePolynomial,
    /// Turns that the widths of the cell span at this wavelength; below 1 no mapping reaches all phases.
    pub span_waves: f64,
    /// Rigorous phase of the width that the polynomial gives, against the phase asked for.
    pub round_trip: MappingError,
}

/// Phase error of an inverse polynomial by a rigorous curve; widths beyond the curve count as its ends.
pub fn round_trip(polynomial: &InversePolynomial, curve: &PhaseCurve, pitch_nm: f64) -> MappingError {
    let phases = (0..ROUND_TRIP).map(|i| (i as f64 + 0.5) / ROUND_TRIP as f64);
    MappingError::of_turns(phases.map(|u| curve.turns_at(pitch_nm * polynomial.duty(u)) - u))
}

/// Fits the duty cycle over the phase at the wavelength of `curve`, on widths whose phase rises and whose
/// zero order carries at least `threshold`.
///
/// Phase zero is a free choice: of all turns that fit between the narrowest and the widest pillar, the
/// one with the least round-trip error is taken.
///
/// # Errors
/// If the degree is zero or too high, or too few widths are left.
pub fn fit_inverse(
    curve: &PhaseCurve,
    pitch_nm: f64,
    basis: Basis,
    degree: usize,
    threshold: f64,
) -> Result<InverseFit> {
    check_degree(degree)?;
    let good: Vec<usize> = rising(curve, threshold);
    let (Some(&first), Some(&last)) = (good.first(), good.last()) else {
        return Err(too_few(curve));
    };
    let span_waves = curve.turns[last] - curve.turns[first];
    // One start if the widths do not reach a turn, else all that leave a whole turn.
    let starts = good
        .iter()
        .copied()
        .filter(|&s| s == first || curve.turns[last] - curve.turns[s] >= 1.0);
    let mut best: Option<InverseFit> = None;
    for start in starts {
        let points: Vec<(f64, f64)> = good
            .iter()
            .map(|&i| {
                (
                    curve.turns[i] - curve.turns[start],
                    f64::from(curve.widths_nm[i]) / pitch_nm,
                )
            })
            .filter(|(u, _)| (0.0..=1.0).contains(u))
            .collect();
        let Some(coefficients) = least_squares(&points, degree, |u, power| match basis {
            Basis::AllPowers => u.powi(power as i32),
            Basis::EvenPowers => u.powi(2 * power as i32),
        }) else {
            continue;
        };
        let polynomial = InversePolynomial {
            wavelength_um: curve.wavelength_um,
            basis,
            coefficients,
        };
        let (narrow, wide) = polynomial.range();
        let (low, high) = (curve.widths_nm[0], curve.widths_nm[curve.widths_nm.len() - 1]);
        // A mapping must stay within the widths that may be written, but for rounding.
        if narrow * pitch_nm < f64::from(low) - 1.0 || wide * pitch_nm > f64::from(high) + 1.0 {
            continue;
        }
        let round_trip = round_trip(&polynomial, curve, pitch_nm);
        if best.as_ref().is_none_or(|b| round_trip.rms_rad < b.round_trip.rms_rad) {
            best = Some(InverseFit {
                polynomial,
                span_waves,
                round_trip,
            });
        }
    }
    best.ok_or_else(|| too_few(curve))
}

/// Indices of good widths at which the phase is above all before.
fn rising(curve: &PhaseCurve, threshold: f64) -> Vec<usize> {
    let mut top = f64::NEG_INFINITY;
    let powers: Vec<f64> = curve.zero_order().collect();
    (0..curve.turns.len())
        .filter(|&i| {
            let good = powers[i] >= threshold && !curve.backwards(i) && curve.turns[i] > top;
            if good {
                top = curve.turns[i];
            }
            good
        })
        .collect()
}

fn too_few(curve: &PhaseCurve) -> Error {
    Error::refused(
        "fit/no-inverse-polynomial",
        format!(
            "no polynomial of this degree maps a full wave of phase to the widths of the cell at {} um",
            curve.wavelength_um
        ),
        "widen the range of widths, lower the threshold, or change the degree",
    )
}

/// Coefficients of functions 0..=degree of x through points (x, y).
fn least_squares(points: &[(f64, f64)], degree: usize, function: impl Fn(f64, usize) -> f64) -> Option<Vec<f64>> {
    if points.len() < 2 * (degree + 1) {
        return None;
    }
    let matrix = DMatrix::from_fn(points.len(), degree + 1, |i, j| function(points[i].0, j));
    let values = DVector::from_iterator(points.len(), points.iter().map(|p| p.1));
    let solution = matrix.svd(true, true).solve(&values, 1e-12).ok()?;
    Some(solution.iter().copied().collect())
}
