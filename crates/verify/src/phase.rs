//! Phase errors of the pillars of an element: of rounding their widths, and of the mapping itself.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use metalith_cell::ForwardPolynomial;
use metalith_core::WidthMap;
use metalith_design::array::WidthRule;
use metalith_design::phase::ElementPhase;

/// Root mean square and largest magnitude of a phase error over the pillars (rad).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhaseError {
    pub rms_rad: f64,
    pub largest_rad: f64,
}

/// What a written element does to the phase that was asked of it, at the wavelength of the mapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhaseErrors {
    /// Width as written against the unrounded width, by the published polynomial.
    pub rounding: PhaseError,
    /// Phase of the pillar as the cell has it against the design phase, less the mean.
    pub mapping: PhaseError,
}

impl PhaseErrors {
    /// Compare the pillars of an element with its phase. `response` is what a pillar transmits at the wavelength of
    /// the mapping (um), zero where its aperture is shut.
    pub fn of(
        widths: &WidthMap,
        phase: &ElementPhase<'_>,
        rule: &WidthRule,
        wavelength_um: f64,
        response: &(dyn Fn(Pillar) -> Complex64 + Sync),
    ) -> Self {
        let pitch_nm = f64::from(widths.lattice.pitch_nm());
        let forward = ForwardPolynomial::published();
        let by_width = |nm: f64| TAU * forward.turns(nm / pitch_nm, wavelength_um);
        let widest = widths.width_nm.iter().copied().max().unwrap_or(0);
        let written = (0..=widest).map(|w| by_width(f64::from(w))).collect::<Vec<_>>();
        let rounding = accumulate(widths, phase, |pillar, u| {
            Some(written[usize::from(pillar.width_nm)] - by_width(rule.unrounded_nm(u)))
        });
        let off = |pillar: Pillar, u: f64| unit(response(pillar)) * Complex64::cis(-TAU * u);
        let mean = sum_rows(widths, phase, Complex64::ZERO, off);
        let piston = unit(mean).conj();
        let mapping = accumulate(widths, phase, |pillar, u| {
            let off = off(pillar, u);
            (off != Complex64::ZERO).then(|| (off * piston).arg())
        });
        Self { rounding, mapping }
    }
}

/// A pillar as read.
#[derive(Clone, Copy, Debug)]
pub struct Pillar {
    /// Its place, counted row by row.
    pub site: usize,
    pub width_nm: u16,
}

fn unit(t: Complex64) -> Complex64 {
    let modulus = t.norm();
    if modulus > 0.0 { t / modulus } else { t }
}

/// Root mean square and largest of an error over all pillars that have one.
fn accumulate(
    widths: &WidthMap,
    phase: &ElementPhase<'_>,
    error: impl Fn(Pillar, f64) -> Option<f64> + Sync,
) -> PhaseError {
    let rows = per_row(widths, phase, |sites| {
        let errors = sites.filter_map(|(pillar, u)| error(pillar, u));
        errors.fold((0.0_f64, 0.0_f64, 0_u64), |(squares, largest, count), e| {
            (squares + e * e, largest.max(e.abs()), count + 1)
        })
    });
    let (squares, largest_rad, count) = rows
        .into_iter()
        .fold((0.0, 0.0_f64, 0), |(s, l, n), (rs, rl, rn)| (s + rs, l.max(rl), n + rn));
    PhaseError {
        rms_rad: (squares / count.max(1) as f64).sqrt(),
        largest_rad,
    }
}

fn sum_rows(
    widths: &WidthMap,
    phase: &ElementPhase<'_>,
    zero: Complex64,
    value: impl Fn(Pillar, f64) -> Complex64 + Sync,
) -> Complex64 {
    per_row(widths, phase, |sites| {
        sites.map(|(pillar, u)| value(pillar, u)).fold(zero, |a, b| a + b)
    })
    .into_iter()
    .fold(zero, |a, b| a + b)
}

/// Fold each row on whatever thread; the caller adds the rows in order, so that sums do not depend on
/// the number of threads. Sites come with their phase (turns, 0 to 1).
fn per_row<T: Send>(
    widths: &WidthMap,
    phase: &ElementPhase<'_>,
    fold: impl Fn(&mut dyn Iterator<Item = (Pillar, f64)>) -> T + Sync,
) -> Vec<T> {
    let n = widths.lattice.sites();
    (0..n)
        .into_par_iter()
        .map(|iy| {
            let row = widths.width_nm.row(iy);
            let mut sites = row
                .iter()
                .enumerate()
                .filter(|(_, w)| **w != 0)
                .filter_map(|(ix, &width_nm)| {
                    let site = iy * n + ix;
                    Some((Pillar { site, width_nm }, phase.wrapped(ix, iy)?))
                });
            fold(&mut sites)
        })
        .collect()
}
