//! Tables of the index by wavelength, from CSV.

use crate::TableError;
use metalith_core::text::{quoted, table_rows};

/// Line, counted from one, and what is wrong there.
type TableFault = (Option<usize>, TableError);

/// Samples (L (um), n, k) of the text of a table, wavelengths rising.
pub(super) fn parse(text: &str) -> Result<Vec<[f64; 3]>, TableFault> {
    let mut lines = table_rows(text);
    let (number, header) = lines.next().ok_or((None, TableError::Empty))?;
    let names: Vec<_> = header.split(',').map(str::trim).collect();
    let column = |name: &str| names.iter().position(|n| *n == name);
    let (wavelength, unit) = match (column("wavelength_nm"), column("wavelength_um")) {
        (Some(at), _) => (at, 1e-3),
        (None, Some(at)) => (at, 1.0),
        (None, None) => {
            let header = quoted(header);
            return Err((Some(number), TableError::NoWavelengths { header }));
        }
    };
    let n = column("n").ok_or_else(|| {
        let header = quoted(header);
        (Some(number), TableError::NoIndex { header })
    })?;
    let k = column("k");
    // A column that nobody reads may be what is missing: K is no k.
    let known = [Some(wavelength), Some(n), k];
    if let Some(at) = (0..names.len()).find(|at| !known.contains(&Some(*at))) {
        let name = quoted(names[at]);
        return Err((Some(number), TableError::UnknownColumn { name }));
    }
    let mut samples: Vec<[f64; 3]> = Vec::new();
    for (number, line) in lines {
        let cells: Vec<_> = line.split(',').map(str::trim).collect();
        let value = |at: usize| -> Result<f64, TableFault> {
            let text = cells.get(at).ok_or((Some(number), TableError::Missing))?;
            let value: f64 = text
                .parse()
                .map_err(|_| (Some(number), TableError::NotANumber { text: quoted(text) }))?;
            if value.is_finite() {
                Ok(value)
            } else {
                Err((Some(number), TableError::NotFinite { text: quoted(text) }))
            }
        };
        let sample = [value(wavelength)? * unit, value(n)?, k.map_or(Ok(0.0), value)?];
        if sample[0] <= 0.0 || sample[1] <= 0.0 || sample[2] < 0.0 {
            return Err((Some(number), TableError::NotPhysical));
        }
        if samples.last().is_some_and(|last| last[0] >= sample[0]) {
            return Err((Some(number), TableError::NotRising));
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
            let name = name.to_owned();
            assert_eq!(found, Err((Some(2), TableError::UnknownColumn { name })), "{header}");
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
