//! The cell of the paper: phase by its two polynomials, no amplitude.

use num_complex::Complex64;

use super::{CellModel, Fidelity, ForwardPolynomial};
use metalith_core::Result;

/// Transmission of modulus one whose phase is the published polynomial.
#[derive(Clone, Debug)]
pub struct PublishedCell {
    pitch_nm: f64,
    forward: ForwardPolynomial,
}

impl PublishedCell {
    /// The published cell on a lattice of this pitch.
    pub fn new(pitch_nm: u32) -> Self {
        Self {
            pitch_nm: f64::from(pitch_nm),
            forward: ForwardPolynomial::published(),
        }
    }
}

impl CellModel for PublishedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Published
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        let mut table = vec![Complex64::new(0.0, 0.0)];
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
