//! Rows of a table of widths.

use std::path::Path;

use metalith_core::document::{Section, load};
use metalith_core::text::quoted;
use metalith_core::{CsvRow, csv_columns, csv_rows};

use crate::number_rows::{is_missing, with_commas};

/// Most faults of one table that are listed.
const MOST_LISTED: usize = 40;

/// Most rows of a table.
const MOST_ROWS: usize = 200_000;

/// A CSV table whose columns are found by name, with its faults.
pub(super) struct Table {
    pub(super) names: Vec<String>,
    /// Fields of each row, with the line that it stands in.
    pub(super) rows: Vec<(usize, Vec<String>)>,
    file: String,
}

impl Table {
    /// Read a table; nothing, with the fault at a key, if it cannot be read.
    pub(super) fn read(path: &Path, s: &Section<'_, '_>, key: &str) -> Option<Self> {
        let file = path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into());
        let hint = "give a CSV table whose first line names the columns";
        let text = match load(path) {
            Ok(text) => with_commas(&text),
            Err(error) => {
                s.fault(key, error.to_string(), hint);
                return None;
            }
        };
        let refuse = |line: Option<usize>, what: String| match line {
            Some(line) => format!("{file}, line {line}: {what}"),
            None => format!("{file}: {what}"),
        };
        let names = csv_columns(&text);
        let columns = names.join(",");
        let fields = |row: CsvRow<'_, String>| {
            let fields = (0..names.len()).map(|k| row.field(k).to_owned());
            (row.line, fields.collect())
        };
        let (mut rows, mut faults) = (Vec::new(), Vec::new());
        match csv_rows(&text, &columns, &refuse) {
            Ok(found) => {
                for row in found {
                    match row.map(fields) {
                        Ok(row) if rows.len() < MOST_ROWS => rows.push(row),
                        Ok(_) => {
                            faults.push(format!("{file} has more than {MOST_ROWS} rows"));
                            break;
                        }
                        Err(what) => faults.push(what),
                    }
                }
            }
            Err(what) => faults.push(what),
        }
        let table = Self {
            names: names.iter().map(|n| (*n).to_owned()).collect(),
            rows,
            file,
        };
        let sound = faults.is_empty();
        report(faults, s, key, "give each row as many fields as the first line names");
        sound.then_some(table)
    }

    /// A table with the columns that a set must have and no rows: it lets the sections be read without a file.
    pub(super) fn without_rows() -> Self {
        Self {
            names: ["drawn_nm", "measured_nm"].map(str::to_owned).to_vec(),
            rows: Vec::new(),
            file: String::new(),
        }
    }

    /// Place of a column.
    pub(super) fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// File and line of a row.
    pub(super) fn at_line(&self, row: usize) -> String {
        format!("{}, line {}", self.file, self.rows[row].0)
    }

    /// Field of a row; empty where a word stands for a missing value.
    pub(super) fn field(&self, row: usize, column: usize) -> &str {
        let field = self.rows[row].1[column].as_str();
        if is_missing(field) { "" } else { field }
    }

    /// Numbers of a column, of the rows that have one.
    pub(super) fn numbers(&self, column: usize) -> Vec<f64> {
        let fields = (0..self.rows.len()).map(|row| self.field(row, column));
        fields.filter_map(|f| f.parse().ok()).collect()
    }

    /// Finite number within a range in a row and column, or what is wrong with it.
    pub(super) fn number(&self, row: usize, column: usize, range: [f64; 2]) -> Result<f64, String> {
        let (field, name) = (&self.rows[row].1[column], quoted(&self.names[column]));
        let wrong = |what: &str| format!("{}, column `{name}`: `{}` {what}", self.at_line(row), quoted(field));
        let value: f64 = field.parse().map_err(|_| wrong("is no number"))?;
        let [low, high] = range;
        if (low..=high).contains(&value) {
            Ok(value)
        } else {
            Err(wrong(&format!("is not from {low} to {high}")))
        }
    }
}

/// Record faults of a table at a key, the first of many.
pub(super) fn report(faults: Vec<String>, s: &Section<'_, '_>, key: &str, hint: &str) {
    let more = faults.len().saturating_sub(MOST_LISTED);
    for what in faults.into_iter().take(MOST_LISTED) {
        s.fault(key, what, hint);
    }
    if more > 0 {
        s.fault(key, format!("{more} more rows have faults"), hint);
    }
}
