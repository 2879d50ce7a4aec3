//! The orders of one blazed grating in the light of one direction: what tables are interpolated between.

use std::f64::consts::TAU;

use num_complex::Complex64;

use metalith_core::Result;
use metalith_rcwa::SiteLattice;

use crate::{Blaze, CoarseCell, Mapping};

/// Lowest order that is kept, and their number.
pub const FIRST_KEPT: i32 = -5;
pub const KEPT: usize = 12;

/// Amplitudes of the kept orders for s and p incident, `[polarisation][order - FIRST_KEPT]`.
pub type OrderAmplitudes = [[Complex64; KEPT]; 2];

/// Phases at which a grating is solved, over its sites and offsets together: orders that are so many apart cannot be
/// told apart. With half as many the truth is met to 0.03 in share of the first order instead of 0.025.
pub(crate) const PHASES: usize = 24;

/// A grating vector that repeats after a few sites: turns over `sites` along x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GratingVector {
    pub turns: [i32; 2],
    pub sites: usize,
}

impl GratingVector {
    /// Turns at a step along x and y.
    pub fn turns_per_site(&self) -> [f64; 2] {
        self.turns.map(|t| f64::from(t) / self.sites as f64)
    }

    /// Solve it for light from a direction (sines in air): amplitude of each order, such that the squared modulus is the
    /// share of the incident power, averaged over where the phase of the grating starts.
    ///
    /// On the lattice of sites orders are known up to a turn at every site. Of the orders that fall together that
    /// nearest to the first is taken. One that does not propagate in air has no amplitude.
    ///
    /// # Errors
    /// As [`Blaze::solve`].
    pub fn solve(&self, cell: &CoarseCell<'_>, mapping: &Mapping, sines: [f64; 2]) -> Result<OrderAmplitudes> {
        let lattice = SiteLattice::of_grating(self.turns, self.sites)?;
        let count = PHASES.div_ceil(lattice.len());
        let mut sum = [[Complex64::ZERO; KEPT]; 2];
        for number in 0..count {
            // Half a step off, so that no site stands on the jump of the mapping at phase zero.
            let offset_turns = (number as f64 + 0.5) / (count * lattice.len()) as f64;
            let blaze = Blaze {
                turns: self.turns,
                sites: self.sites,
                offset_turns,
            };
            let orders = blaze.solve(cell, |u| mapping.width_nm(u), sines)?;
            for kept in 0..KEPT {
                let m = FIRST_KEPT + kept as i32;
                let wave = self.nearest_to_first(m, &lattice);
                let Some(order) = orders.response().order(wave) else {
                    continue;
                };
                let back = Complex64::cis(-TAU * f64::from(m) * offset_turns) / count as f64;
                for (pol, sum) in sum.iter_mut().enumerate() {
                    sum[kept] += order.amplitude(pol) * back;
                }
            }
        }
        Ok(sum)
    }

    /// Wave vector of an order, in parts of the number of sites a turn at every site.
    fn nearest_to_first(&self, order: i32, lattice: &SiteLattice) -> [i32; 2] {
        let n = lattice.len() as i32;
        self.turns.map(|t| {
            let first = t * n / self.sites as i32;
            let further = ((order - 1) * first).rem_euclid(n);
            first + if 2 * further > n { further - n } else { further }
        })
    }
}
