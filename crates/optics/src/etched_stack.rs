//! The cell as etched: a stated stack with a change, and the widths that its pillars can have.

use metalith_cell::CellStack;
use metalith_core::Result;
use num_complex::Complex64;

use super::CellChange;

/// Least width of a pillar, and least room that a pillar's foot leaves in its cell (nm).
const LEAST_NM: f64 = 1.0;

/// The stack with a change.
pub fn perturbed(stated: &CellStack, change: &CellChange) -> CellStack {
    CellStack {
        height_nm: stated.height_nm + change.height_nm,
        film: stated.film.shifted(change.index),
        taper: stated.taper + change.taper_deg.to_radians(),
        corner_radius_nm: stated.corner_radius_nm + change.corner_rounding_nm,
        mask_height_nm: stated.mask_height_nm + change.residual_mask_nm,
        ..stated.clone()
    }
}

/// Factor that brings the transmission of pillars at the rim, `rim_nm` higher than those in the middle, from their tops
/// to the plane of the tops in the middle: the air between them is counted once.
///
/// # Errors
/// If the wavelength is outside the range of the ambient.
pub fn to_middle_tops(stack: &CellStack, rim_nm: f64, wavelength_um: f64) -> Result<Complex64> {
    let turns = -stack.ambient.index(wavelength_um)?.re * rim_nm * 1e-3 / wavelength_um;
    Ok(Complex64::cis(std::f64::consts::TAU * turns))
}

/// The nearest width that a pillar of this stack can have, its foot not in that of its neighbour (nm).
pub fn possible_width_nm(stack: &CellStack, width_nm: f64) -> f64 {
    let foot = (2.0 * stack.taper.tan() * stack.height_nm).max(0.0);
    let nearest_nm = stack.lattice.nearest_nm(stack.pitch_nm);
    let most = (nearest_nm - LEAST_NM - foot).max(LEAST_NM);
    width_nm.clamp(LEAST_NM, most)
}

/// A pillar that is narrower by these (nm) is the same to anyone, but no mode of it is at its cutoff.
const OFF_CUTOFF_NM: [f64; 2] = [3e-4, 1e-3];

/// Solve a cell of some width (nm). A mode exactly at its cutoff has no field to solve for; where that is so, a
/// pillar narrower by a thousandth of a nanometre stands in.
///
/// # Errors
/// That of `solve` if the neighbouring widths fail as well.
pub fn off_cutoff<T>(width_nm: f64, solve: impl Fn(f64) -> Result<T>) -> Result<T> {
    solve(width_nm)
        .or_else(|_| solve(width_nm - OFF_CUTOFF_NM[0]))
        .or_else(|_| solve(width_nm - OFF_CUTOFF_NM[1]))
}
