//! Zernike polynomials over a lens, in Noll's order and normalised to an rms of one.

use metalith_core::Zernike;
use metalith_pillars::Lattice;

/// First polynomial of the free term: a bench does not see piston and tilts, and defocus is a gap.
pub const FIRST: u32 = 5;

/// The polynomial at a place of the unit disc.
pub fn value(j: u32, x: f64, y: f64) -> f64 {
    let polynomial = Zernike::noll(j);
    polynomial.norm() * polynomial.value(x, y)
}

/// Optical path (um) on the sites of a lattice, for coefficients (nm) from [`FIRST`] on; zero outside.
pub fn map(coefficients_nm: &[f64], lattice: Lattice, radius_um: f64) -> Vec<f32> {
    let n = lattice.sites();
    (0..n * n)
        .map(|site| {
            let (x, y) = (
                lattice.place_um(0, site % n) / radius_um,
                lattice.place_um(1, site / n) / radius_um,
            );
            if x * x + y * y > 1.0 {
                return 0.0;
            }
            let sum: f64 = coefficients_nm
                .iter()
                .zip(FIRST..)
                .filter(|(c, _)| **c != 0.0)
                .map(|(c, j)| c * value(j, x, y))
                .sum();
            (sum * 1e-3) as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn astigmatism_and_coma_have_an_rms_of_one() {
        // Along the axes: polynomials of numbers below ten.
        const ROUNDING: f64 = 1e-12;
        assert!((value(6, 1.0, 0.0) - 6f64.sqrt()).abs() < ROUNDING);
        assert!((value(8, 1.0, 0.0) - 8f64.sqrt()).abs() < ROUNDING);
    }
}
