//! Tables of the index by wavelength, from CSV.

use crate::TableError;
use metalith_core::{csv_columns, csv_rows};

/// Line, counted from one, and what is wrong there.
pub(super) type TableFault = (Option<usize>, TableError);

/// Samples (L (um), n, k) of the text of a table, wavelengths rising.
pub(super) fn parse(text: &str) -> Result<Vec<[f64; 3]>, TableFault> {
    let names = csv_columns(text);
    let (wavelength, unit) = if names.contains(&"wavelength_um") && !names.contains(&"wavelength_nm") {
        ("wavelength_um", 1.0)
    } else {
        ("wavelength_nm", 1e-3)
    };
    let absorbs = names.contains(&"k");
    let columns = format!("{wavelength},n{}", if absorbs { ",k" } else { "" });
    let refuse = |line: Option<usize>, what: String| (line, TableError::NotTheColumns { what });
    let mut samples: Vec<[f64; 3]> = Vec::new();
    for row in csv_rows(text, &columns, &refuse)? {
        let row = row?;
        let number = Some(row.line);
        let mut sample = [0.0; 3];
        if absorbs {
            sample = row.numbers()?;
        } else {
            sample[..2].copy_from_slice(&row.numbers::<2>()?);
        }
        sample[0] *= unit;
        if sample[0] <= 0.0 || sample[1] <= 0.0 || sample[2] < 0.0 {
            return Err((number, TableError::NotPhysical));
        }
        if samples.last().is_some_and(|last| last[0] >= sample[0]) {
            return Err((number, TableError::NotRising));
        }
        samples.push(sample);
    }
    if samples.len() < 2 {
        return Err((None, TableError::TooFewRows));
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Another name for k, a second column of wavelengths or of n, and one without a name.
    #[test]
    fn columns_that_nobody_reads_are_faults() {
        for (header, name) in [
            ("wavelength_nm,n,K", "K"),
            ("wavelength_nm,wavelength_um,n", "wavelength_um"),
            ("wavelength_nm,n,n", "n"),
            ("wavelength_nm,n,", ""),
        ] {
            let found = parse(&format!("# film\n{header}\n400,2,0.1\n410,2.1,0.1\n"));
            match found {
                Err((Some(2), TableError::NotTheColumns { what })) => {
                    assert!(what.contains(&format!("`{name}`")), "{what}");
                }
                other => panic!("{header}: {other:?}"),
            }
        }
        assert_eq!(
            parse("k,n,wavelength_um\n0.1,2,0.4\n0.2,2.1,0.5\n").unwrap()[1],
            [0.5, 2.1, 0.2]
        );
    }

    /// Table as spreadsheets save it.
    #[test]
    fn a_mark_of_the_byte_order_is_no_part_of_a_table() {
        let plain = "wavelength_nm,n\r\n400,2\r\n410,2.1\r\n";
        let samples = parse(plain).unwrap();
        assert_eq!(parse(&format!("\u{feff}{plain}")).unwrap(), samples);
        assert_eq!(parse(&format!("\u{feff}# film\r\n{plain}")).unwrap(), samples);
    }
}
