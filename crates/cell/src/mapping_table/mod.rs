//! Mappings without a polynomial: for every phase the width that answers it best.

mod csv;
mod simplex;
mod solved;

use num_complex::Complex64;
use serde::Serialize;

use crate::{CellModel, InversePolynomial, MappingError, PhaseCurve};
use metalith_core::{Error, Result};
pub use simplex::simplex;
pub use solved::{AVOIDED_BELOW, SolvedMapping};

/// Width for each of equal parts of a turn.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MappingTable {
    /// Width (nm) of phases from `i / n` to `(i + 1) / n` turns.
    pub widths_nm: Vec<u16>,
}

/// Parts of a turn of an exact mapping: finer than the phase of one step of 2 nm in width.
const PARTS: usize = 512;

/// Rounds of exchange after which a mapping is as good as it gets; each round only ever gains.
const MOST_ROUNDS: usize = 200;

/// Power that a mapping sends into the orders of a blazed ramp, over the incident power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RampOrders {
    /// Wavelength (um).
    pub wavelength_um: f64,
    /// Power in the order into which the design sends it.
    pub first: f64,
    /// Straight on, unfocused.
    pub zero: f64,
    /// The second order of the lens.
    pub second: f64,
    /// All that leaves in the zero order of the lattice.
    pub passed: f64,
}

impl MappingTable {
    /// The width (nm) for a phase of `u` turns, `0 <= u < 1`.
    pub fn width_nm(&self, u: f64) -> u16 {
        let n = self.widths_nm.len();
        self.widths_nm[((u * n as f64) as usize).min(n - 1)]
    }

    /// The width whose phase is nearest, of the widths of `curve` that are not in `avoid`. The phase of
    /// the narrowest is zero.
    ///
    /// # Errors
    /// If no width is left.
    pub fn nearest(curve: &PhaseCurve, avoid: &[u16]) -> Result<Self> {
        let allowed: Vec<usize> = (0..curve.widths_nm.len())
            .filter(|&i| !avoid.contains(&curve.widths_nm[i]))
            .collect();
        let Some(&first) = allowed.first() else {
            return Err(Error::refused(
                "mapping/all-widths-avoided",
                "the mapping avoids every width",
                "lower the threshold below which a width is avoided",
            ));
        };
        let distance = |i: usize, u: f64| {
            let turns = curve.turns[i] - curve.turns[first] - u;
            (turns - turns.round()).abs()
        };
        let widths_nm = phases()
            .map(|u| {
                let best = allowed
                    .iter()
                    .min_by(|&&a, &&b| distance(a, u).total_cmp(&distance(b, u)));
                curve.widths_nm[*best.expect("at least one is allowed")]
            })
            .collect();
        Ok(Self { widths_nm })
    }

    /// A mapping of any form at the same phases.
    pub fn sampled(width_nm: impl Fn(f64) -> u16) -> Self {
        Self {
            widths_nm: phases().map(width_nm).collect(),
        }
    }

    /// The mapping with the most light in the first order, on the mean of `curves`, from this one on: part
    /// by part of the turn the width is taken that gains most, until none does.
    ///
    /// The power of the first order is the square of a sum over the parts, so that an exchange costs a
    /// few operations a wavelength.
    #[must_use]
    pub fn exchanged(&self, curves: &[PhaseCurve]) -> Self {
        let mut best = self.clone();
        let n = best.widths_nm.len();
        let Some(widths) = curves.first().map(|c| c.widths_nm.clone()) else {
            return best;
        };
        let index = |width: u16| widths.partition_point(|&w| w < width).min(widths.len() - 1);
        let turn = |i: usize| Complex64::cis(-std::f64::consts::TAU * (i as f64 + 0.5) / n as f64) / n as f64;
        for _ in 0..MOST_ROUNDS {
            let mut sums: Vec<Complex64> = curves.iter().map(|c| ramp_amplitude(&best, c, 1)).collect();
            let mut changed = false;
            for i in 0..n {
                let now = index(best.widths_nm[i]);
                let rotation = turn(i);
                let merit = |candidate: usize| -> f64 {
                    let each = curves.iter().zip(&sums);
                    each.map(|(c, sum)| (sum + (c.t[candidate] - c.t[now]) * rotation).norm_sqr())
                        .sum()
                };
                let (choice, gain) = (0..widths.len()).map(|candidate| (candidate, merit(candidate))).fold(
                    (now, merit(now)),
                    |best, next| {
                        if next.1 > best.1 * (1.0 + 1e-12) { next } else { best }
                    },
                );
                if choice != now && gain > 0.0 {
                    for (c, sum) in curves.iter().zip(&mut sums) {
                        *sum += (c.t[choice] - c.t[now]) * rotation;
                    }
                    best.widths_nm[i] = widths[choice];
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        best
    }

    /// The polynomial of the same basis and degree with the most light in the first order on the mean of
    /// `curves`, from `start` on, by the downhill simplex of Nelder and Mead (Comput. J. 7, 308 (1965)).
    /// Widths are held within those of the curves and rounded to them.
    pub fn best_polynomial(start: &InversePolynomial, curves: &[PhaseCurve], pitch_nm: f64) -> InversePolynomial {
        let Some(first) = curves.first() else {
            return start.clone();
        };
        let widths = &first.widths_nm;
        let (low, high) = (f64::from(widths[0]), f64::from(widths[widths.len() - 1]));
        let with = |coefficients: &[f64]| InversePolynomial {
            coefficients: coefficients.to_vec(),
            ..start.clone()
        };
        let loss = |coefficients: &[f64]| -> f64 {
            let polynomial = with(coefficients);
            let (narrow, wide) = polynomial.range();
            // A mapping that leaves the widths is not one, however well its clamped form does.
            let outside = (low - narrow * pitch_nm).max(wide * pitch_nm - high).max(0.0);
            let table = Self::sampled(|u| {
                let width = (polynomial.duty(u) * pitch_nm).clamp(low, high);
                let at = widths.partition_point(|&w| f64::from(w) < width).min(widths.len() - 1);
                let nearer_before = at > 0 && width - f64::from(widths[at - 1]) < f64::from(widths[at]) - width;
                widths[at - usize::from(nearer_before)]
            });
            let light: f64 = curves.iter().map(|c| ramp_amplitude(&table, c, 1).norm_sqr()).sum();
            outside - light / curves.len() as f64
        };
        with(&simplex(&start.coefficients, loss))
    }

    /// Power of the first order, mean of `curves`.
    pub fn first_order(&self, curves: &[PhaseCurve]) -> f64 {
        let sum: f64 = curves.iter().map(|c| ramp_amplitude(self, c, 1).norm_sqr()).sum();
        sum / curves.len().max(1) as f64
    }

    /// Phase error of the widths at the wavelength of `curve`.
    pub fn phase_error(&self, curve: &PhaseCurve) -> MappingError {
        let n = self.widths_nm.len() as f64;
        let parts = self.widths_nm.iter().enumerate();
        MappingError::of_turns(parts.map(|(i, &w)| curve.turns_at(f64::from(w)) - (i as f64 + 0.5) / n))
    }

    /// Orders of a ramp that rises by many parts a turn, so that every phase occurs alike, which is what
    /// a lens is nearly everywhere.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`].
    pub fn orders(&self, cell: &dyn CellModel, wavelength_um: f64) -> Result<RampOrders> {
        let widest = self.widths_nm.iter().copied().max().unwrap_or(0);
        let t = cell.transmissions(wavelength_um, widest)?;
        let full = cell.full_transmission(wavelength_um)?;
        Ok(self.ramp(wavelength_um, full, |width| t[usize::from(width)]))
    }

    /// [`MappingTable::orders`] at the wavelength of a curve that has all widths of the mapping.
    pub fn orders_of(&self, curve: &PhaseCurve) -> RampOrders {
        let last = curve.widths_nm.len() - 1;
        let at = |width| curve.widths_nm.partition_point(|&v| v < width).min(last);
        self.ramp(curve.wavelength_um, 1.0, |width| curve.t[at(width)])
    }

    fn ramp(&self, wavelength_um: f64, full: f64, t: impl Fn(u16) -> Complex64) -> RampOrders {
        let n = self.widths_nm.len() as f64;
        let power = |order: i32| -> f64 {
            let parts = self.widths_nm.iter().enumerate();
            let sum: Complex64 = parts
                .map(|(i, &w)| t(w) * Complex64::cis(-f64::from(order) * std::f64::consts::TAU * (i as f64 + 0.5) / n))
                .sum();
            (sum / (n * full)).norm_sqr()
        };
        let passed = self.widths_nm.iter().map(|&w| (t(w) / full).norm_sqr()).sum::<f64>() / n;
        RampOrders {
            wavelength_um,
            first: power(1),
            zero: power(0),
            second: power(2),
            passed,
        }
    }
}

fn phases() -> impl Iterator<Item = f64> {
    (0..PARTS).map(|i| (i as f64 + 0.5) / PARTS as f64)
}

/// Amplitude of an order of a ramp.
fn ramp_amplitude(mapping: &MappingTable, curve: &PhaseCurve, order: i32) -> Complex64 {
    let n = mapping.widths_nm.len() as f64;
    let last = curve.widths_nm.len() - 1;
    let sum: Complex64 = mapping
        .widths_nm
        .iter()
        .enumerate()
        .map(|(i, &w)| {
            let at = curve.widths_nm.partition_point(|&v| v < w).min(last);
            curve.t[at] * Complex64::cis(-f64::from(order) * std::f64::consts::TAU * (i as f64 + 0.5) / n)
        })
        .sum();
    sum / n
}
