//! Files of the refractiveindex.info database, as they are: YAML with tables and dispersion formulas 1 to 9.

use super::dispersion::{Dispersion, IndexOver};
use super::table::{TableFault, no_permittivity, physical};
use crate::TableError;
use metalith_core::text::quoted;

/// One entry of the list `DATA`.
#[derive(Default)]
struct Entry<'t> {
    /// Line of its beginning.
    line: usize,
    kind: &'t str,
    range: Option<(usize, &'t str)>,
    coefficients: Option<(usize, &'t str)>,
    rows: Vec<(usize, &'t str)>,
}

/// Coefficients of each formula that have a place of their own: those that a file leaves out at the end are zero.
const PLACED: [usize; 9] = [1, 1, 1, 9, 1, 1, 6, 4, 6];

fn fault(line: usize, what: impl Into<String>) -> TableFault {
    (Some(line), TableError::NotOfDatabase { what: what.into() })
}

/// The index that the text of a file gives.
pub(super) fn parse(text: &str) -> Result<Dispersion, TableFault> {
    let entries = entries(text);
    let (mut n, mut k, mut both) = (None, None, None);
    for entry in &entries {
        let place = match entry.kind {
            "tabulated nk" => {
                both.get_or_insert(table::<3>(entry)?);
                continue;
            }
            "tabulated k" => {
                k.get_or_insert(
                    table::<2>(entry)?
                        .into_iter()
                        .map(|[l, k]| [l, k, 0.0])
                        .collect::<Vec<_>>(),
                );
                continue;
            }
            "tabulated n" => IndexOver::Samples(table::<2>(entry)?.into_iter().map(|[l, n]| [l, n, 0.0]).collect()),
            "tabulated n2" => continue,
            kind => formula(entry, kind)?,
        };
        n.get_or_insert(place);
    }
    match (both, n) {
        (Some(samples), None) => {
            no_permittivity(&samples)?;
            Ok(Dispersion::Table { samples })
        }
        (Some(samples), Some(n)) => Ok(Dispersion::Parts {
            n,
            k: Some(samples.into_iter().map(|[l, _, k]| [l, k, 0.0]).collect()),
        }),
        (None, Some(n)) => Ok(Dispersion::Parts { n, k }),
        (None, None) => Err((
            None,
            TableError::NotOfDatabase {
                what: "no entry of `DATA` that gives n".into(),
            },
        )),
    }
    .and_then(|form| match form.range_um() {
        (low, high) if low < high => Ok(form),
        _ => Err((
            None,
            TableError::NotOfDatabase {
                what: "n and k are known of no wavelengths together".into(),
            },
        )),
    })
}

/// The entries of `DATA`: each begins with `- type:`, and its rows are the lines of numbers after `data: |`.
fn entries(text: &str) -> Vec<Entry<'_>> {
    let mut found: Vec<Entry<'_>> = Vec::new();
    let mut within = false;
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let (number, bare) = (number + 1, line.trim());
        if bare.is_empty() || bare.starts_with('#') {
            continue;
        }
        if !line.starts_with([' ', '\t', '-']) {
            within = bare == "DATA:";
            continue;
        }
        if !within {
            continue;
        }
        let (begins, key) = match bare.strip_prefix('-') {
            Some(rest) => (true, rest.trim()),
            None => (false, bare),
        };
        let value = |name: &str| {
            key.strip_prefix(name)
                .map(|value| value.trim().trim_matches(['"', '\'']))
        };
        if let Some(kind) = value("type:") {
            found.push(Entry {
                line: number,
                kind,
                ..Entry::default()
            });
            continue;
        }
        // Rows of numbers, and what stands among them and is none: `nan`, a negative wavelength.
        let is_row = !key.contains(':') && !bare.ends_with('|');
        let Some(entry) = found.last_mut().filter(|_| !begins || is_row) else {
            continue;
        };
        if let Some(range) = value("wavelength_range:").or_else(|| value("range:")) {
            entry.range = Some((number, range));
        } else if let Some(coefficients) = value("coefficients:") {
            entry.coefficients = Some((number, coefficients));
        } else if is_row && entry.kind.starts_with("tabulated") {
            entry.rows.push((number, bare));
        }
    }
    found
}

/// Numbers of a line, between blanks or commas.
fn numbers((line, text): (usize, &str)) -> Result<Vec<f64>, TableFault> {
    let words = text
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|w| !w.is_empty());
    words
        .map(|word| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err((Some(line), TableError::NotANumber { text: quoted(word) })),
        })
        .collect()
}

fn table<const N: usize>(entry: &Entry<'_>) -> Result<Vec<[f64; N]>, TableFault> {
    let mut rows: Vec<[f64; N]> = Vec::new();
    for &row in &entry.rows {
        let values = numbers(row)?;
        let values: [f64; N] = values
            .get(..N)
            .and_then(|v| v.try_into().ok())
            .ok_or((Some(row.0), TableError::Missing))?;
        let sample = match (entry.kind, &values[..]) {
            ("tabulated k", [um, k, ..]) => [*um, 1.0, *k],
            (_, [um, n]) => [*um, *n, 0.0],
            (_, all) => [all[0], all[1], all[2]],
        };
        physical(sample).map_err(|fault| (Some(row.0), fault))?;
        match rows.last() {
            Some(last) if last[0] > values[0] => return Err((Some(row.0), TableError::NotRising)),
            // The database has a few wavelengths twice: the first counts.
            Some(last) if last[0] == values[0] => {}
            _ => rows.push(values),
        }
    }
    match rows.len() {
        0 | 1 => Err((Some(entry.line), TableError::TooFewRows)),
        _ => Ok(rows),
    }
}

fn formula(entry: &Entry<'_>, kind: &str) -> Result<IndexOver, TableFault> {
    let number = kind.strip_prefix("formula").and_then(|n| n.trim().parse::<u8>().ok());
    let Some(number) = number.filter(|n| (1..=9).contains(n)) else {
        return Err(fault(
            entry.line,
            format!("nothing is known of the type \"{}\"", quoted(kind)),
        ));
    };
    let missing = |key: &str| fault(entry.line, format!("no `{key}` of the formula"));
    let mut coefficients = numbers(entry.coefficients.ok_or_else(|| missing("coefficients"))?)?;
    if coefficients.is_empty() {
        return Err(missing("coefficients"));
    }
    let placed = PLACED[usize::from(number) - 1];
    coefficients.resize(placed.max(coefficients.len()), 0.0);
    let range = entry.range.ok_or_else(|| missing("wavelength_range"))?;
    let range_um = match numbers(range)?[..] {
        [low, high] if 0.0 < low && low < high => (low, high),
        _ => return Err(fault(range.0, "a range of wavelengths that is not two rising numbers")),
    };
    Ok(IndexOver::Formula {
        number,
        coefficients,
        range_um,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One formula of each kind, against a value by hand.
    #[test]
    fn formulas_are_those_of_the_database() {
        for (number, coefficients, um, n) in [
            // Malitson's fused silica and the same by squares.
            (
                1,
                "0 0.6961663 0.0684043 0.4079426 0.1162414 0.8974794 9.896161",
                0.587_562,
                1.458_464,
            ),
            (
                2,
                "0 0.6961663 0.00467914825849 0.4079426 0.01351206307396 0.8974794 97.93400253792099",
                0.587_562,
                1.458_464,
            ),
            (3, "2.25 0.01 -2", 0.5, 2.29_f64.sqrt()),
            (4, "2 1 2 0.01 1 0 0 0 1", 0.5, (2.0 + 0.25 / 0.24_f64).sqrt()),
            // TiO2 (Devore 1951, ordinary): 5.913 + 0.2441 / (um^2 - 0.0803), the rest of the coefficients left out.
            (4, "5.913 0.2441 0 0.0803 1", 0.5, (5.913 + 0.2441 / 0.1697_f64).sqrt()),
            (5, "1.5 0.01 -2", 0.5, 1.54),
            (6, "0 0.05792105 238.0185 0.00167917 57.362", 0.5876, 1.000_276_89),
            (
                7,
                "2 0.1 0.01 0.001 0.0001 0",
                1.0,
                2.0 + 0.1 / 0.972 + 0.01 / 0.972 / 0.972 + 0.0011,
            ),
            (8, "0.3 0.01 0.02 0.001", 0.5, 1.534_565_79),
            (
                9,
                "2.25 0.01 0.02 0.01 1 1",
                0.5,
                (2.25 + 0.01 / 0.23 - 0.005 / 1.25_f64).sqrt(),
            ),
        ] {
            let text = format!(
                "DATA:\n  - type: formula {number}\n    wavelength_range: 0.2 3\n    coefficients: {coefficients}\n"
            );
            let found = parse(&text).unwrap().index(um);
            assert!(
                (found.re - n).abs() < 2e-6 && found.im == 0.0,
                "formula {number}: {found}, not {n}"
            );
        }
    }

    #[test]
    fn tables_and_formulas_stand_beside_one_another() {
        let text = "# licence\nREFERENCES: \"x: 1\"\nDATA:\n  - type: formula 5 \n    wavelength_range: 0.4 0.9\n    coefficients: 2\n  \
                    - type: tabulated k\n    data: |\n        0.3 0.2\n        0.5 0.1\n        0.7 0\nCONDITIONS:\n  temperature: 20\n";
        let form = parse(text).unwrap();
        assert_eq!(form.range_um(), (0.4, 0.7));
        assert_eq!((form.index(0.5).re, form.index(0.5).im), (2.0, 0.1));
        let text = "DATA:\r\n- type: tabulated nk\r\n  data: |\r\n      0.4 2.1 0.01\r\n      0.5 2 0\r\n";
        assert_eq!(parse(text).unwrap().index(0.4).im, 0.01);
    }

    /// Lines among the rows that are none do not vanish.
    #[test]
    fn rows_that_are_no_numbers_are_refused() {
        for (row, physical) in [
            ("-0.45 2 0", true),
            ("nan 2 0", false),
            ("0.45 - 0", false),
            ("+0.45 2 -0.1", true),
        ] {
            let text =
                format!("DATA:\n  - type: tabulated nk\n    data: |\n      0.4 2 0\n      {row}\n      0.5 2 0\n");
            match parse(&text) {
                Err((Some(5), TableError::NotPhysical { .. })) if physical => {}
                Err((Some(5), TableError::NotANumber { .. })) if !physical => {}
                other => panic!("{row}: {other:?}"),
            }
        }
    }

    #[test]
    fn faults_name_their_line() {
        for (text, line) in [
            ("", None),
            (
                "DATA:\n  - type: tabulated k\n    data: |\n      0.4 1\n      0.5 1\n",
                None,
            ),
            ("DATA:\n  - type: formula 12\n", Some(2)),
            ("DATA:\n  - type: formula 1\n    wavelength_range: 1 2\n", Some(2)),
            (
                "DATA:\n  - type: formula 4\n    wavelength_range: 1 2\n    coefficients: 1 x\n",
                Some(4),
            ),
            (
                "DATA:\n  - type: formula 1\n    wavelength_range: 2 1\n    coefficients: 0\n",
                Some(3),
            ),
            (
                "DATA:\n  - type: tabulated nk\n    data: |\n      0.4 2 0\n      0.3 2 0\n",
                Some(5),
            ),
            (
                "DATA:\n  - type: tabulated nk\n    data: |\n      0.4 2 0\n      0.5 2\n",
                Some(5),
            ),
            (
                "DATA:\n  - type: tabulated n\n    data: |\n      0.4 2\n      0.5 x\n",
                Some(5),
            ),
            ("DATA:\n  - type: tabulated n\n    data: |\n      0.4 2\n", Some(2)),
        ] {
            assert_eq!(parse(text).unwrap_err().0, line, "{text}");
        }
    }
}
