//! The cell of the paper: phase by its two polynomials, no amplitude.

use num_complex::Complex64;

use super::{CellModel, CellResponse, CellStack, Fidelity, ForwardPolynomial, Illumination};
use metalith_core::{Error, Progress, Result};

/// Wavelengths that the polynomials were published for (um).
const PUBLISHED_UM: (f64, f64) = (0.4, 0.7);
/// Rounding of a wavelength.
const ROUNDING_UM: f64 = 1e-9;

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

    /// The published cell for pillars that it was published for.
    ///
    /// # Errors
    /// If the pillars are others.
    pub fn of_stack(stack: &CellStack) -> Result<Self> {
        if stack.is_of_the_paper() {
            Ok(Self::new(stack.pitch_nm as u32))
        } else {
            Err(Error::refused(
                "cell/published-for-other-cell",
                Self::OTHERS,
                Self::ANOTHER_CELL,
            ))
        }
    }

    /// Reason why it does not simulate other pillars than the paper's.
    pub const OTHERS: &str = "the `published` cell is of squares of silicon nitride alone, 700 nm high and 350 nm apart, on fused silica, in air";
    /// Remedy: what to do instead.
    pub const ANOTHER_CELL: &str =
        "ask for `rigorous` or `fitted`, as `fidelity` in [verify] of a design or with --fidelity";
}

impl CellModel for PublishedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Published
    }

    fn response(&self, light: &Illumination<'_>, widest_nm: u16, _progress: &dyn Progress) -> Result<CellResponse> {
        let wavelength_um = light.wavelength_um;
        let (short, long) = PUBLISHED_UM;
        if !(short - ROUNDING_UM..=long + ROUNDING_UM).contains(&wavelength_um) {
            return Err(Error::refused(
                "cell/wavelength-out-of-band",
                format!(
                    "the `published` cell is known from {1} to {2} nm, not at {0} nm",
                    (wavelength_um * 1e4).round() / 10.0,
                    short * 1e3,
                    long * 1e3
                ),
                Self::ANOTHER_CELL,
            ));
        }
        let mut table = vec![Complex64::new(0.0, 0.0)];
        table.extend((1..=widest_nm).map(|width| {
            let turns = self.forward.turns(f64::from(width) / self.pitch_nm, wavelength_um);
            Complex64::cis(std::f64::consts::TAU * turns.fract())
        }));
        Ok(CellResponse::Scalar(table))
    }

    fn full_transmission(&self, _wavelength_um: f64) -> Result<f64> {
        Ok(1.0)
    }
}
