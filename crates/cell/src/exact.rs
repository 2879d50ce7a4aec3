//! Mappings without a polynomial: for every phase the width that answers it best.

use std::fs;
use std::path::Path;

use num_complex::Complex64;
use serde::Serialize;

use super::{CellModel, InversePolynomial, MappingError, PhaseCurve};
use metalith_core::{Error, Result};

/// Width for each of equal parts of a turn.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MappingTable {
    /// Width (nm) of phases from `i / n` to `(i + 1) / n` turns.
    pub widths_nm: Vec<u16>,
}

/// Parts of a turn of an exact mapping: finer than the phase of one step of 2 nm in width.
const PARTS: usize = 512;

/// Longest mapping that is read (bytes), and the rounding of its phases in print.
const LONGEST_CSV: u64 = 4 << 20;
const PRINTED_TURNS: f64 = 1e-6;

/// Rounds of exchange after which a mapping is as good as it gets; each round only ever gains.
const MOST_ROUNDS: usize = 200;

/// Power that a mapping sends into the orders of a blazed ramp, over the incident power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RampOrders {
    /// Wavelength (um).
    pub wavelength_um: f64,
    /// Where the design sends it.
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

    /// The table as text: the phase in the middle of each part (turns) and its width.
    pub fn to_csv(&self) -> String {
        let n = self.widths_nm.len() as f64;
        let mut text = "turns,width_nm\n".to_owned();
        for (i, width) in self.widths_nm.iter().enumerate() {
            text += &format!("{:.6},{width}\n", (i as f64 + 0.5) / n);
        }
        text
    }

    /// Reads what [`MappingTable::to_csv`] writes: parts of equal length, in order, of the widths `allowed`
    /// (nm), which rise.
    ///
    /// # Errors
    /// If the file cannot be read, has too few or too many rows, or a row is not such a part.
    pub fn read_csv(path: &Path, allowed: &[u16]) -> Result<Self> {
        let fault = |line: Option<usize>, what: String| Error::Table {
            path: path.to_owned(),
            line,
            what,
            hint: "give columns turns and width_nm: equal parts of a turn by their middles, widths that may be written"
                .into(),
        };
        let size = fs::metadata(path).map_err(Error::io("read", path))?.len();
        if size > LONGEST_CSV {
            return Err(fault(None, format!("{size} bytes are not a mapping")));
        }
        let bytes = fs::read(path).map_err(Error::io("read", path))?;
        let text = String::from_utf8_lossy(&bytes);
        let mut rows = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        if rows.next().is_none_or(|(_, header)| header != "turns,width_nm") {
            return Err(fault(Some(1), "the header is not `turns,width_nm`".into()));
        }
        let rows: Vec<_> = rows.collect();
        if rows.len() < 2 {
            return Err(fault(None, "fewer than two parts of a turn".into()));
        }
        let n = rows.len() as f64;
        let widths_nm = rows
            .iter()
            .enumerate()
            .map(|(i, &(line, row))| {
                let not_a_part = || fault(Some(line), format!("\"{row}\" is not a phase and a width"));
                let (turns, width) = row.split_once(',').ok_or_else(not_a_part)?;
                let turns: f64 = turns.trim().parse().map_err(|_| not_a_part())?;
                let width: u16 = width.trim().parse().map_err(|_| not_a_part())?;
                let middle = (i as f64 + 0.5) / n;
                let near = (turns - middle).abs() < 0.01 / n + PRINTED_TURNS;
                if !near {
                    return Err(fault(
                        Some(line),
                        format!("{turns} turns stand where {middle:.6} should"),
                    ));
                }
                if allowed.binary_search(&width).is_err() {
                    return Err(fault(Some(line), format!("a width of {width} nm may not be written")));
                }
                Ok(width)
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Self { widths_nm })
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
            return Err(Error::invalid(
                "a mapping that avoids every width",
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
        let n = self.widths_nm.len() as f64;
        let power = |order: i32| -> f64 {
            let parts = self.widths_nm.iter().enumerate();
            let sum: Complex64 = parts
                .map(|(i, &w)| {
                    t[usize::from(w)] * Complex64::cis(-f64::from(order) * std::f64::consts::TAU * (i as f64 + 0.5) / n)
                })
                .sum();
            (sum / (n * full)).norm_sqr()
        };
        let passed = self
            .widths_nm
            .iter()
            .map(|&w| (t[usize::from(w)] / full).norm_sqr())
            .sum::<f64>()
            / n;
        Ok(RampOrders {
            wavelength_um,
            first: power(1),
            zero: power(0),
            second: power(2),
            passed,
        })
    }
}

/// Steps of the simplex; by then it has shrunk to nothing for degrees up to six.
const SIMPLEX_STEPS: usize = 1500;

/// Where `loss` is least near `start`.
fn simplex(start: &[f64], loss: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    let n = start.len();
    let mut corners: Vec<(f64, Vec<f64>)> = (0..=n)
        .map(|k| {
            let mut x = start.to_vec();
            if k > 0 {
                x[k - 1] += 0.05;
            }
            (loss(&x), x)
        })
        .collect();
    let along = |from: &[f64], to: &[f64], share: f64| -> Vec<f64> {
        from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect()
    };
    for _ in 0..SIMPLEX_STEPS {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let centre: Vec<f64> = (0..n)
            .map(|i| corners[..n].iter().map(|c| c.1[i]).sum::<f64>() / n as f64)
            .collect();
        let tried = |share: f64, worst: &[f64]| {
            let x = along(&centre, worst, share);
            (loss(&x), x)
        };
        let worst = corners[n].1.clone();
        let mirrored = tried(-1.0, &worst);
        let next = if mirrored.0 < corners[0].0 {
            let further = tried(-2.0, &worst);
            if further.0 < mirrored.0 { further } else { mirrored }
        } else if mirrored.0 < corners[n - 1].0 {
            mirrored
        } else {
            let nearer = tried(if mirrored.0 < corners[n].0 { -0.5 } else { 0.5 }, &worst);
            if nearer.0 < corners[n].0.min(mirrored.0) {
                nearer
            } else {
                let best = corners[0].1.clone();
                for corner in &mut corners[1..] {
                    let x = along(&best, &corner.1, 0.5);
                    *corner = (loss(&x), x);
                }
                continue;
            }
        };
        corners[n] = next;
    }
    corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    corners.swap_remove(0).1
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
