//! The pillar at one wavelength with few diffraction orders.

use num_complex::Complex64;

use metalith_core::{Error, Result};
use metalith_rcwa::{Incidence, Orders, Side, SiteLattice, Supercell, SupercellResponse, solve_supercell};

use super::SiteGrid;
use super::sites::transmissions_on;
use crate::CellStack;

/// Highest order of a single cell that supercells keep along each axis: -2..=2. With widths corrected by
/// [`CoarseCell::shift_nm`] the first order of blazed rows of 3 to 18 pillars differs by 0.010 rms in share and
/// 0.010 rad in phase from that with 3 to 7 (`examples/blazed_rows.rs`). With highest order 3 it is about 0.006 and
/// 0.008, at (7/5)^6, about eight times the cost.
const COARSE: usize = 2;

/// Number of coarse orders on a hexagonal lattice, whose pillars are of silicon for the most part: with 2 the first
/// order of blazed rows of these differs by up to 0.17 in share from the result with 5, with 3 by 0.02
/// (`hexagonal_supercells` in the tests of the solver).
const COARSE_OF_HEXAGONAL: usize = 3;

/// Highest order of a single cell that supercells keep along each axis on such a lattice.
pub(crate) fn coarse(grid: SiteGrid) -> usize {
    if grid.is_square() { COARSE } else { COARSE_OF_HEXAGONAL }
}

/// Orders along an axis of the single cells that coarse ones are compared with. Their error is about 0.005 rad.
const FINE: usize = 13;

/// Largest correction of the width that is looked for (nm), and steps on either side of zero.
const MOST_SHIFT_NM: f64 = 3.0;
const SHIFT_STEPS: i32 = 12;

/// Widths at which coarse and fine cells are compared, so many that no single resonance decides.
const COMPARED_WIDTHS: usize = 21;

/// A pillar of any width at one wavelength, solved with few orders, 5 along each axis on a square lattice, and a width corrected for that.
#[derive(Clone, Debug)]
pub struct CoarseCell<'a> {
    stack: &'a CellStack,
    wavelength_um: f64,
    highest: usize,
    shift_nm: f64,
}

impl<'a> CoarseCell<'a> {
    /// The cell at a wavelength (um); `widths_nm` are the narrowest and the widest pillar (nm) to be right for.
    ///
    /// # Errors
    /// If the widths do not rise, do not fit the pitch, or the solver refuses the cell.
    pub fn new(stack: &'a CellStack, wavelength_um: f64, widths_nm: (f64, f64)) -> Result<Self> {
        let highest = coarse(SiteGrid::of(stack));
        let (low, high) = widths_nm;
        if !(low > 0.0 && low <= high) {
            return Err(Error::refused(
                "cell/width-range-invalid",
                format!("pillars from {low} to {high} nm wide"),
                "give the narrowest and the widest width in nm, both positive",
            ));
        }
        Ok(Self {
            stack,
            wavelength_um,
            highest,
            shift_nm: shift_nm(stack, wavelength_um, widths_nm, highest)?,
        })
    }

    /// Widening of a pillar for the solver (nm), so that few orders transmit as many do, in the mean square over the
    /// widths, along the normal. Too few orders act mostly like a pillar that is a little too thin.
    pub fn shift_nm(&self) -> f64 {
        self.shift_nm
    }

    /// Wavelength over pitch: the sine of one turn for each site.
    pub fn wavelength_over_pitch(&self) -> f64 {
        self.wavelength_um * 1e3 / self.stack.pitch_nm
    }

    /// Grid of the sites of its pillars.
    pub(crate) fn grid(&self) -> SiteGrid {
        SiteGrid::of(self.stack)
    }

    /// Transmission of every site of a solved supercell: see [`transmissions_on`].
    pub(crate) fn transmissions(
        &self,
        lattice: &SiteLattice,
        response: &SupercellResponse,
        full: f64,
    ) -> [Vec<Complex64>; 2] {
        transmissions_on(self.grid(), lattice, response, self.wavelength_over_pitch(), full)
    }

    /// |t| where all power goes on in the zero order.
    ///
    /// # Errors
    /// As [`CellStack::full_transmission`].
    pub fn full_transmission(&self) -> Result<f64> {
        self.stack.full_transmission(self.wavelength_um)
    }

    /// Solve pillars of these widths (nm), in the order of the sites of the lattice, lit from the substrate; `sines` of
    /// the direction of arrival in air along x and y.
    ///
    /// # Errors
    /// If there is not one finite width for each site, or as the solver.
    pub fn solve(&self, lattice: SiteLattice, widths_nm: &[f64], sines: [f64; 2]) -> Result<SupercellResponse> {
        if let Some(width) = widths_nm.iter().find(|width| !width.is_finite()) {
            return Err(Error::refused(
                "cell/width-out-of-range",
                format!("a pillar {width} nm wide"),
                "give its width in nm",
            ));
        }
        let cells = widths_nm
            .iter()
            .map(|width| self.stack.layers(width + self.shift_nm, self.wavelength_um))
            .collect::<Result<Vec<_>>>()?;
        let supercell = Supercell::of_cells(lattice, &cells)?;
        let incidence = Incidence::of_sines(self.wavelength_um, Side::Below, sines);
        Ok(solve_supercell(&supercell, &incidence, self.highest)?)
    }
}

/// The correction of the width: see [`CoarseCell::shift_nm`].
fn shift_nm(stack: &CellStack, wavelength_um: f64, (low, high): (f64, f64), highest: usize) -> Result<f64> {
    let (fine, coarse) = (Orders::new(FINE)?, Orders::new(2 * highest + 1)?);
    let widths: Vec<f64> = (0..COMPARED_WIDTHS)
        .map(|i| low + (high - low) * i as f64 / (COMPARED_WIDTHS - 1) as f64)
        .collect();
    let wanted: Vec<Complex64> = widths
        .iter()
        .map(|&width| stack.transmission(width, wavelength_um, fine))
        .collect::<Result<_>>()?;
    let distance = |shift: f64| -> Result<f64> {
        let each = widths.iter().zip(&wanted);
        each.map(|(width, t)| Ok((stack.transmission(width + shift, wavelength_um, coarse)? - t).norm_sqr()))
            .sum()
    };
    let mut best = (distance(0.0)?, 0.0);
    for step in (1..=SHIFT_STEPS).flat_map(|step| [step, -step]) {
        let shift = MOST_SHIFT_NM * f64::from(step) / f64::from(SHIFT_STEPS);
        // Where the widest pillar fills its pitch it cannot be wider; such a correction is not wanted either.
        if let Ok(found) = distance(shift)
            && found < best.0
        {
            best = (found, shift);
        }
    }
    Ok(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_orders_ask_for_wider_pillars() {
        let stack = CellStack::paper(350.0, 700.0).unwrap();
        for (wavelength_um, shift) in [(0.455, 1.5), (0.53, 1.0), (0.66, 1.0)] {
            let cell = CoarseCell::new(&stack, wavelength_um, (100.0, 300.0)).unwrap();
            let found = cell.shift_nm();
            assert!((found - shift).abs() <= 0.5, "{wavelength_um}: {found}");
        }
    }

    #[test]
    fn impossible_widths_are_refused() {
        let stack = CellStack::paper(350.0, 700.0).unwrap();
        for widths in [
            (300.0, 100.0),
            (0.0, 100.0),
            (f64::NAN, 100.0),
            (100.0, f64::INFINITY),
            (100.0, 360.0),
        ] {
            assert!(CoarseCell::new(&stack, 0.53, widths).is_err(), "{widths:?}");
        }
        let cell = CoarseCell::new(&stack, 0.53, (150.0, 150.0)).unwrap();
        let row = SiteLattice::row(2).unwrap();
        assert!(cell.solve(row, &[150.0], [0.0, 0.0]).is_err());
        assert!(cell.solve(row, &[150.0, f64::NAN], [0.0, 0.0]).is_err());
    }
}
