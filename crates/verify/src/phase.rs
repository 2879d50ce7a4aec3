//! Phase errors of the pillars of an element: of rounding their widths, and of the mapping itself.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use metalith_design::array::PillarRule;
use metalith_pillars::PillarRows;

/// Root mean square and largest magnitude of a phase error over the pillars (rad); not a number if there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhaseError {
    pub rms_rad: f64,
    pub largest_rad: f64,
}

/// Errors of the phase of a written element against the phase that was asked of it, at the wavelength of the mapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhaseErrors {
    /// Width as written, or rotation as drawn, against the unrounded one, by [`PillarRule::turns_of_width`].
    pub rounding: PhaseError,
    /// Phase of the pillar as the cell has it against the design phase, less the mean.
    pub mapping: PhaseError,
}

/// Transmission of pillars at the wavelength of the mapping.
pub struct PillarResponse<'a> {
    /// Transmission of each class of pillars, zero where the aperture is shut.
    pub table: &'a [Complex64],
    /// Class of a pillar, by its site counted row by row and its width (nm).
    pub class: &'a (dyn Fn(usize, u16) -> usize + Sync),
}

impl PhaseErrors {
    /// Compare the pillars of an element with its phase: `phase` has the one of a column and a row (turns, 0 to 1), none where no
    /// pillar is compared.
    pub fn of(widths: &dyn PillarRows, phase: SitePhase<'_>, rule: &PillarRule, response: &PillarResponse<'_>) -> Self {
        let by_width = |nm: f64| TAU * rule.turns_of_width(nm);
        let written = (0..=widths.largest_number())
            .map(|w| TAU * rule.turns_of_written(w))
            .collect::<Vec<_>>();
        let turns_of = |t: &Complex64| (t.norm() > 0.0).then(|| t.arg() / TAU);
        let turns: Vec<Option<f64>> = response.table.iter().map(turns_of).collect();
        let off = |pillar: Pillar| Some(turns[(response.class)(pillar.site, pillar.width_nm)]? - pillar.design_turns);

        // One walk for the rounding and the mean of the mapping, one for the mapping about its mean.
        let first = per_row(widths, phase, |pillars| {
            pillars.fold((Sums::default(), Complex64::ZERO), |(mut sums, mean), pillar| {
                let rounded = written[usize::from(pillar.width_nm)] - by_width(rule.unrounded_nm(pillar.design_turns));
                // The last rotation is next to the first.
                sums.add(rounded - TAU * (rounded / TAU).round());
                let unit = off(pillar).map_or(Complex64::ZERO, |turns| Complex64::cis(TAU * turns));
                (sums, mean + unit)
            })
        });
        let mean: Complex64 = first.iter().map(|(_, mean)| mean).sum();
        let mean_turns = mean.arg() / TAU;
        let second = per_row(widths, phase, |pillars| {
            pillars.filter_map(off).fold(Sums::default(), |mut sums, turns| {
                let about = turns - mean_turns;
                sums.add(TAU * (about - about.round()));
                sums
            })
        });
        Self {
            rounding: Sums::error(first.iter().map(|(sums, _)| sums)),
            mapping: Sums::error(second.iter()),
        }
    }
}

/// Phase of a site by its column and row (turns, 0 to 1); none outside the lens.
pub type SitePhase<'a> = &'a (dyn Fn(usize, usize) -> Option<f64> + Sync);

/// A pillar as read, with the phase of its site (turns, 0 to 1).
#[derive(Clone, Copy, Debug)]
struct Pillar {
    /// Place, counted row by row.
    site: usize,
    width_nm: u16,
    design_turns: f64,
}

/// Errors of a row (rad).
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    squares: f64,
    largest: f64,
    count: u64,
}

impl Sums {
    fn add(&mut self, error: f64) {
        self.squares += error * error;
        self.largest = self.largest.max(error.abs());
        self.count += 1;
    }

    /// Over all rows.
    fn error<'s>(rows: impl Iterator<Item = &'s Self>) -> PhaseError {
        let all = rows.fold(Self::default(), |all, row| Self {
            squares: all.squares + row.squares,
            largest: all.largest.max(row.largest),
            count: all.count + row.count,
        });
        // Of no pillars there is no error, not one of zero.
        PhaseError {
            rms_rad: (all.squares / all.count as f64).sqrt(),
            largest_rad: if all.count > 0 { all.largest } else { f64::NAN },
        }
    }
}

/// Fold each row on whatever thread; the caller adds the rows in order, so that sums do not depend on
/// the number of threads.
fn per_row<T: Send>(
    widths: &dyn PillarRows,
    phase: SitePhase<'_>,
    fold: impl Fn(&mut dyn Iterator<Item = Pillar>) -> T + Sync,
) -> Vec<T> {
    let n = widths.lattice().sites();
    (0..n)
        .into_par_iter()
        .map_init(Vec::new, |room, iy| {
            let row = widths.row(iy, 0..n, room);
            let mut pillars = row
                .iter()
                .enumerate()
                .filter(|(_, w)| **w != 0)
                .filter_map(|(ix, &width_nm)| {
                    Some(Pillar {
                        site: iy * n + ix,
                        width_nm,
                        design_turns: phase(ix, iy)?,
                    })
                });
            fold(&mut pillars)
        })
        .collect()
}
