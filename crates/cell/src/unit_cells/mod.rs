//! Tables of unit cells that other programs wrote: complex transmission over width, and over height and wavelength.

mod arrays;
mod hdf5;
mod slice;
#[cfg(test)]
mod tests;
mod text;

use std::path::{Path, PathBuf};

use num_complex::Complex64;
use serde::Serialize;

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result};

pub use slice::{TabulatedCells, TabulatedPhase};

/// Longest table that is read (bytes).
const LONGEST: u64 = 64 << 20;

/// Most unit cells of a table: a simulation of each takes a second or more.
const MOST_CELLS: usize = 1 << 20;

/// Difference between equal lengths, as a share of them: programs write six digits or more.
const ROUNDING: f64 = 1e-6;

/// Most of the amplitude that a cell may transmit, with room for the rounding of a solver.
const MOST_AMPLITUDE: f64 = 1.03;

/// Sign of time in the fields of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum PhaseConvention {
    /// A wider pillar has more phase: physics, optics, Lumerical, Tidy3D and this program.
    #[serde(rename = "exp(-iwt)")]
    Minus,
    /// A wider pillar has less phase: electrical engineering, COMSOL and CST.
    #[serde(rename = "exp(+iwt)")]
    Plus,
}

impl PhaseConvention {
    /// The words of design files.
    pub const CHOICES: [(&'static str, Self); 2] = [("exp(-iwt)", Self::Minus), ("exp(+iwt)", Self::Plus)];

    /// The word of design files.
    pub fn name(self) -> &'static str {
        Self::CHOICES[usize::from(self == Self::Plus)].0
    }
}

/// Axes of a table, in the order of their numbers.
const AXES: [&str; 3] = ["width", "height", "wavelength"];

/// Complex transmission of unit cells over a grid of widths, heights and wavelengths.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitCellTable {
    path: PathBuf,
    /// Samples (nm), rising, of width, height and wavelength; empty where the table has no such axis.
    axes_nm: [Vec<f64>; 3],
    /// Transmission, wavelength by wavelength for each height of each width; its phase is counted from the narrowest width.
    t: Vec<Complex64>,
    /// Meaning of the columns that were read, in words.
    columns: String,
}

/// Unit cell of a table: width, height and wavelength (nm; none where no column gives them), its transmission and its line.
struct Row {
    at_nm: [Option<f64>; 3],
    t: Complex64,
    line: Option<usize>,
}

impl UnitCellTable {
    /// The table in a file, recognised by its contents; none if the file is a mapping with the columns `turns,width_nm`.
    ///
    /// # Errors
    /// If the file cannot be read or is no such table.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        Self::of_bytes(path, &read_at_most(path, LONGEST, "a table of unit cells")?)
    }

    fn of_bytes(path: &Path, bytes: &[u8]) -> Result<Option<Self>> {
        if let Some(table) = arrays::read(path, bytes) {
            return table.map(Some);
        }
        let text = String::from_utf8_lossy(bytes);
        if metalith_core::text::table_rows(&text)
            .next()
            .is_some_and(|(_, row)| row.starts_with("turns,"))
        {
            return Ok(None);
        }
        text::read(path, &text).map(Some)
    }

    /// The table of rows in any order, which must fill a grid.
    fn of_rows(path: &Path, rows: &[Row], columns: String) -> Result<Self> {
        let fault = |line: Option<usize>, what: String, hint: &str| Error::Table {
            path: path.to_owned(),
            line,
            what,
            hint: hint.into(),
        };
        let axes_nm: [Vec<f64>; 3] = std::array::from_fn(|axis| {
            let mut values: Vec<f64> = rows.iter().filter_map(|row| row.at_nm[axis]).collect();
            values.sort_by(f64::total_cmp);
            values.dedup_by(|b, a| same(*a, *b));
            values
        });
        let counts = axes_nm.each_ref().map(|axis| axis.len().max(1));
        let names = || {
            let each = AXES.iter().zip(&axes_nm).filter(|(_, values)| !values.is_empty());
            let words: Vec<_> = each
                .map(|(name, values)| format!("{} of {name}", values.len()))
                .collect();
            words.join(" x ")
        };
        let whole = counts.iter().try_fold(1_usize, |all, count| all.checked_mul(*count));
        if whole.is_none_or(|whole| whole > rows.len()) {
            let what = format!("{} rows, and {} values make a larger grid", rows.len(), names());
            let hint = "give each width at each height and each wavelength, or one height and one wavelength alone";
            return Err(fault(None, what, hint));
        }
        let mut t = vec![None; counts.iter().product()];
        for row in rows {
            let place = (0..3).fold(0, |place, axis| {
                let values = &axes_nm[axis];
                let index = row.at_nm[axis].map_or(0, |at| nearest(values, at));
                place * counts[axis] + index
            });
            if t[place].replace(row.t).is_some() {
                let what = "this width, height and wavelength stand here twice".to_owned();
                let hint = "leave one angle, polarisation and order in the table: the transmitted zeroth order at normal incidence";
                return Err(fault(row.line, what, hint));
            }
            if row.t.norm() > MOST_AMPLITUDE {
                let what = format!("an amplitude of {:.4}: more power than arrives", row.t.norm());
                let hint = "give the amplitude as the root of the transmitted share of the power: of fields in two media, times \
                            sqrt(n of the side of exit / n of the side of entry)";
                return Err(fault(row.line, what, hint));
            }
        }
        let mut t: Vec<Complex64> = t.into_iter().map(|t| t.expect("as many places as rows")).collect();
        // A phase that all widths share is none of a lens, and varies fastest with height and wavelength.
        let slice = counts[1] * counts[2];
        let piston: Vec<Complex64> = t[..slice].iter().map(|t| Complex64::cis(-t.arg())).collect();
        for (t, piston) in t.iter_mut().zip(piston.iter().cycle()) {
            *t *= piston;
        }
        Ok(Self {
            path: path.to_owned(),
            axes_nm,
            t,
            columns,
        })
    }
}

/// True if two lengths are equal but for how they were written.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// Place of the value nearest to one, of values that rise.
fn nearest(values: &[f64], at: f64) -> usize {
    let after = values.partition_point(|v| *v < at).min(values.len() - 1);
    if after > 0 && at - values[after - 1] < values[after] - at {
        after - 1
    } else {
        after
    }
}
