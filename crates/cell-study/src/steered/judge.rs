//! The first order of an element by supercells of rows of its own pillars.

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_cell::CellStack;
use metalith_core::{Error, Progress, Result, Wedge};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_grating::{CoarseCell, RealRow};

/// Directions of rows away from the middle, and where they begin, over the radius of the lens.
const DIRECTIONS: [[i32; 2]; 5] = [[1, 0], [-1, 0], [0, 1], [1, 1], [1, -1]];
const RADII: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.88];

/// Pillars of a row along x, where a mirror plane may halve the unknowns, and of others.
const PILLARS: usize = 20;
const PILLARS_ACROSS: usize = 12;

/// Share of the light in the first order, mean of s and p, of all rows together: those that do not fit into the lens are
/// left out. `light`: wavelength (um) and direction of arrival (sines in air); `width_nm` draws a phase (turns).
///
/// # Errors
/// If no row fits, a supercell cannot be solved, or the user stopped it.
pub(super) fn judge(
    stack: &CellStack,
    lens: &LensPhase,
    wedge: &Wedge,
    light: (f64, [f64; 2]),
    width_nm: &(dyn Fn(f64) -> f64 + Sync),
    progress: &dyn Progress,
) -> Result<f64> {
    let (wavelength_um, sines) = light;
    let phase = ElementPhase::new(lens, wedge);
    let half_um = lens.lattice().sites() as f64 * lens.lattice().pitch_um() / 2.0;
    let rows: Vec<([i32; 2], Vec<f64>)> = DIRECTIONS
        .iter()
        .flat_map(|direction| RADII.map(|radius| (*direction, radius * half_um)))
        .filter_map(|(direction, radius_um)| {
            let pillars = if direction[1] == 0 { PILLARS } else { PILLARS_ACROSS };
            Some((direction, phase.row(radius_um, direction, pillars)?))
        })
        .collect();
    if rows.is_empty() {
        return Err(Error::invalid(
            format!("a lens of {half_um:.1} um radius has no row of {PILLARS} pillars"),
            "choose mappings for a larger one",
        ));
    }
    let widths = rows.iter().flat_map(|(_, turns)| turns).map(|u| width_nm(*u));
    let range_nm = widths.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), w| {
        (low.min(w), high.max(w))
    });
    let coarse = CoarseCell::new(stack, wavelength_um, range_nm)?;
    progress.begin(
        &format!("judging rows of pillars at {:.0} nm", wavelength_um * 1e3),
        rows.len() as u64,
    );
    let amplitudes = rows
        .par_iter()
        .map(|(direction, turns)| {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let row = RealRow {
                direction: *direction,
                widths_nm: turns.iter().map(|u| width_nm(*u)).collect(),
            };
            let solved = row.solve(&coarse, sines)?;
            progress.advance(1);
            Ok(solved.first_order(solved.transmitted(), turns))
        })
        .collect::<Result<Vec<[Complex64; 2]>>>()?;
    let count = amplitudes.len() as f64;
    let share = |pol: usize| (amplitudes.iter().map(|a| a[pol]).sum::<Complex64>() / count).norm_sqr();
    Ok((share(0) + share(1)) / 2.0)
}
