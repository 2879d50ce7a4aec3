//! A mapping as CSV.

use std::path::Path;

use super::MappingTable;
use metalith_core::file::read_at_most;
use metalith_core::{CsvRow, Error, Result, csv_rows};

/// Longest mapping that is read (bytes), and the rounding of its phases in print.
const LONGEST_CSV: u64 = 4 << 20;
const PRINTED_TURNS: f64 = 1e-6;

const HEAD: &str = "turns,width_nm";

impl MappingTable {
    /// The table as text: the phase in the middle of each part (turns) and its width.
    pub fn to_csv(&self) -> String {
        let n = self.widths_nm.len() as f64;
        let mut text = format!("{HEAD}\n");
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
        let hint =
            "give columns turns and width_nm: equal parts of a turn by their middles, widths that may be written";
        let refuse = |line: Option<usize>, what: String| Error::table(path, line, what, hint);
        let bytes = read_at_most(path, LONGEST_CSV, "a mapping")?;
        let text = String::from_utf8_lossy(&bytes);
        let rows = csv_rows(&text, HEAD, &refuse)?.collect::<Result<Vec<_>>>()?;
        if rows.len() < 2 {
            return Err(refuse(None, "fewer than two parts of a turn".into()));
        }
        let n = rows.len() as f64;
        let width = |(i, row): (usize, &CsvRow<'_, Error>)| {
            let [turns, width] = row.numbers()?;
            let middle = (i as f64 + 0.5) / n;
            let near = (turns - middle).abs() < 0.01 / n + PRINTED_TURNS;
            if !near {
                return Err(row.refused(format!("{turns} turns stand where {middle:.6} should")));
            }
            let found = allowed.iter().find(|own| f64::from(**own) == width);
            found
                .copied()
                .ok_or_else(|| row.refused(format!("a width of {width} nm may not be written")))
        };
        let widths_nm = rows.iter().enumerate().map(width).collect::<Result<_>>()?;
        Ok(Self { widths_nm })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mapping as spreadsheets save it.
    #[test]
    fn a_mark_of_the_byte_order_is_no_part_of_a_mapping() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mapping.csv");
        std::fs::write(&path, "\u{feff}turns,width_nm\r\n0.25,100\r\n0.75,200\r\n").unwrap();
        let read = MappingTable::read_csv(&path, &[100, 200]).unwrap();
        assert_eq!(read.widths_nm, [100, 200]);
    }
}
