//! The effect of a change of the pillar, solved with few orders and corrected towards the result of many.
//!
//! A changed pillar behaves like an upright pillar of the stated film with another width: wider if its walls are
//! tapered outwards, narrower if its corners are round, shifted in phase if it is higher. The truncation error, as a
//! factor, is nearly the same in both. Close to narrow resonances this fails; those few widths are solved in full.

use num_complex::Complex64;

/// Range, in steps of the table, of the search for the stated pillar that is closest to a changed one.
const MOST_ALIKE: isize = 14;

/// A second difference of the ratio of two pillars above this, over one step of the table, indicates a resonance.
const BENT: f64 = 0.06;

/// Largest number of steps from its true width at which few orders find a resonance.
const BESIDE: usize = 1;

/// Transmissions over width at one wavelength.
pub(crate) struct CorrectedTable {
    pub t: Vec<Complex64>,
    /// Widths that have to be solved in full.
    pub resonant: Vec<usize>,
}

/// `fine` and `coarse` are those of the stated pillar with many and few orders, `changed` those of the changed
/// one with few.
pub(crate) fn corrected(fine: &[Complex64], coarse: &[Complex64], changed: &[Complex64]) -> CorrectedTable {
    let last = fine.len() - 1;
    let shift = most_alike(coarse, changed);
    let like = |k: usize| k.saturating_add_signed(shift).min(last);
    let by_change: Vec<Complex64> = (0..=last).map(|k| changed[k] / coarse[like(k)]).collect();
    let by_orders: Vec<Complex64> = (0..=last).map(|k| fine[like(k)] / coarse[like(k)]).collect();
    let bends = |ratio: &[Complex64], k: usize| {
        let beside = (ratio[k.saturating_sub(1)] + ratio[(k + 1).min(last)]) * 0.5;
        // Where the transmission is close to zero, the ratio is undefined.
        let bend = (ratio[k] - beside).norm();
        !bend.is_finite() || bend > BENT
    };
    let sharp: Vec<bool> = (0..=last)
        .map(|k| bends(&by_change, k) || bends(&by_orders, k))
        .collect();
    let resonant = (0..=last).filter(|&k| {
        let beside = k.saturating_sub(BESIDE)..=(k + BESIDE).min(last);
        sharp[beside].contains(&true)
    });
    CorrectedTable {
        t: changed.iter().zip(&by_orders).map(|(t, ratio)| t * ratio).collect(),
        resonant: resonant.collect(),
    }
}

/// Steps to the stated pillar that is closest to a changed one, up to a common phase.
fn most_alike(stated: &[Complex64], changed: &[Complex64]) -> isize {
    let last = stated.len() - 1;
    let unlike = |shift: isize| -> f64 {
        let pairs = changed.iter().enumerate();
        let pairs = pairs.map(|(k, t)| (t, stated[k.saturating_add_signed(shift).min(last)]));
        let sum: Complex64 = pairs.clone().map(|(t, s)| t * s.conj()).sum();
        let turn = Complex64::cis(sum.arg());
        // Moduli, not their squares: less weight on resonances.
        pairs.map(|(t, s)| (t - turn * s).norm()).sum()
    };
    let shifts = -MOST_ALIKE..=MOST_ALIKE;
    shifts.min_by(|a, b| unlike(*a).total_cmp(&unlike(*b))).unwrap_or(0)
}
