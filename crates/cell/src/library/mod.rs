//! Libraries of upright rectangular pillars: which of them answers a phase for light along x and one for light along y.

mod csv;

use std::f64::consts::TAU;
use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use super::{Along, CellStack, MappingError, PolarisationAxis, UprightCell};
use metalith_core::{Error, Progress, Result};
use metalith_pillars::UprightRectangles;

/// Parts of a turn that phases are distinguished by, along either axis: 0.012 rad at most from the middle of one, where
/// neighbouring pillars of a library are some tenths apart.
const PARTS: usize = 256;

/// Parts of a turn of each phase that constants are tried by, and phases that each is judged at along an axis.
const CONSTANTS: usize = 16;
const JUDGED: usize = 24;

/// One pillar of a library.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LibraryPillar {
    /// Number among the pillars of the design.
    pub number: u16,
    /// Phase of light along x and along y (turns), each but for a constant that all pillars share.
    pub turns: [f64; 2],
    /// Share of the power of each that passes in the zero order.
    pub passed: [f64; 2],
}

/// Pillars that a mapping of two phases chooses from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PillarLibrary {
    pillars: Vec<LibraryPillar>,
    /// The number of the pillar over each part of a turn of both phases, that of y by the row.
    #[serde(skip)]
    over_parts: Vec<u16>,
    /// Phases by number (turns); none of those that are not in it.
    #[serde(skip)]
    turns: [Vec<Option<f64>>; 2],
}

/// Errors of a library for two phases that are asked for, all pairs equally often.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LibraryErrors {
    /// Phase of the pillar that is chosen against that asked for, for light along x and along y.
    pub phase: [MappingError; 2],
    /// Share of the power that arrives which follows the phase: the square of the mean field, less its phase, over all pairs, as of the
    /// first order of a blazed grating.
    pub first: [f64; 2],
    /// Share that passes, whatever its phase.
    pub passed: [f64; 2],
}

impl LibraryPillar {
    /// Fields of light along x and y, by their share of what arrives.
    fn fields(&self) -> [Complex64; 2] {
        [0, 1].map(|axis| Complex64::from_polar(self.passed[axis].sqrt(), TAU * self.turns[axis]))
    }
}

impl PillarLibrary {
    /// The library of these pillars.
    ///
    /// # Errors
    /// If there is none.
    pub fn new(pillars: Vec<LibraryPillar>) -> Result<Self> {
        if pillars.is_empty() {
            return Err(Error::refused(
                "library/empty",
                "the library has no pillars",
                "give at least one pillar: `metalith cells` writes the library of a design",
            ));
        }
        let fields: Vec<_> = pillars.iter().map(LibraryPillar::fields).collect();
        let over_parts = (0..PARTS * PARTS).into_par_iter().map(|part| {
            let wanted = [part % PARTS, part / PARTS].map(|k| Complex64::cis(TAU * middle(k, PARTS)));
            pillars[nearest(&fields, wanted).0].number
        });
        let over_parts = over_parts.collect();
        let last = pillars.iter().map(|p| usize::from(p.number)).max().unwrap_or(0);
        let turns = [0, 1].map(|axis| {
            let mut turns = vec![None; last + 1];
            pillars
                .iter()
                .for_each(|p| turns[usize::from(p.number)] = Some(p.turns[axis]));
            turns
        });
        Ok(Self {
            pillars,
            over_parts,
            turns,
        })
    }

    /// The library of a cell (see [`PillarLibrary::of_cell`]) and what all its pillars transmit at a wavelength (um), solved or read from
    /// the cache in `folder`.
    ///
    /// # Errors
    /// If the cell cannot be solved, or the user stopped it.
    pub fn solve(
        stack: &CellStack,
        pillars: UprightRectangles,
        wavelength_um: f64,
        folder: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<(Self, Along)> {
        let cell = UprightCell::new(stack.clone(), pillars, PolarisationAxis::X).cached_in(folder);
        let along = cell.along(wavelength_um, progress)?;
        let library = Self::of_cell(pillars, &along, stack.full_transmission(wavelength_um)?)?;
        Ok((library, along))
    }

    /// The library of all that a cell has: what pillars transmit along both axes, by number, where `full` is |t| of one that passes
    /// everything. Both phases are counted from constants that leave the least, and pillars that are never the nearest are left out.
    ///
    /// # Errors
    /// If there are no pillars.
    pub fn of_cell(pillars: UprightRectangles, along: &Along, full: f64) -> Result<Self> {
        let own = |number: u16| [0, 1].map(|axis| along[axis][usize::from(number)] / full);
        let fields: Vec<[Complex64; 2]> = (1..=pillars.count()).map(own).collect();
        let constants = |k: usize| [k % CONSTANTS, k / CONSTANTS].map(|k| k as f64 / CONSTANTS as f64);
        let left = |k: usize| {
            let [x, y] = constants(k).map(|turns| Complex64::cis(TAU * turns));
            let turned: Vec<_> = fields.iter().map(|f| [f[0] * x, f[1] * y]).collect();
            let judged = (0..JUDGED * JUDGED).map(|part| {
                let wanted = [part % JUDGED, part / JUDGED].map(|k| Complex64::cis(TAU * middle(k, JUDGED)));
                nearest(&turned, wanted).1
            });
            judged.sum::<f64>()
        };
        let left: Vec<f64> = (0..CONSTANTS * CONSTANTS).into_par_iter().map(left).collect();
        let best = (0..left.len())
            .min_by(|a, b| left[*a].total_cmp(&left[*b]))
            .unwrap_or(0);
        let constants = constants(best);
        let pillar = |number: u16| {
            let t = own(number);
            LibraryPillar {
                number,
                turns: [0, 1].map(|axis| (t[axis].arg() / TAU + constants[axis]).rem_euclid(1.0)),
                passed: t.map(|t| t.norm_sqr()),
            }
        };
        let all = Self::new((1..=pillars.count()).map(pillar).collect())?;
        let chosen: std::collections::BTreeSet<u16> = all.over_parts.iter().copied().collect();
        Self::new(all.pillars.into_iter().filter(|p| chosen.contains(&p.number)).collect())
    }

    /// The pillars.
    pub fn pillars(&self) -> &[LibraryPillar] {
        &self.pillars
    }

    /// The number of the pillar for a phase of light along x and one of light along y (turns, from 0 to 1): that whose fields are
    /// nearest to those of both phases without loss.
    pub fn number(&self, turns: [f64; 2]) -> u16 {
        let [x, y] = turns.map(|u| ((u * PARTS as f64) as usize).min(PARTS - 1));
        self.over_parts[y * PARTS + x]
    }

    /// Phase of light along an axis at a pillar of the library (turns).
    pub fn turns(&self, number: u16, axis: PolarisationAxis) -> Option<f64> {
        *self.turns[axis.index()].get(usize::from(number))?
    }

    /// Errors over all pairs of phases.
    pub fn errors(&self) -> LibraryErrors {
        let by_number: Vec<Option<[Complex64; 2]>> = {
            let last = self.turns[0].len();
            let mut fields = vec![None; last];
            self.pillars
                .iter()
                .for_each(|p| fields[usize::from(p.number)] = Some(p.fields()));
            fields
        };
        let each = |axis: usize| {
            let by_number = &by_number;
            self.over_parts.iter().enumerate().map(move |(part, &number)| {
                let wanted = middle([part % PARTS, part / PARTS][axis], PARTS);
                let field = by_number[usize::from(number)].map_or(Complex64::ZERO, |f| f[axis]);
                (wanted, field)
            })
        };
        let parts = self.over_parts.len() as f64;
        LibraryErrors {
            phase: [0, 1]
                .map(|axis| MappingError::of_turns(each(axis).map(|(wanted, field)| field.arg() / TAU - wanted))),
            first: [0, 1].map(|axis| {
                let follows = each(axis).map(|(wanted, field)| field * Complex64::cis(-TAU * wanted));
                (follows.sum::<Complex64>() / parts).norm_sqr()
            }),
            passed: [0, 1].map(|axis| each(axis).map(|(_, field)| field.norm_sqr()).sum::<f64>() / parts),
        }
    }
}

/// The middle of a part of a turn.
fn middle(k: usize, parts: usize) -> f64 {
    (k as f64 + 0.5) / parts as f64
}

/// Index of the fields nearest to these, and the square of their distance; of two the first.
fn nearest(fields: &[[Complex64; 2]], wanted: [Complex64; 2]) -> (usize, f64) {
    let off = |f: &[Complex64; 2]| (f[0] - wanted[0]).norm_sqr() + (f[1] - wanted[1]).norm_sqr();
    let each = fields.iter().map(off).enumerate();
    each.fold(
        (0, f64::INFINITY),
        |best, next| if next.1 < best.1 { next } else { best },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A library of ideal pillars on a grid of phases, a twelfth of a turn apart.
    fn grid() -> Vec<LibraryPillar> {
        let pillar = |k: u16| LibraryPillar {
            number: k + 1,
            turns: [f64::from(k % 12) / 12.0, f64::from(k / 12) / 12.0],
            passed: [1.0; 2],
        };
        (0..144).map(pillar).collect()
    }

    #[test]
    fn the_nearest_pillar_is_chosen_for_both_phases_and_across_whole_turns() {
        let library = PillarLibrary::new(grid()).unwrap();
        for (turns, number) in [
            ([0.0, 0.0], 1),
            ([0.97, 0.02], 1),
            ([0.25, 0.5], 1 + 3 + 12 * 6),
            ([0.999, 0.92], 1 + 12 * 11),
        ] {
            assert_eq!(library.number(turns), number, "{turns:?}");
        }
        assert_eq!(library.turns(14, PolarisationAxis::X), Some(1.0 / 12.0));
        assert_eq!(library.turns(14, PolarisationAxis::Y), Some(1.0 / 12.0));
        assert_eq!(library.turns(200, PolarisationAxis::X), None);
        assert!(library == library.clone());
        assert!(PillarLibrary::new(Vec::new()).is_err());
    }

    /// Phases that are rounded to a twelfth of a turn: an even error of half of that, and its share of the light.
    #[test]
    fn what_a_library_leaves_is_that_of_rounding() {
        // Of parts of a turn, 256, which no twelfth is a whole number of.
        const PARTED: f64 = 0.01;
        let errors = PillarLibrary::new(grid()).unwrap().errors();
        let step = TAU / 12.0;
        let sinc = (std::f64::consts::PI / 12.0).sin() / (std::f64::consts::PI / 12.0);
        for axis in [0, 1] {
            let error = errors.phase[axis];
            assert!(
                (error.rms_rad / (step / 12f64.sqrt()) - 1.0).abs() < PARTED,
                "{error:?}"
            );
            assert!((error.worst_rad / (step / 2.0) - 1.0).abs() < 5.0 * PARTED, "{error:?}");
            assert!(
                (errors.first[axis] - sinc.powi(2)).abs() < PARTED && errors.passed[axis] == 1.0,
                "{errors:?}"
            );
        }
    }

    /// Dark pillars are left, and constants take phases to where pillars are.
    #[test]
    fn a_library_of_a_cell_has_the_pillars_that_are_nearest_and_its_own_constants() {
        let pillars = UprightRectangles {
            shortest_nm: 100,
            step_nm: 10,
            lengths: 12,
        };
        let full = 1.2;
        let field = |k: usize| Complex64::from_polar(full, TAU * (k as f64 / 12.0 + 0.03));
        let mut along: Along = [0, 1].map(|axis| {
            let of = |n: usize| field([n % 12, n / 12][axis]);
            std::iter::once(Complex64::ZERO).chain((0..144).map(of)).collect()
        });
        // One that passes little is never the nearest.
        along[0][30] *= 0.01;
        along[1][30] *= 0.01;
        let library = PillarLibrary::of_cell(pillars, &along, full).unwrap();
        assert_eq!(library.pillars().len(), 143);
        assert!(
            library
                .pillars()
                .iter()
                .all(|p| p.number != 30 && (p.passed[0] - 1.0).abs() < 1e-12)
        );
        let errors = library.errors();
        assert!(errors.first.iter().all(|first| *first > 0.97), "{errors:?}");
    }
}
