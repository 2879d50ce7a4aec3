//! Widths seen from above, and the plain CSV that they come in.

use std::path::Path;

use metalith_core::text::quoted;
use metalith_core::{CsvRow, Error, Result, csv_rows, document};

/// The width of one pillar by scanning electron microscope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SemSite {
    /// Element by its place in the array.
    pub element: [i64; 2],
    /// Place of the pillar from the element's centre (um).
    pub at_um: [f64; 2],
    pub designed_nm: f64,
    pub measured_nm: f64,
    /// Standard deviation of the single measurement (nm).
    pub sigma_nm: f64,
}

/// Head of the table of widths.
pub const COLUMNS: &str = "element_m,element_n,x_um,y_um,designed_nm,measured_nm,sigma_nm";

/// Place of the measured width among the columns.
const MEASURED: usize = 5;

/// Read the widths of a set. Lines whose measured width is empty have not been measured yet, and are left out.
///
/// # Errors
/// If the file cannot be read or a line is not what its columns say.
pub(crate) fn read(path: &Path) -> Result<Vec<SemSite>> {
    let text = document::load(path)?;
    let hint = format!("the columns are `{COLUMNS}`");
    let refuse = |line: Option<usize>, what: String| Error::table(path, line, what, &hint);
    let measured = |row: &Result<CsvRow<'_, Error>>| row.as_ref().map_or(true, |row| !row.field(MEASURED).is_empty());
    csv_rows(&text, COLUMNS, &refuse)?
        .filter(measured)
        .map(|row| {
            let row = row?;
            let [m, n, x, y, designed_nm, measured_nm, sigma_nm] = row.numbers()?;
            if sigma_nm <= 0.0 || measured_nm <= 0.0 || m.fract() != 0.0 || n.fract() != 0.0 {
                return Err(row.refused(format!("`{}` is no width of a pillar", quoted(row.text))));
            }
            Ok(SemSite {
                element: [m as i64, n as i64],
                at_um: [x, y],
                designed_nm,
                measured_nm,
                sigma_nm,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_a_spreadsheet_saved_is_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let line = "0,1,2.5,-3.25,150,148.5,0.8";
        // A mark of byte order, ends of lines of another system, a comment, and a site that nobody has measured yet.
        let text = format!("\u{FEFF}{COLUMNS}\r\n# first day\r\n{line}\r\n0,1,2.5,-3.25,150,,\r\n");
        std::fs::write(file.path(), text).unwrap();
        let site = SemSite {
            element: [0, 1],
            at_um: [2.5, -3.25],
            designed_nm: 150.0,
            measured_nm: 148.5,
            sigma_nm: 0.8,
        };
        assert_eq!(read(file.path()).unwrap(), [site]);
    }
}
