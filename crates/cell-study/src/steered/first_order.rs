//! The first order of an element by supercells of rows of its own pillars.

use rayon::prelude::*;

use metalith_cell::{CellStack, CoarseCell, ElementRow, RealRow, SiteGrid};
use metalith_core::{Error, Progress, Result, Wedge};
use metalith_design::phase::{ElementPhase, LensPhase};

/// Radii where rows begin, over the radius of the lens.
const RADII: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.88];

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
    let half_um = lens.lattice().sites() as f64 * lens.lattice().steps_um()[0] / 2.0;
    let grid = SiteGrid::of(stack);
    let wedge_sines = [wedge.sin_x, wedge.sin_y];
    let directions = if grid.is_square() {
        RealRow::directions(wedge_sines)
    } else {
        RealRow::axes(wedge_sines)
    };
    let rows = ElementRow::of_element(
        grid,
        &RADII.map(|radius| radius * half_um),
        &directions,
        |radius_um, direction, pillars| phase.row(radius_um, direction, pillars),
        width_nm,
    );
    if rows.is_empty() {
        return Err(Error::refused(
            "cells/lens-too-small",
            format!(
                "a lens with a radius of {half_um:.1} um is too small: it has no row of pillars that can be solved"
            ),
            "choose mappings for a larger lens",
        ));
    }
    let widths = rows.iter().flat_map(|r| &r.row.widths_nm);
    let range_nm = widths.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), w| {
        (low.min(*w), high.max(*w))
    });
    let coarse = CoarseCell::new(stack, wavelength_um, range_nm)?;
    progress.begin(
        &format!("judging rows of pillars at {:.0} nm", wavelength_um * 1e3),
        rows.len() as u64,
    );
    let amplitudes = rows
        .par_iter()
        .map(|row| {
            progress.check_stopped()?;
            let solved = row.row.solve(&coarse, sines)?;
            progress.advance(1);
            Ok(solved.first_order(solved.transmitted(), &row.turns))
        })
        .collect::<Result<Vec<_>>>()?;
    Ok(ElementRow::share(&amplitudes))
}
