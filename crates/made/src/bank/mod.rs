//! Transmissions over width, wavelength and the quantities of a pillar that vary, solved once for many chips.
//!
//! A study judges thousands of chips whose pillars differ a little. To solve the cells of each anew costs more than its
//! light does; a bank solves them on a grid, and chips take from it by cubic interpolation along every axis.

mod grid;

use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;

pub(crate) use self::grid::Axis;
use self::grid::Colour;
use super::rectangles::{RowOrders, RowsOfBiases, bare_row, row_length, solve_row};
use super::stack::{off_cutoff, perturbed, possible_width_nm};
use super::{CellChange, SolvedWidths};
use metalith_cell::{CellStack, kept};
use metalith_core::{Error, Progress, Rectangles, Result};
use metalith_rcwa::Orders;

/// Version of the kept file.
const MAGIC: [u8; 8] = *b"MLBANK\0\x01";

/// Longest file that is read.
const LONGEST: u64 = 1 << 32;

/// Distance of the widths of a bank (nm) where transmission is smooth.
const WIDTH_STEP_NM: f64 = 1.0;

/// Parts that a step is divided into where it is not: guided-mode resonances are a fraction of a nanometre wide.
const FINE_PARTS: usize = 8;

/// Where a width is farther than this from the cubic through its four neighbours, transmission is not smooth.
const ROUGH: f64 = 0.01;

/// Steps on either side of such a width that are divided too: a resonance moves with the pillar.
const BESIDE: usize = 2;

/// Widths that are solved beyond both ends, so that a cubic has its four points.
const BEYOND: usize = 2;

/// Largest distance of the nodes of height (nm), index, taper (deg), corners and mask (nm), in the order of
/// [`quantities`]: a twentieth of a turn or so.
const STACK_STEPS: [f64; QUANTITIES] = [5.0, 0.02, 0.75, 10.0, 5.0];

/// Stacks that are solved at the most. At some 15 CPU s each that is an hour and a half.
const MOST_STACKS: usize = 400;

/// Upright rectangles that are solved at the most, before widths between: at some 0.08 CPU s each that is an hour and a half.
const MOST_UPRIGHT: usize = 70_000;

const QUANTITIES: usize = 5;

/// The quantities of a pillar that may vary: height (nm), index, taper (deg), corner rounding (nm), mask (nm).
fn quantities(change: &CellChange) -> [f64; QUANTITIES] {
    [
        change.height_nm,
        change.index,
        change.taper_deg,
        change.corner_rounding_nm,
        change.residual_mask_nm,
    ]
}

fn change_of([height_nm, index, taper_deg, corner_rounding_nm, residual_mask_nm]: [f64; QUANTITIES]) -> CellChange {
    CellChange {
        height_nm,
        index,
        taper_deg,
        corner_rounding_nm,
        residual_mask_nm,
        ..CellChange::default()
    }
}

/// What a bank covers.
#[derive(Clone, Debug, PartialEq)]
pub struct BankRange {
    /// Narrowest and widest pillar as made (nm); of rectangles the least and the most that both edges are off by.
    pub widths_nm: [f64; 2],
    /// Of upright rectangles the numbers of the pillars that it holds, rising; of others nothing.
    pub numbers: Vec<u16>,
    /// Changes of the pillar: the least and the most of each number.
    pub changes: [CellChange; 2],
    /// Wavelength (um) and orders along an axis.
    pub colours: Vec<(f64, usize)>,
}

/// Transmissions along the normal, on a grid.
pub struct CellBank {
    stated: CellStack,
    range: BankRange,
    widths: Axis,
    axes: [Axis; QUANTITIES],
    colours: Vec<Colour>,
}

impl CellBank {
    /// Solve it. `stated`: the pillar that changes are counted from.
    ///
    /// # Errors
    /// If it would be too large, a cell cannot be solved, or the user stopped it.
    pub fn solve(stated: &CellStack, range: BankRange, progress: &dyn Progress) -> Result<Self> {
        let mut bank = Self::empty(stated, range)?;
        let (colours, stacks) = (bank.range.colours.len(), bank.stacks());
        let coarse: Vec<f64> = (0..bank.widths.nodes).map(|k| bank.widths.node(k)).collect();
        progress.begin("solving the tables of cells", (colours * (stacks + 1)) as u64);
        for colour in 0..colours {
            let rows = bank.solve_rows(colour, &coarse, progress)?;
            let added = between(&coarse, &rows, bank.each(), bank.alike());
            let fine = bank.solve_rows(colour, &added, &Unwatched(progress))?;
            bank.colours
                .push(merged((&coarse, &rows), (&added, &fine), bank.each()));
            progress.advance(1);
        }
        Ok(bank)
    }

    /// One row for each stack: these widths, then a site without pillar.
    fn solve_rows(&self, colour: usize, widths_nm: &[f64], progress: &dyn Progress) -> Result<Vec<Vec<Complex64>>> {
        (0..self.stacks())
            .into_par_iter()
            .map(|stack| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let row = self.solve_row(colour, stack, widths_nm, &Unwatched(progress));
                progress.advance(1);
                row
            })
            .collect()
    }

    /// Read the bank that was kept for these inputs.
    ///
    /// # Errors
    /// If it is not there, damaged, or of something else: it is never solved here.
    pub fn read(path: &Path, stated: &CellStack, range: BankRange) -> Result<Self> {
        let mut bank = Self::empty(stated, range)?;
        let bytes = metalith_core::file::read_at_most(path, LONGEST, "a table of cells")?;
        let unusable = |why: String| {
            Error::invalid(
                format!("the tables of cells in {} cannot be used: {why}", path.display()),
                "plan the study again into another folder; a shard makes no tables of its own",
            )
        };
        let content = kept::open(&bytes, MAGIC, &bank.inputs()).map_err(|e| unusable(e.to_string()))?;
        let numbers: Vec<f64> = content
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
            .collect();
        if numbers.iter().any(|v| !v.is_finite()) {
            return Err(unusable("it holds what is no number".into()));
        }
        let mut rest = numbers.as_slice();
        for _ in 0..bank.range.colours.len() {
            let colour =
                take(&mut rest, bank.stacks() * bank.each()).ok_or_else(|| unusable("numbers are missing".into()))?;
            bank.colours.push(colour);
        }
        Ok(bank)
    }

    /// Keep it in a file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut numbers: Vec<f64> = Vec::new();
        for colour in &self.colours {
            numbers.push(colour.widths_nm.len() as f64);
            numbers.extend(&colour.widths_nm);
            numbers.extend(colour.t.iter().flat_map(|z| [z.re, z.im]));
        }
        let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        kept::write(path, MAGIC, &self.inputs(), &bytes)
    }

    /// Number of stacks that are solved at every wavelength.
    pub fn stacks(&self) -> usize {
        self.axes.iter().map(|a| a.nodes).product()
    }

    /// The pillar that changes are counted from.
    pub fn stated(&self) -> &CellStack {
        &self.stated
    }

    fn empty(stated: &CellStack, range: BankRange) -> Result<Self> {
        let [low, high] = range.widths_nm;
        // A whole number of steps below the narrowest.
        let first = (low / WIDTH_STEP_NM).floor() * WIDTH_STEP_NM - BEYOND as f64 * WIDTH_STEP_NM;
        let nodes = ((high - first) / WIDTH_STEP_NM).ceil() as usize + 1 + BEYOND;
        let [least, most] = range.changes.each_ref().map(quantities);
        let axes: [Axis; QUANTITIES] = std::array::from_fn(|k| Axis::over(least[k], most[k], STACK_STEPS[k]));
        let bank = Self {
            stated: stated.clone(),
            widths: Axis {
                first,
                step: WIDTH_STEP_NM,
                nodes,
            },
            range,
            axes,
            colours: Vec::new(),
        };
        let upright = bank.stated.shape.upright().is_some();
        let pillars = bank.stacks() * bank.widths.nodes * bank.range.numbers.len();
        if upright && pillars > MOST_UPRIGHT {
            return Err(Error::invalid(
                format!("{pillars} upright rectangles would have to be solved for every wavelength"),
                format!(
                    "vary fewer of bias, height, index, taper and mask at once, or less: at most {MOST_UPRIGHT} are solved"
                ),
            ));
        }
        if bank.stacks() > MOST_STACKS {
            return Err(Error::invalid(
                format!(
                    "tables of {} pillars would have to be solved, for every width and wavelength",
                    bank.stacks()
                ),
                format!(
                    "vary fewer of height, index, taper, corners and mask at once, or less: at most {MOST_STACKS} are solved"
                ),
            ));
        }
        Ok(bank)
    }

    /// The change of a stack of the grid.
    fn change(&self, mut stack: usize) -> CellChange {
        change_of(self.axes.each_ref().map(|axis| {
            let k = stack % axis.nodes;
            stack /= axis.nodes;
            axis.node(k)
        }))
    }

    fn solve_row(
        &self,
        colour: usize,
        stack: usize,
        widths_nm: &[f64],
        progress: &dyn Progress,
    ) -> Result<Vec<Complex64>> {
        let (um, orders) = self.range.colours[colour];
        let etched = perturbed(&self.stated, &self.change(stack));
        let Some(pillars) = self.stated.shape.rectangles() else {
            let orders = Orders::new(orders)?;
            let at = |width: f64| {
                let width = possible_width_nm(&etched, width);
                off_cutoff(width, |w| etched.transmission(w, um, orders))
            };
            let widths = widths_nm.iter().map(|w| at(*w));
            return widths.chain([etched.transmission(0.0, um, orders)]).collect();
        };
        let (numbers, orders) = (&self.range.numbers, RowOrders::Given(orders));
        let mut row = Vec::new();
        for bias in widths_nm {
            row.extend(solve_row(&etched, pillars, numbers, *bias, um, orders, progress)?);
        }
        row.extend(bare_row(&etched, pillars, numbers.len(), um)?);
        Ok(row)
    }

    /// Transmissions of pillars of these widths (nm) with a change, along the normal.
    ///
    /// # Errors
    /// If any of it is outside what the bank holds: nothing is solved here.
    pub(super) fn transmissions(
        &self,
        change: &CellChange,
        orders: usize,
        widths_nm: &[f64],
        wavelength_um: f64,
    ) -> Result<SolvedWidths> {
        let (pillars, bare) = self.numbers(change, orders, widths_nm, wavelength_um)?;
        Ok(SolvedWidths {
            pillars: vec![pillars.into_iter().map(|t| t[0]).collect()],
            bare,
            unseen: vec![Complex64::ONE],
            share: 1.0,
            rim: None,
        })
    }

    /// A row of rectangles for each of these biases (nm), and one for a site without; of upright ones for these numbers.
    ///
    /// # Errors
    /// As [`CellBank::transmissions`].
    pub(super) fn rectangles(
        &self,
        change: &CellChange,
        (wavelength_um, orders): (f64, usize),
        biases_nm: &[f64],
        numbers: &[u16],
    ) -> Result<RowsOfBiases> {
        let (mut rows, bare) = self.numbers(change, orders, biases_nm, wavelength_um)?;
        if let Some(pillars) = self.stated.shape.upright() {
            let place = |number: &u16| {
                let place = self.range.numbers.binary_search(number);
                let [x, y] = pillars.edges_nm(*number);
                place.map_err(|_| Self::outside(format!("pillar of {x} x {y} nm")))
            };
            let places: Vec<usize> = numbers.iter().map(place).collect::<Result<_>>()?;
            for row in &mut rows {
                *row = places.iter().flat_map(|k| [row[2 * k], row[2 * k + 1]]).collect();
            }
        }
        Ok((rows, bare))
    }

    fn outside(what: String) -> Error {
        Error::invalid(
            format!("the tables of cells hold no {what}"),
            "plan the study again; a shard makes no tables of its own",
        )
    }

    /// The numbers of pillars of these widths (nm), of rectangles by what their edges are off by, and of a site without pillar.
    fn numbers(
        &self,
        change: &CellChange,
        orders: usize,
        widths_nm: &[f64],
        wavelength_um: f64,
    ) -> Result<(Vec<Vec<Complex64>>, Vec<Complex64>)> {
        let outside = Self::outside;
        let colour = self.range.colours.iter().position(|c| *c == (wavelength_um, orders));
        let colour = colour.ok_or_else(|| outside(format!("wavelength of {} nm", wavelength_um * 1e3)))?;
        let mut stacks = vec![(0, 1.0)];
        let mut stride = 1;
        for (axis, value) in self.axes.iter().zip(quantities(change)) {
            let nodes = axis
                .weights(value)
                .ok_or_else(|| outside(format!("pillar like {change:?}")))?;
            let pairs = stacks
                .iter()
                .flat_map(|(s, w)| nodes.iter().map(move |(k, v)| (s + k * stride, w * v)));
            stacks = pairs.collect();
            stride *= axis.nodes;
        }
        // One row for this pillar; widths are then taken from it.
        let (colour, each) = (&self.colours[colour], self.each());
        let length = (colour.widths_nm.len() + 1) * each;
        let mut row = vec![Complex64::ZERO; length];
        for (stack, weight) in stacks {
            for (sum, t) in row.iter_mut().zip(&colour.t[stack * length..]) {
                *sum += t * weight;
            }
        }
        let at = |width: &f64| -> Result<Vec<Complex64>> {
            let weights = colour
                .weights(*width)
                .ok_or_else(|| outside(format!("width of {width} nm")))?;
            let sum = |number: usize| weights.iter().map(|(k, w)| row[k * each + number] * w).sum();
            Ok((0..each).map(sum).collect())
        };
        let pillars = widths_nm.iter().map(at).collect::<Result<_>>()?;
        Ok((pillars, row[length - each..].to_vec()))
    }

    /// Numbers of each pillar.
    fn each(&self) -> usize {
        let pillars = self.stated.shape.rectangles();
        pillars.map_or(1, |pillars| row_length(pillars, self.range.numbers.len()))
    }

    /// Numbers of a pillar that are judged together: of upright rectangles those of all, because a resonance is of one size among
    /// hundreds, and what it does to the light of an element is what it does to the sum over all.
    fn alike(&self) -> usize {
        match self.stated.shape.rectangles() {
            Some(Rectangles::Upright(_)) => self.each().max(1),
            _ => 1,
        }
    }

    /// What the numbers follow from.
    fn inputs(&self) -> Vec<u8> {
        let known = format!(
            "{} {:?} {:?}",
            kept::solver_of(self.stated.shape),
            self.stated,
            self.range
        );
        known.into_bytes()
    }
}

/// Widths between these where any of the rows, which have `each` numbers a width, is not smooth, rms over each `alike` of them.
fn between(widths_nm: &[f64], rows: &[Vec<Complex64>], each: usize, alike: usize) -> Vec<f64> {
    let last = widths_nm.len() - 1;
    let mut divided = vec![false; last];
    for (row, first) in rows
        .iter()
        .flat_map(|row| (0..each).step_by(alike).map(move |first| (row, first)))
    {
        for k in 2..last - 1 {
            let off = |number: usize| {
                let [a, b, c, d, e] = [k - 2, k - 1, k, k + 1, k + 2].map(|k| row[k * each + number]);
                ((b + d) * (2.0 / 3.0) - (a + e) / 6.0 - c).norm_sqr()
            };
            let mean = (first..first + alike).map(off).sum::<f64>() / alike as f64;
            if mean.sqrt() > ROUGH {
                divided[k.saturating_sub(1 + BESIDE)..(k + 1 + BESIDE).min(last)].fill(true);
            }
        }
    }
    let parts = |k: usize| {
        let (low, high) = (widths_nm[k], widths_nm[k + 1]);
        (1..FINE_PARTS).map(move |p| low + (high - low) * p as f64 / FINE_PARTS as f64)
    };
    (0..last).filter(|k| divided[*k]).flat_map(parts).collect()
}

/// Two sets of widths of one wavelength, each with its rows, as one.
fn merged(
    (coarse, rows): (&[f64], &[Vec<Complex64>]),
    (added, fine): (&[f64], &[Vec<Complex64>]),
    each: usize,
) -> Colour {
    let mut order: Vec<(f64, bool, usize)> = coarse.iter().enumerate().map(|(k, w)| (*w, false, k)).collect();
    order.extend(added.iter().enumerate().map(|(k, w)| (*w, true, k)));
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole = rows.iter().zip(fine).flat_map(|(row, fine)| {
        let widths = order.iter().flat_map(move |(_, is_fine, k)| {
            let from = if *is_fine { fine } else { row };
            from[k * each..][..each].iter().copied()
        });
        widths.chain(row[coarse.len() * each..].iter().copied())
    });
    Colour {
        t: whole.collect(),
        widths_nm: order.iter().map(|o| o.0).collect(),
    }
}

/// One wavelength from the front of the numbers of a file: `rows` for a width.
fn take(rest: &mut &[f64], rows: usize) -> Option<Colour> {
    let (count, after) = rest.split_first()?;
    let count = *count as usize;
    let (widths, after) = after.split_at_checked(count)?;
    let (t, after) = after.split_at_checked(2 * rows.checked_mul(count + 1)?)?;
    *rest = after;
    (count >= 4).then(|| Colour {
        widths_nm: widths.to_vec(),
        t: t.chunks_exact(2).map(|z| Complex64::new(z[0], z[1])).collect(),
    })
}

/// Hears that the user wants to stop, and counts nothing.
struct Unwatched<'a>(&'a dyn Progress);

impl Progress for Unwatched<'_> {
    fn begin(&self, _what: &str, _steps: u64) {}

    fn advance(&self, _steps: u64) {}

    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}

#[cfg(test)]
mod tests;
