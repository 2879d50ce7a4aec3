//! Shares of light that a mapped cell sends where the design says, and elsewhere.

use metalith_cell::CellModel;
use metalith_core::Result;
use num_complex::Complex64;

use super::light::Efficiency;
use crate::rings::mapping::Mapping;

/// Phases that the mean over a turn is taken of.
const PHASES: usize = 64;

/// Shares of a wavelength (um) that pillars of a mapping pass with the phase that is mapped to them, and with another.
///
/// # Errors
/// If the cell is not known at the wavelength.
pub fn efficiency(cell: &dyn CellModel, mapping: &Mapping, wavelength_um: f64) -> Result<Efficiency> {
    let table = cell.transmissions(wavelength_um, mapping.max_width_nm() + 1)?;
    let full = cell.full_transmission(wavelength_um)?;
    let (mut with, mut against, mut power) = (Complex64::ZERO, Complex64::ZERO, 0.0);
    for k in 0..PHASES {
        let waves = (k as f64 + 0.5) / PHASES as f64;
        let width = mapping.width_nm(waves).0.round() as usize;
        let t = table[width.min(table.len() - 1)] / full;
        let turn = Complex64::cis(std::f64::consts::TAU * waves);
        with += t * turn.conj() / PHASES as f64;
        against += t * turn / PHASES as f64;
        power += t.norm_sqr() / PHASES as f64;
    }
    let focused = with.norm_sqr().max(against.norm_sqr());
    Ok(Efficiency {
        focused,
        stray: (power - focused).max(0.0),
    })
}
