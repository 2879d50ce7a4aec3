//! How far a model of single sites is from rows of real pillars.

use std::f64::consts::TAU;

use num_complex::Complex64;

use metalith_core::{Error, Result};
use metalith_rcwa::SiteLattice;

use crate::{CoarseCell, site_transmissions};

/// Pillars of a row along x, where a mirror plane halves the unknowns, and of others.
const PILLARS: usize = 20;
const PILLARS_ACROSS: usize = 12;

/// Consecutive pillars of an element, in a direction across which its widths hardly change.
///
/// The row is closed to a ring, and repeated across: along y for a row along x, and along (1, -1) for one along (1, 1). Its supercell has as many sites as the row.
#[derive(Clone, Debug, PartialEq)]
pub struct RealRow {
    /// Direction: (1, 0), (0, 1), (1, 1) or (1, -1).
    pub direction: [i32; 2],
    /// Width of each pillar (nm); a diagonal row has a site at every step of x + y.
    pub widths_nm: Vec<f64>,
}

/// A row whose supercell is solved.
#[derive(Clone, Debug)]
pub struct SolvedRow {
    /// The sites of its supercell.
    pub lattice: SiteLattice,
    /// Width of each site (nm), in their order.
    pub widths_nm: Vec<f64>,
    /// Number of the pillar of the row that each site is.
    pub pillars: Vec<usize>,
    /// What each site transmits, `[polarisation][site]`.
    transmitted: [Vec<Complex64>; 2],
    full: f64,
}

/// A row of an element, with the phase that is asked of each of its pillars.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementRow {
    /// Where it begins, from the middle of the element (um).
    pub radius_um: f64,
    /// Phase of each pillar (turns).
    pub turns: Vec<f64>,
    pub row: RealRow,
}

impl ElementRow {
    /// Rows that stand for an element: one for each radius (um) and direction, 20 pillars long along x and 12 in others.
    /// `turns` gives the phases of consecutive sites from a radius on in a direction, nothing where the element ends before:
    /// such rows are left out. `width_nm` draws a phase.
    pub fn of_element(
        radii_um: &[f64],
        directions: &[[i32; 2]],
        turns: impl Fn(f64, [i32; 2], usize) -> Option<Vec<f64>>,
        width_nm: impl Fn(f64) -> f64,
    ) -> Vec<Self> {
        let places = radii_um.iter().flat_map(|r| directions.iter().map(|d| (*r, *d)));
        places
            .filter_map(|(radius_um, direction)| {
                let pillars = if direction[1] == 0 { PILLARS } else { PILLARS_ACROSS };
                let turns = turns(radius_um, direction, pillars)?;
                let widths_nm = turns.iter().map(|u| width_nm(*u)).collect();
                Some(Self {
                    radius_um,
                    turns,
                    row: RealRow { direction, widths_nm },
                })
            })
            .collect()
    }

    /// Share of the light in the first order of all rows together, mean of s and p, from the amplitude of each.
    pub fn share(amplitudes: &[[Complex64; 2]]) -> f64 {
        let count = amplitudes.len().max(1) as f64;
        let share = |pol: usize| (amplitudes.iter().map(|a| a[pol]).sum::<Complex64>() / count).norm_sqr();
        (share(0) + share(1)) / 2.0
    }
}

impl SolvedRow {
    /// What each site transmits, `[polarisation][site]`, scaled as a single cell.
    pub fn transmitted(&self) -> &[Vec<Complex64>; 2] {
        &self.transmitted
    }

    /// Amplitude of the first order for s and p, its squared modulus a share of the light: the mean over the sites of what
    /// they transmit, `found` (`[polarisation][site]`, scaled as a single cell), less the phase that is asked of each
    /// pillar of the row (turns).
    pub fn first_order(&self, found: &[Vec<Complex64>; 2], turns: &[f64]) -> [Complex64; 2] {
        let back = |pillar: &usize| Complex64::cis(-TAU * turns[*pillar]) / self.full;
        found.each_ref().map(|found| {
            let sum: Complex64 = found
                .iter()
                .zip(&self.pillars)
                .map(|(t, pillar)| t * back(pillar))
                .sum();
            sum / found.len() as f64
        })
    }

    /// Light that a model puts elsewhere than the supercell does: sum of |t - t'|^2 over the sites, over that of full
    /// transmission; mean of s and p. `found` is the transmission of every site by the model, `[polarisation][site]`,
    /// scaled as that of a single cell.
    pub fn misfit(&self, found: &[Vec<Complex64>; 2]) -> f64 {
        let wanted = self.transmitted.iter().flatten();
        let sum: f64 = found
            .iter()
            .flatten()
            .zip(wanted)
            .map(|(a, b)| (a - b).norm_sqr())
            .sum();
        sum / (2.0 * self.widths_nm.len() as f64 * self.full * self.full)
    }
}

impl RealRow {
    /// Directions that differ for an element that is steered along x or a diagonal.
    pub const DIRECTIONS: [[i32; 2]; 5] = [[1, 0], [-1, 0], [0, 1], [1, 1], [1, -1]];

    /// Light that a model puts elsewhere than the supercell does, as [`SolvedRow::misfit`].
    ///
    /// `sines` is the direction of arrival in air. `model` gives the transmission of every site of the lattice from
    /// its widths (nm).
    ///
    /// # Errors
    /// As [`RealRow::solve`], or those of the model.
    pub fn misfit(
        &self,
        cell: &CoarseCell<'_>,
        sines: [f64; 2],
        model: impl Fn(&SiteLattice, &[f64]) -> Result<[Vec<Complex64>; 2]>,
    ) -> Result<f64> {
        let solved = self.solve(cell, sines)?;
        Ok(solved.misfit(&model(&solved.lattice, &solved.widths_nm)?))
    }

    /// Solve its supercell for light from a direction (sines in air).
    ///
    /// # Errors
    /// If the direction makes fewer sites than there are pillars, or as the solver.
    pub fn solve(&self, cell: &CoarseCell<'_>, sines: [f64; 2]) -> Result<SolvedRow> {
        let pillars = self.widths_nm.len();
        let lattice = SiteLattice::of_grating(self.direction, pillars)?;
        if lattice.len() != pillars {
            return Err(Error::invalid(
                format!("a row of {pillars} pillars in the direction {:?}", self.direction),
                "use (1, 0), (0, 1), (1, 1) or (1, -1)",
            ));
        }
        let order: Vec<usize> = (0..pillars)
            .map(|i| {
                let [x, y] = lattice.site(i).map(|v| v as i64);
                let [p, q] = self.direction.map(i64::from);
                (p * x + q * y).rem_euclid(pillars as i64) as usize
            })
            .collect();
        let widths: Vec<f64> = order.iter().map(|i| self.widths_nm[*i]).collect();
        let full = cell.full_transmission()?;
        let response = cell.solve(lattice, &widths, sines)?;
        Ok(SolvedRow {
            transmitted: site_transmissions(&lattice, &response, cell.wavelength_over_pitch(), full),
            lattice,
            widths_nm: widths,
            pillars: order,
            full,
        })
    }
}
