//! Results of a supercell: every order with its amplitude and power.

use num_complex::Complex64;

use super::placed::Placed;
use super::{SupercellPart, SupercellProblem};
use crate::Incidence;
use crate::error::Result;
use crate::response::{finite, flux};

/// Response of a supercell to a plane wave.
///
/// Polarisations as in [`crate::Response`]: s lies in the plane of the lattice, p has its transverse part
/// along the transverse wave vector, here with its x, or else its y, above zero; along the normal p is x and
/// s is y.
#[derive(Clone, Debug)]
pub struct SupercellResponse {
    /// All orders that propagate on either side.
    pub orders: Vec<SupercellOrder>,
}

/// One order of a supercell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupercellOrder {
    /// Wave vector less that of the incident wave, by the turns over both steps of a [`SiteLattice`](crate::SiteLattice), in parts
    /// of the number of sites: (1, 0) is one turn over the length of a row. On a square lattice these are its components along x and
    /// y in units of 2 pi / (pitch times the number of sites).
    pub wave: [i32; 2],
    /// Components of its wave vector over that in vacuum.
    pub sines: [f64; 2],
    /// Transmitted Ex and Ey, for s and p incident, `[incident][component]`; phases at the middle of site 0, where the
    /// stack ends. Scaled
    /// so that the incident wave carries unit power and |Ex|^2 + |Ey|^2 is the power of an order along the normal.
    pub transmitted: [[Complex64; 2]; 2],
    /// Transverse unit vectors of the incident s and p.
    pub incident: [[f64; 2]; 2],
    /// Transmitted over incident power, for s and p incident.
    pub power: [f64; 2],
    /// Reflected over incident power, for s and p incident.
    pub reflected: [f64; 2],
}

impl SupercellOrder {
    /// Field along the transverse unit vector of the incident polarisation (0 for s, 1 for p). For a wave in the x-z
    /// plane it is Ey for s and Ex for p.
    pub fn along_incident(&self, polarisation: usize) -> Complex64 {
        let ([x, y], unit) = (self.transmitted[polarisation], self.incident[polarisation]);
        x * unit[0] + y * unit[1]
    }

    /// Amplitude whose squared modulus is the power of the order, and whose phase is that of
    /// [`SupercellOrder::along_incident`]; 0 for s, 1 for p.
    pub fn amplitude(&self, polarisation: usize) -> Complex64 {
        let own = self.along_incident(polarisation);
        let norm = own.norm();
        if norm > 0.0 {
            own * (self.power[polarisation].sqrt() / norm)
        } else {
            Complex64::ZERO
        }
    }
}

impl SupercellResponse {
    /// Power of all orders on both sides over the incident, for s and p incident: 1 without loss.
    pub fn total_power(&self) -> [f64; 2] {
        [0, 1].map(|pol| self.orders.iter().map(|o| o.power[pol] + o.reflected[pol]).sum())
    }

    /// The order of a wave vector, if it propagates on either side.
    pub fn order(&self, wave: [i32; 2]) -> Option<&SupercellOrder> {
        self.orders.iter().find(|o| o.wave == wave)
    }

    pub(super) fn new(problem: &SupercellProblem, incidence: &Incidence, parts: &[SupercellPart]) -> Result<Self> {
        // Unit vectors that do not turn over as the wave passes the normal.
        let [x, y] = incidence.direction();
        let sign = if x < 0.0 || (x == 0.0 && y < 0.0) { -1.0 } else { 1.0 };
        let [x, y] = [sign * x, sign * y];
        let polarisations = [[-y, x], [x, y]];
        let cell = &problem.cell;
        let arriving = polarisations.map(|e| flux(cell.below, problem.k, e.map(Complex64::from)));
        // A wave of unit power along the normal has Ex^2 + Ey^2 = 1 / n above.
        let unit = cell.above.re;
        let mut orders = Vec::new();
        let placed = Placed::of(cell);
        for wave in placed.waves(problem.highest) {
            let sines = placed.sines(wave, problem.k, problem.step);
            let square = sines[0] * sines[0] + sines[1] * sines[1];
            let travels = |index: Complex64| (index * index).re > square;
            if !travels(cell.above) && !travels(cell.below) {
                continue;
            }
            let mut order = SupercellOrder {
                wave,
                sines,
                transmitted: [[Complex64::ZERO; 2]; 2],
                incident: polarisations,
                power: [0.0; 2],
                reflected: [0.0; 2],
            };
            for polarisation in [0, 1] {
                let [on, back] = amplitudes(parts, polarisations[polarisation], wave);
                order.power[polarisation] = flux(cell.above, sines, on) / arriving[polarisation];
                order.reflected[polarisation] = flux(cell.below, sines, back) / arriving[polarisation];
                finite(Complex64::new(order.power[polarisation], order.reflected[polarisation]))?;
                order.transmitted[polarisation] = on.map(|e| e * (unit / arriving[polarisation]).sqrt());
            }
            orders.push(order);
        }
        Ok(Self { orders })
    }
}

/// Transverse amplitudes [transmitted, reflected] of a wave, for a unit transverse field along `incident`.
fn amplitudes(parts: &[SupercellPart], incident: [f64; 2], wave: [i32; 2]) -> [[Complex64; 2]; 2] {
    let mut sum = [[Complex64::ZERO; 2]; 2];
    for part in parts {
        for (column, unit) in part.incident.iter().enumerate() {
            let weight = unit[0] * incident[0] + unit[1] * incident[1];
            for (total, field) in sum.iter_mut().zip([&part.ends.transmitted, &part.ends.reflected]) {
                let amplitude = part.waves.amplitude(field, column, wave);
                total[0] += weight * amplitude[0];
                total[1] += weight * amplitude[1];
            }
        }
    }
    sum
}
