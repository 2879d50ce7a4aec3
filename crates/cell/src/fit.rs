//! The two polynomials of the paper, fitted to the rigorous cell by least squares.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use serde::Serialize;

use super::{Basis, CellModel, CellStack, Fidelity, ForwardPolynomial, InversePolynomial, PhaseCurve, PointwiseCell};
use metalith_core::{Error, Result};
use metalith_rcwa::Orders;

/// Highest degree of a fit; past it monomials in nm lose too many digits.
const HIGHEST_DEGREE: usize = 8;

/// Phases over a turn at which a mapping is judged.
const ROUND_TRIP: usize = 1024;

/// Phase error of a mapping, its mean taken off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MappingError {
    /// Root mean square (rad).
    pub rms_rad: f64,
    /// Largest (rad).
    pub worst_rad: f64,
}

impl MappingError {
    /// Of phase errors in turns: what is left when their mean on the circle, which no image shows, is
    /// taken off.
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

/// An inverse polynomial and how well it inverts.
#[derive(Clone, Debug, Serialize)]
pub struct InverseFit {
    /// Duty cycle over phase.
    pub polynomial: InversePolynomial,
    /// Turns that the widths of the cell span at this wavelength; below 1 no mapping reaches all phases.
    pub span_turns: f64,
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
    let span_turns = curve.turns[last] - curve.turns[first];
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
                span_turns,
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
    Error::invalid(
        format!(
            "no polynomial of this degree maps a turn to the widths of the cell at {} um",
            curve.wavelength_um
        ),
        "widen the range of widths, lower the threshold, or change the degree",
    )
}

fn check_degree(degree: usize) -> Result<()> {
    if (1..=HIGHEST_DEGREE).contains(&degree) {
        return Ok(());
    }
    Err(Error::invalid(
        format!("a polynomial of degree {degree}"),
        format!("use a degree from 1 to {HIGHEST_DEGREE}"),
    ))
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

/// A forward polynomial and how well it follows the rigorous phase.
#[derive(Clone, Debug, Serialize)]
pub struct ForwardFit {
    /// Phase over duty cycle and wavelength.
    pub polynomial: ForwardPolynomial,
    /// Error at each wavelength (um).
    pub errors: Vec<(f64, MappingError)>,
    /// Over all wavelengths.
    pub overall: MappingError,
}

/// Errors of a forward polynomial against rigorous curves; its phase zero, one for all wavelengths, is
/// taken off.
pub fn forward_errors(
    polynomial: &ForwardPolynomial,
    curves: &[PhaseCurve],
    pitch_nm: f64,
) -> (Vec<(f64, MappingError)>, MappingError) {
    let errors = |curve: &PhaseCurve| -> Vec<f64> {
        let places = curve.widths_nm.iter().zip(&curve.turns);
        places
            .map(|(&w, turns)| turns - polynomial.turns(f64::from(w) / pitch_nm, curve.wavelength_um))
            .collect()
    };
    let each: Vec<(f64, Vec<f64>)> = curves.iter().map(|c| (c.wavelength_um, errors(c))).collect();
    let overall = MappingError::of_turns(each.iter().flat_map(|(_, e)| e.iter().copied()));
    let by_wavelength = each
        .iter()
        .map(|(l, e)| (*l, MappingError::of_turns(e.iter().copied())))
        .collect();
    (by_wavelength, overall)
}

/// Fits the phase over duty cycle and wavelength by a polynomial of this total degree.
///
/// The phase of the table is known but for whole turns, and across a resonance it may gain or lose one:
/// each point is taken on the turn nearest to the fit, from the published polynomial onwards, until no
/// point changes its turn.
///
/// # Errors
/// If the degree is zero or too high, or there are too few points.
pub fn fit_forward(curves: &[PhaseCurve], pitch_nm: f64, degree: usize) -> Result<ForwardFit> {
    check_degree(degree)?;
    let points: Vec<(f64, f64, f64)> = curves
        .iter()
        .flat_map(|c| {
            let places = c.widths_nm.iter().zip(&c.turns);
            places.map(|(&w, &turns)| (c.wavelength_um, f64::from(w) / pitch_nm, turns))
        })
        .collect();
    let powers: Vec<(u32, u32)> = (0..=degree as u32)
        .flat_map(|total| (0..=total).map(move |j| (total - j, j)))
        .collect();
    if points.len() < 2 * powers.len() {
        return Err(Error::invalid(
            format!("{} points for a polynomial of {} terms", points.len(), powers.len()),
            "give more wavelengths and widths, or a lower degree",
        ));
    }
    let frame = FitScale::around(&points);
    let matrix = DMatrix::from_fn(points.len(), powers.len(), |i, j| {
        let (x, y) = frame.inside(points[i].0, points[i].1);
        x.powi(powers[j].0 as i32) * y.powi(powers[j].1 as i32)
    });
    let decomposed = matrix.clone().svd(true, true);
    let published = ForwardPolynomial::published();
    let tau = std::f64::consts::TAU;
    let offset: Complex64 = points
        .iter()
        .map(|&(l, d, turns)| Complex64::cis(tau * (turns - published.turns(d, l))))
        .sum();
    let mut model: Vec<f64> = points
        .iter()
        .map(|&(l, d, _)| published.turns(d, l) + offset.arg() / tau)
        .collect();
    let mut coefficients = DVector::zeros(powers.len());
    // Points settle on their turn within a few rounds; the bound is against one that swings.
    for _ in 0..50 {
        let turns = DVector::from_iterator(
            points.len(),
            points.iter().zip(&model).map(|(&(_, _, t), m)| t + (m - t).round()),
        );
        let next = decomposed
            .solve(&turns, 1e-12)
            .map_err(|why| Error::invalid(why, "lower the degree"))?;
        let settled = (&next - &coefficients).norm() <= 1e-12 * next.norm();
        coefficients = next;
        model = (&matrix * &coefficients).iter().copied().collect();
        if settled {
            break;
        }
    }
    let polynomial = frame.expand(&powers, coefficients.as_slice());
    let (errors, overall) = forward_errors(&polynomial, curves, pitch_nm);
    Ok(ForwardFit {
        polynomial,
        errors,
        overall,
    })
}

/// Wavelength (nm) and duty cycle brought to about -1..1, where powers are told apart.
struct FitScale {
    centre: (f64, f64),
    half: (f64, f64),
}

impl FitScale {
    fn around(points: &[(f64, f64, f64)]) -> Self {
        let range = |of: fn(&(f64, f64, f64)) -> f64| {
            let ends = points
                .iter()
                .map(of)
                .fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
            (0.5 * (ends.0 + ends.1), (0.5 * (ends.1 - ends.0)).max(1e-9))
        };
        let (l, d) = (range(|p| p.0 * 1e3), range(|p| p.1));
        Self {
            centre: (l.0, d.0),
            half: (l.1, d.1),
        }
    }

    fn inside(&self, wavelength_um: f64, duty: f64) -> (f64, f64) {
        (
            (wavelength_um * 1e3 - self.centre.0) / self.half.0,
            (duty - self.centre.1) / self.half.1,
        )
    }

    /// The polynomial in nm and duty cycle: powers of shifted variables multiplied out.
    fn expand(&self, powers: &[(u32, u32)], coefficients: &[f64]) -> ForwardPolynomial {
        // ((z - centre) / half)^n as coefficients of z^0..=z^n.
        let shifted = |n: u32, centre: f64, half: f64| -> Vec<f64> {
            let mut row = vec![1.0];
            for _ in 0..n {
                let mut next = vec![0.0; row.len() + 1];
                for (i, c) in row.iter().enumerate() {
                    next[i] -= c * centre / half;
                    next[i + 1] += c / half;
                }
                row = next;
            }
            row
        };
        let mut terms: Vec<(u32, u32, f64)> = powers.iter().map(|&(i, j)| (i, j, 0.0)).collect();
        for (&(i, j), c) in powers.iter().zip(coefficients) {
            let (x, y) = (
                shifted(i, self.centre.0, self.half.0),
                shifted(j, self.centre.1, self.half.1),
            );
            for (a, ca) in x.iter().enumerate() {
                for (b, cb) in y.iter().enumerate() {
                    let term = terms.iter_mut().find(|t| (t.0, t.1) == (a as u32, b as u32));
                    term.expect("a lower power is in the list").2 += c * ca * cb;
                }
            }
        }
        ForwardPolynomial { terms }
    }
}

/// Transmission of modulus one whose phase is a polynomial fitted to the rigorous cell.
#[derive(Clone, Debug)]
pub struct FittedCell {
    pitch_nm: f64,
    forward: ForwardPolynomial,
}

/// Where [`FittedCell::of_stack`] looks: ten and more points for every coefficient and resonance.
const FIT_WIDTH_STEP_NM: usize = 4;
const FIT_BAND_STEP_UM: f64 = 0.010;
const FIT_ORDERS: usize = 11;

/// Total degree that [`FittedCell::of_stack`] fits; higher ones follow the resonances, not the trend.
const FORWARD_DEGREE: usize = 4;

impl FittedCell {
    /// The cell of a fitted forward polynomial.
    pub fn new(pitch_nm: f64, forward: ForwardPolynomial) -> Self {
        Self { pitch_nm, forward }
    }

    /// Fit the rigorous cell over a band (um) and a range of widths (nm), at enough of both for the trend.
    ///
    /// # Errors
    /// As [`CellStack::transmission`] and [`fit_forward`].
    pub fn of_stack(stack: &CellStack, band_um: (f64, f64), widths_nm: (u16, u16)) -> Result<Self> {
        let widths: Vec<u16> = (widths_nm.0..=widths_nm.1).step_by(FIT_WIDTH_STEP_NM).collect();
        let cell = PointwiseCell::with_orders(stack.clone(), widths.iter().copied(), Orders::new(FIT_ORDERS)?);
        let steps = ((band_um.1 - band_um.0) / FIT_BAND_STEP_UM).ceil().max(1.0) as usize;
        let curves = (0..=steps)
            .map(|i| {
                let wavelength_um = band_um.0 + (band_um.1 - band_um.0) * i as f64 / steps as f64;
                PhaseCurve::new(&cell, wavelength_um, &widths)
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Self::new(
            stack.pitch_nm,
            fit_forward(&curves, stack.pitch_nm, FORWARD_DEGREE)?.polynomial,
        ))
    }

    /// Its phase.
    pub fn forward(&self) -> &ForwardPolynomial {
        &self.forward
    }
}

/// Curves every 5 nm of a band (um), over even widths of a range (nm).
///
/// # Errors
/// As [`PhaseCurve::new`].
pub fn curves_over(cell: &dyn CellModel, band_um: (f64, f64), widths_nm: (u16, u16)) -> Result<Vec<PhaseCurve>> {
    let widths: Vec<u16> = (widths_nm.0..=widths_nm.1).collect();
    let steps = ((band_um.1 - band_um.0) / 0.005).round().max(1.0) as usize;
    (0..=steps)
        .map(|i| {
            let wavelength_um = band_um.0 + (band_um.1 - band_um.0) * i as f64 / steps as f64;
            PhaseCurve::new(cell, wavelength_um, &widths)
        })
        .collect()
}

impl CellModel for FittedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Fitted
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        let mut table = vec![Complex64::ZERO];
        table.extend((1..=max_width_nm).map(|width| {
            let turns = self.forward.turns(f64::from(width) / self.pitch_nm, wavelength_um);
            Complex64::cis(std::f64::consts::TAU * turns.fract())
        }));
        Ok(table)
    }

    fn full_transmission(&self, _wavelength_um: f64) -> Result<f64> {
        Ok(1.0)
    }
}
