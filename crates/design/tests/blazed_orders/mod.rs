//! The diffraction orders of a blazed grating, solved as a supercell.

use std::f64::consts::TAU;

use metalith_cell::{Blaze, CoarseCell};
use metalith_rcwa::{SiteLattice, SupercellResponse};
use num_complex::Complex64;

/// One order of a grating.
#[derive(Clone, Copy)]
pub(crate) struct BlazeOrder {
    /// Amplitude along the incident field for s and p incident, `[incident]`, less the phase of the grating at the
    /// origin: it does not turn with `offset_turns`. Its squared modulus is the share.
    pub amplitude: [Complex64; 2],
    /// Share of the incident power, for s and p incident.
    pub share: [f64; 2],
}

/// The orders of a solved grating.
pub(crate) struct BlazeOrders {
    /// Wave vector of the first order less that of the incident wave, as in
    /// [`SupercellOrder::wave`](metalith_rcwa::SupercellOrder::wave).
    first: [i64; 2],
    offset_turns: f64,
    response: SupercellResponse,
}

impl BlazeOrders {
    /// The orders of a grating whose phases (turns, 0 <= u < 1) are drawn by `width_nm`, in light from a direction with
    /// these `sines` in air along x and y.
    pub(crate) fn solve(blaze: &Blaze, cell: &CoarseCell<'_>, width_nm: impl Fn(f64) -> f64, sines: [f64; 2]) -> Self {
        let lattice = SiteLattice::of_grating(blaze.turns, blaze.sites).unwrap();
        let response = cell
            .solve(lattice, &blaze.widths_nm(&lattice, width_nm), sines)
            .unwrap();
        // The lattice has fewer sites than the grating says where turns and sites have a common divisor.
        let first = blaze
            .turns
            .map(|t| i64::from(t) * lattice.len() as i64 / blaze.sites as i64);
        Self {
            first,
            offset_turns: blaze.offset_turns,
            response,
        }
    }

    /// Order `m`: its wave vector is the sum of the incident wave's and m times the grating's. Zero where it does not propagate.
    pub(crate) fn order(&self, m: i32) -> BlazeOrder {
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
}

/// Sines by which the first order of a grating is turned, for a wavelength over the pitch.
pub(crate) fn first_order_sines(blaze: &Blaze, wavelength_over_pitch: f64) -> [f64; 2] {
    blaze
        .turns
        .map(|t| f64::from(t) / blaze.sites as f64 * wavelength_over_pitch)
}
