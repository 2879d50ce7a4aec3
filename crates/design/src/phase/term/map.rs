//! Phases from a table over the plane.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::super::Interpolation;
use metalith_core::text::{hex, quoted, table_rows};
use metalith_core::{Error, Result, npy};

/// Entries of a table along an axis at most: sites of the largest lens that is held.
pub(super) const MOST: u64 = 1 << 15;

/// Rounding of distances (um): a map that ends where the lens does covers it.
const ROUNDING_UM: f64 = 1e-6;

/// A distance to the nanometre (um).
fn shown_um(um: f64) -> f64 {
    (um * 1e3).round() / 1e3
}

/// Phase (rad) on a square grid about the middle; between its places straight lines or the nearest entry.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapTable {
    #[serde(skip)]
    file: PathBuf,
    /// Distance of its places (um).
    pitch_um: f64,
    interpolation: Interpolation,
    /// Known up to whole turns: what is between two places is that of the sum of their waves.
    wrapped: bool,
    /// SHA-256 of the values, in hexadecimal.
    digest: String,
    /// Columns, and values in turns, rows along x, the lowest y first.
    #[serde(skip)]
    values: Arc<(usize, Vec<f64>)>,
}

impl MapTable {
    /// A table that is still to be loaded.
    pub fn new(file: PathBuf, pitch_um: f64, interpolation: Interpolation, wrapped: bool) -> Self {
        Self {
            file,
            pitch_um,
            interpolation,
            wrapped,
            digest: String::new(),
            values: Arc::default(),
        }
    }

    /// The file that it is read from.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Distance from its middle to its ends along x and y (um).
    pub(crate) fn extent_um(&self) -> [f64; 2] {
        let (columns, values) = &*self.values;
        let rows = values.len().checked_div(*columns).unwrap_or(0);
        [*columns, rows].map(|n| n as f64 * self.pitch_um / 2.0)
    }

    /// True if its phases are known up to whole turns.
    pub fn is_wrapped(&self) -> bool {
        self.wrapped
    }

    /// Load the table for places up to these distances along x and y (um).
    ///
    /// # Errors
    /// If the file is no NPY array of shape `[ny, nx]`, holds what is no number, or ends before.
    pub(super) fn load(&mut self, reach_um: [f64; 2]) -> Result<()> {
        let fault = |what: String, hint: &str| Error::table(&self.file, None, what, hint);
        let array = read(&self.file)?;
        let columns = array.shape[1] as usize;
        if let Some(at) = array.values.iter().position(|v| !v.is_finite()) {
            return Err(fault(
                format!("entry [{}, {}] is {}", at / columns, at % columns, array.values[at]),
                "every phase must be a finite number, in rad",
            ));
        }
        self.set(columns, &array.values);
        self.covers(reach_um)
    }

    /// The table of values (rad), rows along x, the lowest y first, out of a file.
    pub(super) fn of_values(file: &Path, pitch_um: f64, wrapped: bool, columns: usize, values: &[f64]) -> Self {
        let mut table = Self::new(file.to_owned(), pitch_um, Interpolation::Linear, wrapped);
        table.set(columns, values);
        table
    }

    fn set(&mut self, columns: usize, values: &[f64]) {
        let mut digest = Sha256::new();
        digest.update((columns as u64).to_le_bytes());
        values.iter().for_each(|v| digest.update(v.to_le_bytes()));
        self.digest = hex(&digest.finalize());
        self.values = Arc::new((columns, values.iter().map(|rad| rad / TAU).collect()));
    }

    /// Succeeds if the table covers places up to these distances along x and y (um).
    ///
    /// # Errors
    /// If it ends before.
    pub(super) fn covers(&self, reach_um: [f64; 2]) -> Result<()> {
        let (columns, values) = &*self.values;
        let rows = values.len().checked_div(*columns).unwrap_or(0);
        // Half a place beyond the last is still nearest to it.
        let extent = self.extent_um();
        if (0..2).any(|axis| extent[axis] < reach_um[axis] - ROUNDING_UM) {
            let [(to_x, to_y), (lens_x, lens_y)] = [extent, reach_um].map(|um| (shown_um(um[0]), shown_um(um[1])));
            return Err(Error::Table {
                path: self.file.clone(),
                line: None,
                what: format!(
                    "{columns} by {rows} places of {} um reach to {to_x} and {to_y} um, the lens to {lens_x} and {lens_y} um",
                    self.pitch_um
                ),
                hint: "extend the table, give its pitch in um, or make the lens smaller".into(),
            });
        }
        Ok(())
    }

    /// Phase at a place from the middle of the table (um), in turns; beyond the table, that of its edge.
    pub(super) fn turns(&self, x_um: f64, y_um: f64) -> f64 {
        let (columns, values) = &*self.values;
        if values.is_empty() {
            return 0.0;
        }
        let rows = values.len() / columns;
        let place = |um: f64, n: usize| (um / self.pitch_um + 0.5 * (n - 1) as f64).clamp(0.0, (n - 1) as f64);
        let (x, y) = (place(x_um, *columns), place(y_um, rows));
        let at = |ix: usize, iy: usize| values[iy.min(rows - 1) * columns + ix.min(columns - 1)];
        if self.interpolation == Interpolation::Nearest {
            return at(x.round() as usize, y.round() as usize);
        }
        let (ix, iy) = (x.floor() as usize, y.floor() as usize);
        let (u, v) = (x - ix as f64, y - iy as f64);
        let corners = [
            (at(ix, iy), (1.0 - u) * (1.0 - v)),
            (at(ix + 1, iy), u * (1.0 - v)),
            (at(ix, iy + 1), (1.0 - u) * v),
            (at(ix + 1, iy + 1), u * v),
        ];
        if !self.wrapped {
            return corners.iter().map(|(turns, weight)| turns * weight).sum();
        }
        let wave = |part: fn(f64) -> f64| {
            corners
                .iter()
                .map(|(turns, weight)| part(turns * TAU) * weight)
                .sum::<f64>()
        };
        let (re, im) = (wave(f64::cos), wave(f64::sin));
        im.atan2(re) / TAU
    }
}

/// Longest text of numbers that is read (bytes).
const LONGEST_TEXT: u64 = 1 << 28;

/// An array of two axes: an NPY file, or rows of numbers in a text.
fn read(path: &Path) -> Result<npy::Array> {
    let takes = |shape: &[u64]| shape.len() == 2 && shape.iter().all(|n| (2..=MOST).contains(n));
    let is_text = ["csv", "txt", "tsv", "dat"]
        .iter()
        .any(|text| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(text)));
    if is_text {
        return read_text(path, takes);
    }
    npy::read_phases(path, takes).map_err(|error| match error {
        npy::NpyError::Io(error) => Error::io("read", path)(error),
        other => Error::Table {
            path: path.to_owned(),
            line: None,
            hint: match &other {
                npy::NpyError::Shape { shape, .. } if shape.len() == 1 => {
                    "phases over the radius are `source = \"table\"` with `pitch_um`".into()
                }
                _ => format!("save phases in rad, or complex fields, as an array [ny, nx] of 2 to {MOST} each"),
            },
            what: other.to_string(),
        },
    })
}

/// Rows of numbers, equally many in each, between commas, semicolons, tabs or spaces.
fn read_text(path: &Path, takes: impl FnOnce(&[u64]) -> bool) -> Result<npy::Array> {
    let hint = format!("give phases in rad, 2 to {MOST} rows of as many numbers each, the lowest row first");
    let fault = |line: Option<usize>, what: String| Error::table(path, line, what, &hint);
    let bytes = metalith_core::file::read_at_most(path, LONGEST_TEXT, "a table of phases")?;
    let text = String::from_utf8(bytes).map_err(|_| fault(None, "this is not text".into()))?;
    let (mut values, mut rows, mut columns) = (Vec::new(), 0, 0);
    for (line, row) in table_rows(&text) {
        let fields = row
            .split([',', ';', '\t', ' '])
            .map(str::trim)
            .filter(|f| !f.is_empty());
        let before = values.len();
        for field in fields {
            let number = field.parse::<f64>();
            values.push(number.map_err(|_| fault(Some(line), format!("`{}` is not a number", quoted(field))))?);
        }
        let own = values.len() - before;
        if rows > 0 && own != columns {
            return Err(fault(
                Some(line),
                format!("{own} numbers, and {columns} in the rows before"),
            ));
        }
        (rows, columns) = (rows + 1, own);
    }
    let shape = vec![rows as u64, columns as u64];
    if takes(&shape) {
        Ok(npy::Array {
            shape,
            values,
            whole: false,
        })
    } else {
        Err(fault(None, format!("a table of {rows} rows and {columns} columns")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(interpolation: Interpolation, wrapped: bool) -> MapTable {
        MapTable {
            values: Arc::new((3, vec![0.0, 0.1, 0.2, 0.45, 0.55, 0.65])),
            ..MapTable::new(PathBuf::new(), 2.0, interpolation, wrapped)
        }
    }

    #[test]
    fn rows_rise_with_y_and_columns_with_x() {
        const ROUNDING: f64 = 1e-12;
        let linear = table(Interpolation::Linear, false);
        let nearest = table(Interpolation::Nearest, false);
        for (x, y, want) in [
            (-2.0, -1.0, 0.0),
            (2.0, 1.0, 0.65),
            (0.0, 0.0, 0.325),
            (1.0, -1.0, 0.15),
            (9.0, 9.0, 0.65),
        ] {
            assert!((linear.turns(x, y) - want).abs() < ROUNDING, "{x} {y}");
        }
        assert!((nearest.turns(0.9, -0.9) - 0.1).abs() < ROUNDING);
    }

    #[test]
    fn texts_are_rows_of_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phase.csv");
        let read_it = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read(&path)
        };
        for text in ["1,2,3\n4,5,6\n", "# rows\n1 2  3\n4\t5\t6"] {
            let array = read_it(text).unwrap();
            assert_eq!(
                (array.shape, array.values),
                (vec![2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
            );
        }
        for (text, at) in [("1,2\n3\n", Some(2)), ("1,x\n", Some(1)), ("1,2\n", None), ("", None)] {
            match read_it(text).unwrap_err() {
                Error::Table { line, .. } => assert_eq!(line, at, "{text}"),
                other => panic!("{other}"),
            }
        }
    }

    #[test]
    fn wrapped_phases_are_joined_the_short_way() {
        const ROUNDING: f64 = 1e-9;
        let ends = MapTable {
            values: Arc::new((2, vec![0.95, 0.05, 0.95, 0.05])),
            ..MapTable::new(PathBuf::new(), 2.0, Interpolation::Linear, true)
        };
        let between = ends.turns(0.0, 0.0);
        assert!((between - between.round()).abs() < ROUNDING, "{between}");
        let plain = MapTable { wrapped: false, ..ends };
        assert!((plain.turns(0.0, 0.0) - 0.5).abs() < ROUNDING);
    }
}
