//! A cell whose phase is a fitted polynomial.

use std::path::Path;

use num_complex::Complex64;

use super::fit_forward;
use crate::{CellModel, CellResponse, CellStack, Fidelity, ForwardPolynomial, Illumination, PhaseCurve, PointwiseCell};
use metalith_core::{Progress, Result};
use metalith_rcwa::Orders;

/// Transmission of modulus one whose phase is a polynomial fitted to the rigorous cell.
#[derive(Clone, Debug)]
pub struct FittedCell {
    pitch_nm: f64,
    forward: ForwardPolynomial,
}

/// Step of the widths that [`FittedCell::of_stack`] samples: ten and more points for every coefficient and resonance.
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

    /// Fit the rigorous cell over a band (um) and a range of widths (nm), at enough of both for the trend. What is solved for it is
    /// kept in the folder `cache`.
    ///
    /// # Errors
    /// As [`CellStack::transmission`] and [`fit_forward`].
    pub fn of_stack(
        stack: &CellStack,
        band_um: (f64, f64),
        widths_nm: (u16, u16),
        cache: Option<&Path>,
    ) -> Result<Self> {
        let widths: Vec<u16> = (widths_nm.0..=widths_nm.1).step_by(FIT_WIDTH_STEP_NM).collect();
        let cell = PointwiseCell::with_orders(stack.clone(), widths.iter().copied(), Orders::new(FIT_ORDERS)?);
        let cell = cell.cached_in(cache);
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

    /// Phase.
    pub fn forward(&self) -> &ForwardPolynomial {
        &self.forward
    }
}

impl CellModel for FittedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Fitted
    }

    fn response(&self, light: &Illumination<'_>, widest_nm: u16, _progress: &dyn Progress) -> Result<CellResponse> {
        let mut table = vec![Complex64::ZERO];
        table.extend((1..=widest_nm).map(|width| {
            let turns = self
                .forward
                .turns(f64::from(width) / self.pitch_nm, light.wavelength_um);
            Complex64::cis(std::f64::consts::TAU * turns.fract())
        }));
        Ok(CellResponse::Scalar(table))
    }

    fn full_transmission(&self, _wavelength_um: f64) -> Result<f64> {
        Ok(1.0)
    }
}
