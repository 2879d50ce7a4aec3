//! Widths seen from above, and the plain CSV that they come in.

use std::path::Path;

use metalith_core::text::{quoted, table_rows};
use metalith_core::{Error, Result, document};

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
    let fault = |line: usize, what: String| Error::Table {
        path: path.to_owned(),
        line: Some(line),
        what,
        hint: format!("the columns are `{COLUMNS}`"),
    };
    rows(&text, COLUMNS)
        .map_err(|(at, what)| fault(at, what))?
        .into_iter()
        .filter(|(_, line)| {
            line.split(',')
                .nth(MEASURED)
                .is_none_or(|field| !field.trim().is_empty())
        })
        .map(|(at, line)| {
            let wrong = || fault(at, format!("`{}` is no width of a pillar", quoted(line)));
            let [m, n, x, y, designed, measured, sigma] = numbers(line).ok_or_else(wrong)?;
            if sigma <= 0.0 || measured <= 0.0 || m.fract() != 0.0 || n.fract() != 0.0 {
                return Err(wrong());
            }
            Ok(SemSite {
                element: [m as i64, n as i64],
                at_um: [x, y],
                designed_nm: designed,
                measured_nm: measured,
                sigma_nm: sigma,
            })
        })
        .collect()
}

/// Lines of a CSV file behind its header, with their numbers.
fn rows<'t>(text: &'t str, columns: &str) -> Result<Vec<(usize, &'t str)>, (usize, String)> {
    let mut lines = table_rows(text);
    match lines.next() {
        None => Err((1, "the file is empty".into())),
        Some((at, head)) if head.split(',').map(str::trim).ne(columns.split(',')) => {
            Err((at, format!("the columns are `{}`", quoted(head))))
        }
        Some(_) => Ok(lines.collect()),
    }
}

/// Exactly `N` finite numbers.
fn numbers<const N: usize>(line: &str) -> Option<[f64; N]> {
    let fields: Vec<f64> = line
        .split(',')
        .map(|f| f.trim().parse::<f64>().ok().filter(|v| v.is_finite()))
        .collect::<Option<_>>()?;
    fields.try_into().ok()
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
