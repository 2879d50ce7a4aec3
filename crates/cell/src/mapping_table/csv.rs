//! A mapping as CSV.

use std::fs;
use std::path::Path;

use super::MappingTable;
use metalith_core::text::{quoted, table_rows};
use metalith_core::{Error, Result};

/// Longest mapping that is read (bytes), and the rounding of its phases in print.
const LONGEST_CSV: u64 = 4 << 20;
const PRINTED_TURNS: f64 = 1e-6;

impl MappingTable {
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
        let mut rows = table_rows(&text);
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
                let not_a_part = || fault(Some(line), format!("\"{}\" is not a phase and a width", quoted(row)));
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
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mapping as spreadsheets save it.
    #[test]
    fn a_mark_of_the_byte_order_is_no_part_of_a_mapping() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mapping.csv");
        fs::write(&path, "\u{feff}turns,width_nm\r\n0.25,100\r\n0.75,200\r\n").unwrap();
        let read = MappingTable::read_csv(&path, &[100, 200]).unwrap();
        assert_eq!(read.widths_nm, [100, 200]);
    }
}
