//! Transmissions over width, wavelength and the quantities of a pillar that vary, solved once for many chips.
//!
//! A study judges thousands of chips whose pillars differ a little. To solve the cells of each anew costs more than its
//! light does; a bank solves them on a grid, and chips take from it by cubic interpolation along every axis, or of upright
//! rectangles, which are of many sizes, by rational functions.

mod grid;
mod sizes;
mod widths;

use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;

pub(crate) use self::grid::Axis;
use self::grid::StackGrid;
use self::sizes::{Along, SizeTables, Sizes};
use self::widths::{Colour, between, coarse, merged};
use super::as_built_rectangles::{RowsOfBiases, bare_row, row_length, solve_rotated, solve_upright};
use super::etched_stack::{off_cutoff, perturbed, possible_width_nm};
use super::{CellChange, SolvedWidths};
use metalith_cell::{CellStack, UPRIGHT_ORDERS, cache_file};
use metalith_core::{Error, Progress, Quiet, Result};
use metalith_pillars::RotatedRectangles;
use metalith_rcwa::Orders;

/// Version of the kept file.
const MAGIC: [u8; 8] = *b"MLBANK\0\x02";

/// Longest file that is read.
const LONGEST: u64 = 1 << 32;

/// Stacks that are solved at the most. At some 15 CPU s each that is an hour and a half.
const MOST_STACKS: usize = 400;

/// CPU time that tables of upright rectangles may take (s): an hour and a half.
const MOST_UPRIGHT_S: f64 = 5400.0;

/// CPU time of one of them with [`UPRIGHT_ORDERS`] (s), and the share of it that another height takes, whose modes are known.
const UPRIGHT_S: f64 = 0.1;
const KNOWN_SHARE: f64 = 0.05;

/// Range that a bank covers.
#[derive(Clone, Debug, PartialEq)]
pub struct BankRange {
    /// Narrowest and widest pillar as fabricated (nm); of rectangles the least and the most that both edges are off by.
    pub widths_nm: [f64; 2],
    /// Numbers of the upright rectangles that it holds, rising; empty for other shapes.
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
    grid: StackGrid,
    tables: Tables,
}

/// Tables of each wavelength.
enum Tables {
    /// Over one width.
    Widths(Vec<Colour>),
    /// Tables of upright rectangles of many sizes.
    Sizes(Sizes, Vec<SizeTables>),
}

impl CellBank {
    /// Solve it. `stated`: the pillar that changes are counted from.
    ///
    /// # Errors
    /// If it would be too large, a cell cannot be solved, or the user stopped it.
    pub fn solve(stated: &CellStack, range: BankRange, progress: &dyn Progress) -> Result<Self> {
        let mut bank = Self::empty(stated, range)?;
        let colours = 0..bank.range.colours.len();
        bank.tables = match &bank.tables {
            Tables::Widths(_) => {
                let widths = coarse(bank.range.widths_nm);
                let steps = colours.len() * (bank.grid.count() + 1);
                progress.begin("solving the tables of cells", steps as u64);
                let solved = colours.map(|colour| bank.solve_widths(colour, &widths, progress));
                Tables::Widths(solved.collect::<Result<_>>()?)
            }
            Tables::Sizes(sizes, _) => {
                let solved = colours.map(|colour| bank.solve_sizes(colour, sizes, progress));
                Tables::Sizes(sizes.clone(), solved.collect::<Result<_>>()?)
            }
        };
        Ok(bank)
    }

    fn solve_widths(&self, colour: usize, coarse: &[f64], progress: &dyn Progress) -> Result<Colour> {
        let rows = self.solve_rows(colour, coarse, progress)?;
        let added = between(coarse, &rows, self.each());
        let fine = self.solve_rows(colour, &added, &Quiet(progress))?;
        progress.advance(1);
        Ok(merged((coarse, &rows), (&added, &fine), self.each()))
    }

    /// One row for each stack: these widths, then a site without pillar.
    fn solve_rows(&self, colour: usize, widths_nm: &[f64], progress: &dyn Progress) -> Result<Vec<Vec<Complex64>>> {
        (0..self.grid.count())
            .into_par_iter()
            .map(|stack| {
                progress.check_stopped()?;
                let row = self.solve_row(colour, stack, widths_nm);
                progress.advance(1);
                row
            })
            .collect()
    }

    fn solve_sizes(&self, colour: usize, sizes: &Sizes, progress: &dyn Progress) -> Result<SizeTables> {
        let (um, orders) = self.range.colours[colour];
        let orders = Orders::new(orders)?;
        let etched: Vec<CellStack> = (0..self.grid.count()).map(|stack| self.etched(stack)).collect();
        let solve = |edges: [f64; 2]| -> Result<Vec<Along>> { solve_upright(&etched, edges, um, orders) };
        let what = format!(
            "solving upright rectangles in {} at {:.1} nm, some {:.1} minutes of CPU time",
            counted(etched.len()),
            um * 1e3,
            self.sizes_s(colour, sizes) / 60.0
        );
        progress.begin(&what, sizes.first() as u64);
        sizes.solve(&solve, progress)
    }

    /// Read the bank that was kept for these inputs.
    ///
    /// # Errors
    /// If it is not there, damaged, or of something else: it is never solved here.
    pub fn read(path: &Path, stated: &CellStack, range: BankRange) -> Result<Self> {
        let mut bank = Self::empty(stated, range)?;
        let bytes = metalith_core::file::read_at_most(path, LONGEST, "a table of cells")?;
        let unusable = |why: String| {
            Error::refused(
                "study/tables-unreadable",
                format!("the tables of cells in {} cannot be used: {why}", path.display()),
                "plan the study again into another folder; shards make no tables",
            )
        };
        let content = cache_file::open(&bytes, MAGIC, &bank.inputs()).map_err(|e| unusable(e.to_string()))?;
        let numbers: Vec<f64> = content
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
            .collect();
        if numbers.iter().any(|v| !v.is_finite()) {
            return Err(unusable("it holds what is no number".into()));
        }
        let mut rest = numbers.as_slice();
        let (stacks, each) = (bank.stacks(), bank.each());
        let colours = 0..bank.range.colours.len();
        let is_whole = match &mut bank.tables {
            Tables::Widths(all) => colours
                .map(|_| Colour::take(&mut rest, stacks * each))
                .collect::<Option<_>>()
                .map(|colours| *all = colours),
            Tables::Sizes(sizes, all) => colours
                .map(|_| SizeTables::take(&mut rest, sizes, stacks))
                .collect::<Option<_>>()
                .map(|colours| *all = colours),
        };
        is_whole.ok_or_else(|| unusable("numbers are missing".into()))?;
        Ok(bank)
    }

    /// Keep it in a file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let bytes: Vec<u8> = match &self.tables {
            Tables::Widths(colours) => colours
                .iter()
                .flat_map(Colour::numbers)
                .flat_map(f64::to_le_bytes)
                .collect(),
            Tables::Sizes(_, colours) => colours
                .iter()
                .flat_map(SizeTables::numbers)
                .flat_map(f64::to_le_bytes)
                .collect(),
        };
        cache_file::write(path, MAGIC, &self.inputs(), &bytes)
    }

    /// Number of stacks that are solved at every wavelength.
    pub fn stacks(&self) -> usize {
        self.grid.count()
    }

    /// The pillar that changes are counted from.
    pub fn stated(&self) -> &CellStack {
        &self.stated
    }

    fn empty(stated: &CellStack, range: BankRange) -> Result<Self> {
        let tables = match stated.shape.upright() {
            Some(pillars) => Tables::Sizes(Sizes::new(pillars, &range.numbers, range.widths_nm), Vec::new()),
            None => Tables::Widths(Vec::new()),
        };
        let bank = Self {
            stated: stated.clone(),
            grid: StackGrid::over(&range.changes),
            range,
            tables,
        };
        if bank.stacks() > MOST_STACKS {
            return Err(Error::refused(
                "study/tables-too-many",
                format!(
                    "tables of {} pillars would have to be solved, for every width and wavelength",
                    bank.stacks()
                ),
                format!(
                    "vary fewer of height, index, taper, corners and mask at once, or less: at most {MOST_STACKS} are solved"
                ),
            ));
        }
        if let Tables::Sizes(sizes, _) = &bank.tables {
            let seconds: f64 = (0..bank.range.colours.len())
                .map(|colour| bank.sizes_s(colour, sizes))
                .sum();
            if seconds > MOST_UPRIGHT_S {
                return Err(Error::refused(
                    "study/tables-too-slow",
                    format!(
                        "tables of {} upright rectangles, each in {}, would take {:.1} hours of CPU time",
                        sizes.first(),
                        counted(bank.stacks()),
                        seconds / 3600.0
                    ),
                    "vary fewer of height, index, taper and mask at once, or less; of these, height costs least and taper most",
                ));
            }
        }
        Ok(bank)
    }

    /// CPU time that the sizes take at one wavelength (s), about.
    fn sizes_s(&self, colour: usize, sizes: &Sizes) -> f64 {
        let etched: Vec<CellStack> = (0..self.stacks()).map(|stack| self.etched(stack)).collect();
        sizes.first() as f64 * upright_s(&etched, self.range.colours[colour].1)
    }

    /// A stack of the grid.
    fn etched(&self, stack: usize) -> CellStack {
        perturbed(&self.stated, &self.grid.change(stack))
    }

    fn solve_row(&self, colour: usize, stack: usize, widths_nm: &[f64]) -> Result<Vec<Complex64>> {
        let (um, orders) = self.range.colours[colour];
        let (etched, orders) = (self.etched(stack), Orders::new(orders)?);
        let Some(pillars) = self.rotated() else {
            let at = |width: f64| {
                let width = possible_width_nm(&etched, width);
                off_cutoff(width, |w| etched.transmission(w, um, orders))
            };
            let widths = widths_nm.iter().map(|w| at(*w));
            return widths.chain([etched.transmission(0.0, um, orders)]).collect();
        };
        let mut row = Vec::new();
        for bias in widths_nm {
            row.extend(solve_rotated(&etched, pillars, *bias, um, Some(orders))?);
        }
        row.extend(bare_row(&etched, pillars.into(), 1, um)?);
        Ok(row)
    }

    fn rotated(&self) -> Option<RotatedRectangles> {
        self.stated.shape.rotated()
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
        let (pillars, bare) = self.of_widths(change, (wavelength_um, orders), widths_nm)?;
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
        match &self.tables {
            Tables::Widths(_) => self.of_widths(change, (wavelength_um, orders), biases_nm),
            Tables::Sizes(sizes, tables) => {
                let tables = &tables[self.colour((wavelength_um, orders))?];
                let row = |bias: &f64| self.of_sizes(change, (sizes, tables), numbers, *bias);
                let rows = biases_nm.iter().map(row).collect::<Result<_>>()?;
                let etched = perturbed(&self.stated, change);
                let bare = bare_row(&etched, sizes.pillars().into(), numbers.len(), wavelength_um)?;
                Ok((rows, bare))
            }
        }
    }

    fn outside(what: String) -> Error {
        Error::refused(
            "study/tables-too-narrow",
            format!("the tables of cells hold no {what}"),
            "plan the study again; shards make no tables",
        )
    }

    fn colour(&self, colour: (f64, usize)) -> Result<usize> {
        let place = self.range.colours.iter().position(|c| *c == colour);
        place.ok_or_else(|| Self::outside(format!("wavelength of {} nm", colour.0 * 1e3)))
    }

    fn outside_stack(change: &CellChange) -> Error {
        Self::outside(format!("pillar like {change:?}"))
    }

    /// The row of upright rectangles with these numbers whose edges are off by `bias_nm`.
    fn of_sizes(
        &self,
        change: &CellChange,
        (sizes, tables): (&Sizes, &SizeTables),
        numbers: &[u16],
        bias_nm: f64,
    ) -> Result<Vec<Complex64>> {
        if !self.grid.holds(change) {
            return Err(Self::outside_stack(change));
        }
        let mut row = Vec::with_capacity(2 * numbers.len());
        for number in numbers {
            let along = self.range.numbers.binary_search(number).ok();
            let along = along.and_then(|_| sizes.of_stacks(tables, *number, bias_nm));
            let along = along.ok_or_else(|| Self::outside(sizes.words(*number, bias_nm)))?;
            row.extend(along.map(|of_stacks| self.grid.between(change, of_stacks)));
        }
        Ok(row)
    }

    /// The numbers of pillars of these widths (nm), of rotated rectangles by what their edges are off by, and of a site without pillar.
    fn of_widths(&self, change: &CellChange, colour: (f64, usize), widths_nm: &[f64]) -> Result<RowsOfBiases> {
        let Tables::Widths(colours) = &self.tables else {
            return Err(Self::outside("pillar of one width".into()));
        };
        let (colour, each) = (&colours[self.colour(colour)?], self.each());
        let stacks = self.grid.weights(change).ok_or_else(|| Self::outside_stack(change))?;
        // One row for this pillar; widths are then taken from it.
        let row = colour.row(&stacks, each);
        let at = |width: &f64| -> Result<Vec<Complex64>> {
            let weights = colour
                .weights(*width)
                .ok_or_else(|| Self::outside(format!("width of {width} nm")))?;
            let sum = |number: usize| weights.iter().map(|(k, w)| row[k * each + number] * w).sum();
            Ok((0..each).map(sum).collect())
        };
        let pillars = widths_nm.iter().map(at).collect::<Result<_>>()?;
        Ok((pillars, row[row.len() - each..].to_vec()))
    }

    /// Numbers of each width.
    fn each(&self) -> usize {
        self.rotated().map_or(1, |pillars| row_length(pillars.into(), 1))
    }

    /// Bytes of the inputs that the numbers follow from.
    fn inputs(&self) -> Vec<u8> {
        let known = format!(
            "{} {:?} {:?}",
            cache_file::solver_of(self.stated.shape),
            self.stated,
            self.range
        );
        known.into_bytes()
    }
}

/// Words for so many stacks.
fn counted(stacks: usize) -> String {
    match stacks {
        1 => "one stack".into(),
        _ => format!("{stacks} stacks"),
    }
}

/// CPU time that one upright rectangle takes in all of these stacks (s), about.
fn upright_s(etched: &[CellStack], orders: usize) -> f64 {
    let is_known = |k: usize| {
        let before = k.checked_sub(1).map(|before| CellStack {
            height_nm: etched[k].height_nm,
            ..etched[before].clone()
        });
        etched[k].slices() == 1 && before.as_ref() == Some(&etched[k])
    };
    let sections = (0..etched.len()).map(|k| {
        if is_known(k) {
            KNOWN_SHARE
        } else {
            etched[k].slices() as f64
        }
    });
    // Of a matrix as wide as there are orders over the plane, its cube.
    let share = orders as f64 / UPRIGHT_ORDERS as f64;
    UPRIGHT_S * share.powi(6) * sections.sum::<f64>()
}

#[cfg(test)]
mod tests;
