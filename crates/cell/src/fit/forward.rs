//! The phase over duty cycle and wavelength.

use nalgebra::{DMatrix, DVector, Dyn, SVD};
use num_complex::Complex64;
use serde::Serialize;

use super::{MappingError, check_degree};
use crate::{CellModel, ForwardPolynomial, PhaseCurve};
use metalith_core::{Error, Result};

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
/// each point is taken on the turn nearest to the fit until no point changes its turn. The first fit is the published polynomial;
/// of cells that it says nothing of (another band, another film) it is the curves as they are, each continued from the one
/// before, where that leaves far less.
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
        return Err(Error::refused(
            "fit/too-few-points",
            format!(
                "a polynomial of {1} terms cannot be fitted to {0} points",
                points.len(),
                powers.len()
            ),
            "give more wavelengths and widths, or a lower degree",
        ));
    }
    let frame = FitScale::around(&points);
    let matrix = DMatrix::from_fn(points.len(), powers.len(), |i, j| {
        let (x, y) = frame.inside(points[i].0, points[i].1);
        x.powi(powers[j].0 as i32) * y.powi(powers[j].1 as i32)
    });
    let decomposed = matrix.clone().svd(true, true);
    let fit = |model: Vec<f64>| -> Result<ForwardFit> {
        let coefficients = settled(&decomposed, &matrix, &points, model)?;
        let polynomial = frame.expand(&powers, coefficients.as_slice());
        let (errors, overall) = forward_errors(&polynomial, curves, pitch_nm);
        Ok(ForwardFit {
            polynomial,
            errors,
            overall,
        })
    };
    let published = ForwardPolynomial::published();
    let tau = std::f64::consts::TAU;
    let offset: Complex64 = points
        .iter()
        .map(|&(l, d, turns)| Complex64::cis(tau * (turns - published.turns(d, l))))
        .sum();
    let model = points
        .iter()
        .map(|&(l, d, _)| published.turns(d, l) + offset.arg() / tau);
    let from_published = fit(model.collect())?;
    let from_curves = fit(continued(curves))?;
    let far_less = from_curves.overall.rms_rad < FAR_LESS * from_published.overall.rms_rad;
    Ok(if far_less { from_curves } else { from_published })
}

/// Error of a fit over that of another (rms) where the other began from what says nothing of the cell. Of the cell of the paper
/// both are alike.
const FAR_LESS: f64 = 0.5;

/// Turns of all points, curve by curve, each curve moved by whole turns to where it is nearest to the one before.
fn continued(curves: &[PhaseCurve]) -> Vec<f64> {
    let mut all = Vec::new();
    let mut before: Option<Vec<f64>> = None;
    for curve in curves {
        let mut turns = curve.turns.clone();
        if let Some(before) = &before {
            let apart: f64 = before.iter().zip(&turns).map(|(a, b)| a - b).sum();
            let whole = (apart / turns.len().min(before.len()).max(1) as f64).round();
            turns.iter_mut().for_each(|t| *t += whole);
        }
        all.extend_from_slice(&turns);
        before = Some(turns);
    }
    all
}

/// Coefficients of the fit to points on the turns that they settle on, from a first fit on.
fn settled(
    decomposed: &SVD<f64, Dyn, Dyn>,
    matrix: &DMatrix<f64>,
    points: &[(f64, f64, f64)],
    mut model: Vec<f64>,
) -> Result<DVector<f64>> {
    let mut coefficients = DVector::zeros(matrix.ncols());
    // Points settle on their turn within a few rounds; the bound is against one that swings.
    for _ in 0..50 {
        let turns = DVector::from_iterator(
            points.len(),
            points.iter().zip(&model).map(|(&(_, _, t), m)| t + (m - t).round()),
        );
        let next = decomposed
            .solve(&turns, 1e-12)
            .map_err(|why| Error::refused("fit/singular", why, "lower the degree"))?;
        let settled = (&next - &coefficients).norm() <= 1e-12 * next.norm();
        coefficients = next;
        model = (matrix * &coefficients).iter().copied().collect();
        if settled {
            break;
        }
    }
    Ok(coefficients)
}

/// Wavelength (nm) and duty cycle brought to about -1..1, where powers are distinguished.
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
