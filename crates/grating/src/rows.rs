//! How far a model of single sites is from rows of real pillars.

use num_complex::Complex64;

use metalith_core::{Error, Result};
use metalith_rcwa::SiteLattice;

use crate::{CoarseCell, site_transmissions};

/// Consecutive pillars of an element, in a direction across which its widths hardly change.
///
/// The row is closed to a ring, and repeated across: along y for a row along x, and along (1, -1) for one along the
/// diagonal. Its supercell has as many sites as the row.
#[derive(Clone, Debug, PartialEq)]
pub struct RealRow {
    /// Direction: (1, 0), (0, 1) or (1, 1).
    pub direction: [i32; 2],
    /// Width of each pillar (nm); a diagonal row has a site at every step of x + y.
    pub widths_nm: Vec<f64>,
}

impl RealRow {
    /// Light that a model puts elsewhere than the supercell does: sum of |t - t'|^2 over the sites, over that of full
    /// transmission; mean of s and p.
    ///
    /// `sines` is the direction of arrival in air. `model` gives the transmission of every site of the lattice from
    /// its widths (nm), `[polarisation][site]`, scaled as that of a single cell.
    ///
    /// # Errors
    /// If the direction makes fewer sites than there are pillars, or as the solver.
    pub fn misfit(
        &self,
        cell: &CoarseCell<'_>,
        sines: [f64; 2],
        model: impl Fn(&SiteLattice, &[f64]) -> Result<[Vec<Complex64>; 2]>,
    ) -> Result<f64> {
        let pillars = self.widths_nm.len();
        let lattice = SiteLattice::of_grating(self.direction, pillars)?;
        if lattice.len() != pillars {
            return Err(Error::invalid(
                format!("a row of {pillars} pillars in the direction {:?}", self.direction),
                "use (1, 0), (0, 1) or (1, 1)",
            ));
        }
        let widths: Vec<f64> = (0..pillars)
            .map(|i| {
                let [x, y] = lattice.site(i).map(|v| v as i64);
                let [p, q] = self.direction.map(i64::from);
                self.widths_nm[(p * x + q * y).rem_euclid(pillars as i64) as usize]
            })
            .collect();
        let full = cell.full_transmission()?;
        let response = cell.solve(lattice, &widths, sines)?;
        let wanted = site_transmissions(&lattice, &response, cell.wavelength_over_pitch(), full);
        let found = model(&lattice, &widths)?;
        let sum: f64 = found
            .iter()
            .flatten()
            .zip(wanted.iter().flatten())
            .map(|(a, b)| (a - b).norm_sqr())
            .sum();
        Ok(sum / (2.0 * pillars as f64 * full * full))
    }
}
