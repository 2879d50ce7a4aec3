//! Choice of the width to draw for each intended one.

use std::collections::BTreeMap;

use num_complex::Complex64;
use rayon::prelude::*;

use super::line::{ColourTransmissions, Line};
use metalith_pillars::PillarMap;

/// Rounds of choosing widths and then the free phases; both converge in a few.
const ROUNDS: usize = 6;

/// Free phases that the search starts from, as optical paths common to all pillars: every 20 nm over so many to
/// each side. From the phases that fit the uncorrected pillars alone it would stay there: they take up the mean of
/// what is to be corrected.
const STARTS: i32 = 12;
const START_STEP_UM: f64 = 0.02;

/// Pillars that are alike: intended width (nm) or number, and step of density, with how many there are.
#[derive(Default)]
pub(crate) struct Kinds(BTreeMap<(u16, i32), u64>);

/// Drawn width of each kind.
pub(crate) struct DrawnWidths {
    pub drawn: BTreeMap<(u16, i32), u16>,
    /// Relative rms error if widths stay as they are.
    pub before: f64,
    /// And with those chosen.
    pub after: f64,
}

impl Kinds {
    /// Count the pillars of an element that stands for `copies`.
    pub(crate) fn count(&mut self, widths: &PillarMap, steps: &[i32], copies: u64) {
        for (&w, &step) in widths.number.iter().zip(steps) {
            if w > 0 {
                *self.0.entry((w, step)).or_default() += copies;
            }
        }
    }

    /// Least and greatest step of density; zeros without pillars.
    pub(crate) fn steps(&self) -> (i32, i32) {
        let all = self.0.keys().map(|k| k.1);
        (all.clone().min().unwrap_or(0), all.max().unwrap_or(0))
    }

    /// Choose among all widths that may be drawn, for a line that was solved for the steps of density.
    pub(crate) fn choose(&self, line: &Line) -> DrawnWidths {
        let same: BTreeMap<_, _> = self.0.keys().map(|&(w, step)| ((w, step), w)).collect();
        let (before, own) = self.agreement(line, &same);
        let by_path = |path_um: f64| -> Vec<Complex64> {
            let turn = |c: &ColourTransmissions| Complex64::cis(std::f64::consts::TAU * path_um / c.wavelength_um);
            line.colours.iter().map(turn).collect()
        };
        let starts = (-STARTS..=STARTS).map(|k| by_path(f64::from(k) * START_STEP_UM));
        let mut best = DrawnWidths {
            drawn: same,
            before,
            after: before,
        };
        for mut pistons in std::iter::once(own).chain(starts) {
            let mut found = (BTreeMap::new(), f64::INFINITY);
            for _ in 0..ROUNDS {
                let drawn = self.nearest(line, &pistons);
                let (error, next) = self.agreement(line, &drawn);
                pistons = next;
                if error >= found.1 {
                    break;
                }
                found = (drawn, error);
            }
            if found.1 < best.after {
                (best.drawn, best.after) = found;
            }
        }
        best
    }

    /// Pillar of each kind that, as fabricated, is nearest to the intended one, at given free phases.
    fn nearest(&self, line: &Line, pistons: &[Complex64]) -> BTreeMap<(u16, i32), u16> {
        let kinds: Vec<_> = self.0.keys().copied().collect();
        let of = |&(w, step): &(u16, i32)| {
            let miss = |place: usize| -> f64 {
                let pairs = line.colours.iter().zip(pistons);
                pairs
                    .map(|(c, p)| (line.made(c, place, step) * p - c.stated[usize::from(w)]).norm_sqr())
                    .sum()
            };
            let all = line.drawn.iter().enumerate().map(|(place, &d)| (miss(place), d));
            let best = all.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(w, |b| b.1);
            ((w, step), best)
        };
        let chosen: Vec<_> = kinds.par_iter().map(of).collect();
        chosen.into_iter().collect()
    }

    /// Relative error of fabricated pillars against intended ones, and the free phases at which it is least.
    fn agreement(&self, line: &Line, drawn: &BTreeMap<(u16, i32), u16>) -> (f64, Vec<Complex64>) {
        let (mut miss, mut size) = (0.0, 0.0);
        let mut of = |c: &ColourTransmissions| {
            let pairs = || {
                let kinds = self.0.iter().zip(drawn.values());
                kinds.filter_map(|((&(w, step), &n), d)| {
                    let place = line.drawn.binary_search(d).ok()?;
                    Some((line.made(c, place, step), c.stated[usize::from(w)], n as f64))
                })
            };
            let overlap: Complex64 = pairs().map(|(made, stated, n)| stated * made.conj() * n).sum();
            let piston = if overlap.norm() > 0.0 {
                overlap / overlap.norm()
            } else {
                Complex64::ONE
            };
            for (made, stated, n) in pairs() {
                miss += n * (made * piston - stated).norm_sqr();
                size += n * stated.norm_sqr();
            }
            piston
        };
        let pistons = line.colours.iter().map(&mut of).collect();
        ((miss / size).sqrt(), pistons)
    }
}
