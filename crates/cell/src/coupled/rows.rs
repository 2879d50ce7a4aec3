//! Errors of a model of single sites on rows of real pillars.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::Complex64;

use metalith_core::{Error, Result};
use metalith_rcwa::SiteLattice;

use super::site_grid::images;
use super::{CoarseCell, Orientation, SiteGrid};

/// Pillars of a row along x, where a mirror plane halves the unknowns, and of others.
const PILLARS: usize = 20;
const PILLARS_ACROSS: usize = 12;

/// Number of pillars of a row along x of a hexagonal lattice, whose pillars are half a pitch from one to the next.
const PILLARS_OF_HALVES: usize = 14;

/// Pillars at either end that do not count where a row is closed to a ring only to be solved: they stand beside a jump that the
/// element does not have. The neighbours that matter most are within two pitches.
const ENDS: usize = 3;

/// Number of pillars at either end of a row whose pillars are half a pitch from one to the next.
const ENDS_OF_HALVES: usize = 4;

/// The axes and diagonals.
const AROUND: [[i32; 2]; 8] = [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]];

/// Consecutive pillars of an element, in a direction across which its widths hardly change.
///
/// To be solved the row is closed to a ring, and repeated across: along y for a row along x, and along (1, -1) for one along (1, 1).
/// Its supercell has as many sites as the row.
///
/// On a hexagonal lattice rows are along the axes, in places of its grid: along x of two rows of the lattice, half a pitch from one
/// pillar to the next, along y of one pillar of each.
#[derive(Clone, Debug, PartialEq)]
pub struct RealRow {
    /// Direction: along an axis or a diagonal, such as (1, 0), (0, -1) or (-1, 1).
    pub direction: [i32; 2],
    /// Width of each pillar (nm); a diagonal row has a site at every step of x + y.
    pub widths_nm: Vec<f64>,
    /// True if its first pillar follows the last, as in a blazed grating. If not, the three pillars at either end are
    /// solved with the others but count in no sum.
    pub repeats: bool,
}

/// A row whose supercell is solved.
#[derive(Clone, Debug)]
pub struct SolvedRow {
    /// The sites of its supercell.
    pub lattice: SiteLattice,
    /// Width of each site (nm), in their order.
    pub widths_nm: Vec<f64>,
    /// Number of the pillar of the row that each site is.
    pub pillars: Vec<usize>,
    /// Transmission of each site, `[polarisation][site]`.
    transmitted: [Vec<Complex64>; 2],
    full: f64,
    /// Numbers of the pillars that count.
    counted: Range<usize>,
}

/// A row of an element, with the phase that is asked of each of its pillars.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementRow {
    /// Place where it begins, from the middle of the element (um).
    pub radius_um: f64,
    /// Phase of each pillar (turns).
    pub turns: Vec<f64>,
    pub row: RealRow,
}

impl ElementRow {
    /// Rows that stand for an element: one for each radius (um) and direction, 20 pillars long along x (14 on a hexagonal lattice) and 12
    /// in others.
    /// `turns` gives the phases of consecutive sites from a radius on in a direction, nothing where the element ends before:
    /// such rows are left out. `width_nm` draws a phase.
    pub fn of_element(
        grid: SiteGrid,
        radii_um: &[f64],
        directions: &[[i32; 2]],
        turns: impl Fn(f64, [i32; 2], usize) -> Option<Vec<f64>>,
        width_nm: impl Fn(f64) -> f64,
    ) -> Vec<Self> {
        let places = radii_um.iter().flat_map(|r| directions.iter().map(|d| (*r, *d)));
        places
            .filter_map(|(radius_um, direction)| {
                let pillars = match (direction[1], grid.is_square()) {
                    (0, true) => PILLARS,
                    (0, false) => PILLARS_OF_HALVES,
                    _ => PILLARS_ACROSS,
                };
                let turns = turns(radius_um, direction, pillars)?;
                let widths_nm = turns.iter().map(|u| width_nm(*u)).collect();
                Some(Self {
                    radius_um,
                    turns,
                    row: RealRow {
                        direction,
                        widths_nm,
                        repeats: false,
                    },
                })
            })
            .collect()
    }

    /// Share of the light in the first order of all rows together, mean of s and p, from the amplitude of each.
    pub fn share(amplitudes: &[[Complex64; 2]]) -> f64 {
        let count = amplitudes.len().max(1) as f64;
        let share = |pol: usize| (amplitudes.iter().map(|a| a[pol]).sum::<Complex64>() / count).norm_sqr();
        (share(0) + share(1)) / 2.0
    }
}

impl SolvedRow {
    /// Transmission of each site, `[polarisation][site]`, scaled as a single cell.
    pub fn transmitted(&self) -> &[Vec<Complex64>; 2] {
        &self.transmitted
    }

    /// Sites that count, each with the number of its pillar.
    fn counted(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let sites = self.pillars.iter().copied().enumerate();
        sites.filter(|(_, pillar)| self.counted.contains(pillar))
    }

    /// Amplitude of the first order for s and p, its squared modulus a share of the light: the mean over the sites that count of
    /// what they transmit, `found` (`[polarisation][site]`, scaled as a single cell), less the phase that is asked of each
    /// pillar of the row (turns).
    pub fn first_order(&self, found: &[Vec<Complex64>; 2], turns: &[f64]) -> [Complex64; 2] {
        let back = |pillar: usize| Complex64::cis(-TAU * turns[pillar]) / self.full;
        found.each_ref().map(|found| {
            let sum: Complex64 = self.counted().map(|(site, pillar)| found[site] * back(pillar)).sum();
            sum / self.counted.len() as f64
        })
    }

    /// Light that a model puts elsewhere than the supercell does: sum of |t - t'|^2 over the sites that count, over that of full
    /// transmission; mean of s and p. `found` is the transmission of every site by the model, `[polarisation][site]`,
    /// scaled as that of a single cell.
    pub fn misfit(&self, found: &[Vec<Complex64>; 2]) -> f64 {
        let of_one = |(found, wanted): (&Vec<Complex64>, &Vec<Complex64>)| -> f64 {
            let off = |(site, _): (usize, usize)| (found[site] - wanted[site]).norm_sqr();
            self.counted().map(off).sum()
        };
        let sum: f64 = found.iter().zip(&self.transmitted).map(of_one).sum();
        sum / (2.0 * self.counted.len() as f64 * self.full * self.full)
    }
}

impl RealRow {
    /// Axes and diagonals from the middle of an element on which its pillars differ. Its phase is one over the radius and a wedge with
    /// these sines along x and y; of directions that a mirror turns into one another there is the first. That is two without a wedge,
    /// five of a wedge along an axis or a diagonal, else all eight.
    pub fn directions(wedge: [f64; 2]) -> Vec<[i32; 2]> {
        let orientation = Orientation::of(wedge, [0.0; 2]);
        let steered = orientation.turned(wedge);
        let (mut distinct, mut seen) = (Vec::new(), Vec::new());
        for direction in AROUND {
            let turned = orientation.turned(direction.map(f64::from));
            if !seen.contains(&turned) {
                seen.extend(images(steered, turned).into_iter().map(|(image, _)| image));
                distinct.push(direction);
            }
        }
        distinct
    }

    /// The axes from the middle of an element of a hexagonal lattice on which its pillars differ, by mirrors of these axes.
    pub fn axes(wedge: [f64; 2]) -> Vec<[i32; 2]> {
        let there = AROUND.into_iter().filter(|direction| direction.contains(&0));
        let differs = |direction: &[i32; 2]| {
            let backwards = direction.iter().any(|step| *step < 0);
            !backwards || (0..2).any(|axis| direction[axis] != 0 && wedge[axis] != 0.0)
        };
        there.filter(differs).collect()
    }

    /// Pillars at either end that do not count, where the row does not repeat.
    fn ends(&self, grid: SiteGrid) -> usize {
        if self.direction[1] == 0 && !grid.is_square() {
            ENDS_OF_HALVES
        } else {
            ENDS
        }
    }

    /// Numbers of the pillars that count in sums.
    fn counted(&self, grid: SiteGrid) -> Range<usize> {
        let (pillars, ends) = (self.widths_nm.len(), self.ends(grid));
        if self.repeats {
            0..pillars
        } else {
            ends..pillars.saturating_sub(ends)
        }
    }

    /// Solve its supercell for light from a direction (sines in air).
    ///
    /// # Errors
    /// If the direction makes fewer sites than there are pillars, if none of them counts, or as the solver.
    pub fn solve(&self, cell: &CoarseCell<'_>, sines: [f64; 2]) -> Result<SolvedRow> {
        let pillars = self.widths_nm.len();
        let grid = cell.grid();
        let turns = grid.turns_of_places(self.direction);
        let lattice = SiteLattice::of_grating(turns, pillars)?;
        if lattice.len() != pillars {
            return Err(Error::refused(
                "supercell/direction-off-axes",
                format!("a row of {pillars} pillars in the direction {:?}", self.direction),
                "use a direction along an axis or a diagonal, such as (1, 0) or (-1, 1)",
            ));
        }
        let counted = self.counted(grid);
        if counted.is_empty() {
            return Err(Error::refused(
                "supercell/not-periodic",
                format!("a row of {pillars} pillars is too short to be periodic"),
                {
                    let ends = self.ends(grid);
                    format!("give more than {}: {ends} at either end do not count", 2 * ends)
                },
            ));
        }
        let order: Vec<usize> = (0..pillars)
            .map(|i| {
                let [x, y] = lattice.site(i).map(|v| v as i64);
                let [p, q] = turns.map(i64::from);
                (p * x + q * y).rem_euclid(pillars as i64) as usize
            })
            .collect();
        let widths: Vec<f64> = order.iter().map(|i| self.widths_nm[*i]).collect();
        let full = cell.full_transmission()?;
        let response = cell.solve(lattice, &widths, sines)?;
        Ok(SolvedRow {
            transmitted: cell.transmissions(&lattice, &response, full),
            lattice,
            widths_nm: widths,
            pillars: order,
            full,
            counted,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of a dozen numbers of size one.
    const ROUNDING: f64 = 1e-12;

    /// A row whose sites transmit all light with the phase that is asked of them (turns a pillar), but for those at its ends, which
    /// transmit none.
    fn dark_at_its_ends(pillars: usize, repeats: bool, turns: f64) -> SolvedRow {
        let row = RealRow {
            direction: [1, 0],
            widths_nm: vec![200.0; pillars],
            repeats,
        };
        let t = |i: usize| {
            if (ENDS..pillars - ENDS).contains(&i) {
                Complex64::cis(TAU * turns * i as f64) * 2.0
            } else {
                Complex64::ZERO
            }
        };
        SolvedRow {
            lattice: SiteLattice::row(pillars).unwrap(),
            pillars: (0..pillars).collect(),
            transmitted: [0, 1].map(|_| (0..pillars).map(t).collect()),
            full: 2.0,
            counted: row.counted(SiteGrid::SQUARE),
            widths_nm: row.widths_nm,
        }
    }

    #[test]
    fn pillars_beside_the_seam_count_only_where_the_row_repeats() {
        const PILLARS: usize = 12;
        const TURNS: f64 = 0.15;
        let asked: Vec<f64> = (0..PILLARS).map(|i| TURNS * i as f64).collect();
        let whole: Vec<_> = asked.iter().map(|u| Complex64::cis(TAU * u) * 2.0).collect();
        for (repeats, first, misfit) in [(false, 1.0, 0.0), (true, 0.5, 0.5)] {
            let row = dark_at_its_ends(PILLARS, repeats, TURNS);
            for amplitude in row.first_order(row.transmitted(), &asked) {
                assert!((amplitude - first).norm() < ROUNDING, "{repeats}: {amplitude}");
            }
            let found = row.misfit(&[whole.clone(), whole.clone()]);
            assert!((found - misfit).abs() < ROUNDING, "{repeats}: {found}");
        }
    }

    #[test]
    fn directions_are_those_that_no_mirror_exchanges() {
        let diagonal = 0.25;
        for (wedge, wanted) in [
            ([0.0, 0.0], vec![[1, 0], [1, 1]]),
            ([-0.25, -0.0], vec![[1, 0], [-1, 0], [0, 1], [1, 1], [-1, -1]]),
            ([0.0, 0.25], vec![[1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]]),
            ([-diagonal, -diagonal], vec![[1, 0], [-1, 0], [1, 1], [-1, -1], [1, -1]]),
            ([diagonal, -diagonal], vec![[1, 0], [-1, 0], [1, 1], [1, -1], [-1, 1]]),
            ([-0.5, -0.25], AROUND.to_vec()),
        ] {
            assert_eq!(RealRow::directions(wedge), wanted, "{wedge:?}");
        }
    }

    #[test]
    fn axes_of_a_hexagonal_lattice_are_those_that_no_mirror_exchanges() {
        for (wedge, wanted) in [
            ([0.0, 0.0], vec![[1, 0], [0, 1]]),
            ([-0.25, 0.0], vec![[1, 0], [-1, 0], [0, 1]]),
            ([0.0, 0.25], vec![[1, 0], [0, 1], [0, -1]]),
            ([0.2, 0.2], vec![[1, 0], [-1, 0], [0, 1], [0, -1]]),
        ] {
            assert_eq!(RealRow::axes(wedge), wanted, "{wedge:?}");
        }
    }

    #[test]
    fn a_row_of_which_nothing_counts_is_refused() {
        let stack = crate::CellStack::paper(350.0, 700.0).unwrap();
        let cell = CoarseCell::new(&stack, 0.53, (100.0, 300.0)).unwrap();
        let row = RealRow {
            direction: [1, 0],
            widths_nm: vec![180.0; 2 * ENDS],
            repeats: false,
        };
        let refused = row.solve(&cell, [0.0; 2]).unwrap_err();
        assert_eq!(refused.id(), "supercell/not-periodic");
    }
}
