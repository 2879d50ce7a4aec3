//! Transmission of each site of a supercell, from its orders.

use std::f64::consts::TAU;

use num_complex::Complex64;

use metalith_rcwa::{SiteLattice, SupercellOrder, SupercellResponse};

use super::SiteGrid;

/// Transmission of every site of a supercell, for s and p incident, `[polarisation][site]`: the samples on the lattice
/// of sites whose diffraction orders are those of the supercell. A lattice of samples distinguishes only directions
/// with
/// |sine| below half the wavelength over the pitch; orders beyond are left out.
///
/// |t|^2, averaged over the sites, is the power of these orders times `full`^2. With `full` the root of the index of
/// the substrate over that of the air, t is scaled as the transmission of a single cell. Of each order only the part
/// polarised as the incident wave counts.
pub(crate) fn transmissions_on(
    grid: SiteGrid,
    lattice: &SiteLattice,
    response: &SupercellResponse,
    wavelength_over_pitch: f64,
    full: f64,
) -> [Vec<Complex64>; 2] {
    let sites = lattice.len() as f64;
    let orders: Vec<_> = response
        .orders
        .iter()
        .filter(|order| grid.tells(order.sines.map(|sine| sine / wavelength_over_pitch)))
        .collect();
    [0, 1].map(|polarisation| {
        let amplitudes: Vec<_> = orders
            .iter()
            .map(|order| (order.wave, copolarised(order, polarisation) * full))
            .collect();
        (0..lattice.len())
            .map(|site| {
                let [x, y] = lattice.site(site).map(|v| v as f64);
                let phase = |wave: [i32; 2]| TAU * (f64::from(wave[0]) * x + f64::from(wave[1]) * y) / sites;
                amplitudes
                    .iter()
                    .map(|(wave, a)| a * Complex64::cis(phase(*wave)))
                    .sum()
            })
            .collect()
    })
}

/// Part of an order along the incident transverse field; its squared modulus is power.
fn copolarised(order: &SupercellOrder, polarisation: usize) -> Complex64 {
    let [x, y] = order.transmitted[polarisation];
    let norm = (x.norm_sqr() + y.norm_sqr()).sqrt();
    if norm > 0.0 {
        order.along_incident(polarisation) * (order.power[polarisation].sqrt() / norm)
    } else {
        Complex64::ZERO
    }
}
