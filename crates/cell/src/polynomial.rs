//! The two published polynomials of the cell, and their form.

use serde::Serialize;

/// Powers of the phase that a polynomial has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// 1, u, u^2, ...: what the published coefficients are for.
    AllPowers,
    /// 1, u^2, u^4, ...: as Eq. 4 of the paper is printed.
    EvenPowers,
}

/// Duty cycle over phase at one wavelength: Eq. 4 of Chakravarthula et al. 2023.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InversePolynomial {
    /// Wavelength that it holds for (um).
    pub wavelength_um: f64,
    pub basis: Basis,
    /// Coefficients of the powers of `basis`, lowest first.
    pub coefficients: Vec<f64>,
}

impl InversePolynomial {
    /// The published one: 102.3 to 288.7 nm at a pitch of 350 nm, 452 nm.
    pub fn published() -> Self {
        Self {
            wavelength_um: 0.452,
            basis: Basis::AllPowers,
            coefficients: vec![0.2923, 0.6809, -0.1484],
        }
    }

    /// Duty cycle (width over pitch) for a phase of `u` turns, `0 <= u < 1`.
    pub fn duty(&self, u: f64) -> f64 {
        let x = match self.basis {
            Basis::AllPowers => u,
            Basis::EvenPowers => u * u,
        };
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
    }

    /// Least and greatest duty cycle over a turn.
    pub fn range(&self) -> (f64, f64) {
        // Fine enough that no extremum of a polynomial of sensible degree is missed by a nanometre.
        const STEPS: u32 = 4096;
        (0..=STEPS)
            .map(|k| self.duty(f64::from(k) / f64::from(STEPS)))
            .fold((f64::MAX, f64::MIN), |(low, high), d| (low.min(d), high.max(d)))
    }
}

/// Phase over duty cycle and wavelength: Eq. 5 of Chakravarthula et al. 2023, of any total degree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ForwardPolynomial {
    /// Power of the wavelength (nm), power of the duty cycle, coefficient (turns).
    pub terms: Vec<(u32, u32, f64)>,
}

impl ForwardPolynomial {
    /// The published one, of total degree two.
    pub fn published() -> Self {
        Self {
            terms: vec![
                (0, 0, 6.051),
                (1, 0, -0.02033),
                (0, 1, 2.26),
                (2, 0, 1.371e-5),
                (1, 1, -0.002947),
                (0, 2, 0.797),
            ],
        }
    }

    /// Phase (turns) of a pillar of this duty cycle at a wavelength (um).
    pub fn turns(&self, duty: f64, wavelength_um: f64) -> f64 {
        let length_nm = wavelength_um * 1e3;
        self.terms
            .iter()
            .map(|&(i, j, c)| c * length_nm.powi(i as i32) * duty.powi(j as i32))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published inverse and forward polynomials undo one another to 0.03 turns at worst.
    const PUBLISHED_ROUND_TRIP_TURNS: f64 = 0.03;

    #[test]
    fn the_published_pair_undo_one_another_at_their_wavelength() {
        let (inverse, forward) = (InversePolynomial::published(), ForwardPolynomial::published());
        for k in 0..1000 {
            let u = f64::from(k) / 1000.0;
            let back = forward.turns(inverse.duty(u), inverse.wavelength_um);
            let miss = (back - u) - (back - u).round();
            assert!(miss.abs() < PUBLISHED_ROUND_TRIP_TURNS, "u = {u}: {miss}");
        }
    }

    #[test]
    fn the_published_widths_are_those_of_the_paper() {
        let (low, high) = InversePolynomial::published().range();
        assert_eq!(((low * 3500.0).round(), (high * 3500.0).round()), (1023.0, 2887.0));
    }

    #[test]
    fn even_powers_skip_the_odd_ones() {
        let p = InversePolynomial {
            basis: Basis::EvenPowers,
            coefficients: vec![0.25, 0.5, 0.125],
            ..InversePolynomial::published()
        };
        assert_eq!(p.duty(0.5), 0.25 + 0.5 * 0.25 + 0.125 * 0.0625);
    }
}
