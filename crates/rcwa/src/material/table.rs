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
        physical(sample).map_err(|fault| (number, fault))?;
        if samples.last().is_some_and(|last| last[0] >= sample[0]) {
            return Err((number, TableError::NotRising));
        }
        samples.push(sample);
    }
    if samples.len() < 2 {
        return Err((None, TableError::TooFewRows));
    }
    no_permittivity(&samples)?;
    Ok(samples)
}

/// Check a sample: L (um), n, k.
pub(super) fn physical([um, n, k]: [f64; 3]) -> Result<(), TableError> {
    let what = if um <= 0.0 {
        format!("a wavelength of {um} um")
    } else if n <= 0.0 {
        format!("n = {n} is not positive. If the numbers are of a permittivity, give n + i k, its square root")
    } else if k < 0.0 {
        format!(
            "k = {k} is negative. Materials that absorb have k > 0 here, for the time factor exp(-i w t): change its sign"
        )
    } else {
        return Ok(());
    };
    Err(TableError::NotPhysical { what })
}

/// Refuse samples that all are what no material has and permittivities of semiconductors are.
pub(super) fn no_permittivity(samples: &[[f64; 3]]) -> Result<(), TableFault> {
    /// Greatest index of materials that light passes: 5.9, of lead telluride; with a margin.
    const MOST_CLEAR: f64 = 7.0;
    /// Share of n above which k makes a material dark within a wavelength.
    const DARK: f64 = 0.1;
    match samples.first() {
        Some([um, n, _]) if samples.iter().all(|[_, n, k]| *n > MOST_CLEAR && *k < DARK * n) => Err((
            None,
            TableError::NotPhysical {
                what: format!(
                    "n is above {MOST_CLEAR} everywhere with little loss, {n} at {um} um, which no material has. If the numbers \
                     are of a permittivity, give n + i k, its square root: n = {:.3}",
                    n.sqrt()
                ),
            },
        )),
        _ => Ok(()),
    }
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

    /// Signs of other conventions, and permittivities.
    #[test]
    fn messages_say_how_to_mend_what_is_not_physical() {
        let said = |rows: &str| match parse(&format!("wavelength_um,n,k\n{rows}\n")) {
            Err((line, TableError::NotPhysical { what })) => (line, what),
            other => panic!("{rows}: {other:?}"),
        };
        let (line, what) = said("0.5,2,0\n0.6,2,-0.1");
        assert_eq!(line, Some(3));
        insta::assert_snapshot!(
            what,
            @"k = -0.1 is negative. Materials that absorb have k > 0 here, for the time factor exp(-i w t): change its sign"
        );
        assert!(said("0.5,-11.7,1.2\n0.6,-16,1.1").1.contains("square root"));
        assert!(said("-0.5,2,0\n0.6,2,0").1.contains("wavelength"));
        let (_, what) = said("1.5,12.11,0\n1.6,12.09,0.02");
        assert!(what.contains("n = 3.480"), "{what}");
        // A resonance of a crystal, and a metal in the infrared.
        for rows in ["12.0,2.5,0.1\n12.9,9.2,0.5", "10,12.6,54\n11,15.2,59"] {
            assert!(parse(&format!("wavelength_um,n,k\n{rows}\n")).is_ok(), "{rows}");
        }
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
