//! A blazed grating solved as a supercell: the local picture of a lens where its phase is steep.

use std::f64::consts::TAU;

use num_complex::Complex64;

use metalith_core::{Error, Result};
use metalith_rcwa::{SiteLattice, SupercellResponse};

use crate::CoarseCell;

/// A phase that rises evenly over the sites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blaze {
    /// Turns of the phase over `sites` sites along x and along y.
    pub turns: [i32; 2],
    /// Number of sites after which the pattern repeats.
    pub sites: usize,
    /// Phase of the site at the origin (turns).
    pub offset_turns: f64,
}

/// One order of a grating.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlazeOrder {
    /// Amplitude along the incident field for s and p incident, `[incident]`, less the phase of the grating at the
    /// origin: it does not turn with `offset_turns`. Its squared modulus is the share.
    pub amplitude: [Complex64; 2],
    /// Share of the incident power, for s and p incident.
    pub share: [f64; 2],
}

/// The orders of a solved grating.
#[derive(Clone, Debug)]
pub struct BlazeOrders {
    /// Wave vector of the first order less that of the incident wave, as in
    /// [`SupercellOrder::wave`](metalith_rcwa::SupercellOrder::wave).
    first: [i64; 2],
    offset_turns: f64,
    response: SupercellResponse,
}

impl Blaze {
    /// Sines by which the first order is turned, for a wavelength over the pitch.
    pub fn sines(&self, wavelength_over_pitch: f64) -> [f64; 2] {
        self.turns
            .map(|t| f64::from(t) / self.sites as f64 * wavelength_over_pitch)
    }

    /// Phase of a site (turns), in 0..1.
    pub fn phase(&self, x: usize, y: usize) -> f64 {
        let [p, q] = self.turns.map(f64::from);
        let phase = ((p * x as f64 + q * y as f64) / self.sites as f64 + self.offset_turns).rem_euclid(1.0);
        // A sum a rounding below a whole number of turns may come out as 1.
        if phase < 1.0 { phase } else { 0.0 }
    }

    /// Widths of the sites of its cell (nm), in the order of the lattice. `width_nm` is the mapping of phase
    /// (turns, 0 <= u < 1) to width.
    pub fn widths_nm(&self, lattice: &SiteLattice, width_nm: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..lattice.len())
            .map(|i| {
                let [x, y] = lattice.site(i);
                width_nm(self.phase(x, y))
            })
            .collect()
    }

    /// Solve it: `width_nm` is the mapping of phase (turns, 0 <= u < 1) to width (nm), `sines` the direction of arrival
    /// in air along x and y.
    ///
    /// # Errors
    /// If it has no sites or more than [`SiteLattice::MOST`], if its offset is not finite, or as [`CoarseCell::solve`].
    pub fn solve(&self, cell: &CoarseCell<'_>, width_nm: impl Fn(f64) -> f64, sines: [f64; 2]) -> Result<BlazeOrders> {
        if !self.offset_turns.is_finite() {
            return Err(Error::refused(
                "grating/phase",
                format!("a grating with a phase of {} turns at the origin", self.offset_turns),
                "give a finite phase",
            ));
        }
        let lattice = SiteLattice::of_grating(self.turns, self.sites)?;
        let response = cell.solve(lattice, &self.widths_nm(&lattice, width_nm), sines)?;
        // The lattice has fewer sites than the grating says where turns and sites have a common divisor.
        let first = self
            .turns
            .map(|t| i64::from(t) * lattice.len() as i64 / self.sites as i64);
        Ok(BlazeOrders {
            first,
            offset_turns: self.offset_turns,
            response,
        })
    }
}

impl BlazeOrders {
    /// Order `m`: its wave vector is that of the incident wave and m times that of the grating. Zero where it does not
    /// propagate.
    pub fn order(&self, m: i32) -> BlazeOrder {
        let [x, y] = self.first.map(|v| i32::try_from(i64::from(m) * v).ok());
        let order = x.zip(y).and_then(|(x, y)| self.response.order([x, y]));
        let Some(order) = order else {
            return BlazeOrder {
                amplitude: [Complex64::ZERO; 2],
                share: [0.0; 2],
            };
        };
        let turn = Complex64::cis(-TAU * f64::from(m) * self.offset_turns);
        BlazeOrder {
            amplitude: [0, 1].map(|pol| order.amplitude(pol) * turn),
            share: order.power,
        }
    }

    /// All orders of the supercell, also those between the orders of the grating.
    pub fn response(&self) -> &SupercellResponse {
        &self.response
    }
}
