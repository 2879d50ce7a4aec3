//! Tables of unit cells as text: what Lumerical's scripts and windows export, and xarray's or pandas' CSV.
//!
//! The columns are found by their names: `radius (m)`, `abs(S21)`, `width_nm`, `f`, `Re(t)`. Lengths without a unit are in the
//! unit in which a pillar or a wavelength of light has such a number.

use std::path::Path;

use num_complex::Complex64;

use super::{AXES, MOST_CELLS, Row, UnitCellTable};
use metalith_core::text::{quoted, without_mark};
use metalith_core::{Error, Result};

/// Speed of light (nm/s).
const LIGHT_NM_PER_S: f64 = 2.997_924_58e17;

/// Greatest length in um and in m: a pillar or a wavelength is 20 nm to 20 um, so that no two units have the same numbers.
const MOST_UM: f64 = 20.0;
const MOST_M: f64 = 1e-3;

/// Quantity of a column.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Quantity {
    /// A length along an axis of the table, of which the width is so many.
    Length(usize, f64),
    Frequency,
    Re,
    Im,
    /// Complex where its values are, else an amplitude or a power.
    Amplitude,
    Power,
    Phase,
}

/// A column that is read.
pub(super) struct Column<'t> {
    pub index: usize,
    pub name: &'t str,
    pub quantity: Quantity,
    pub unit: Option<&'static str>,
}

/// Units, as they are written, by the names that messages give them.
const UNITS: [(&str, &[&str]); 9] = [
    ("nm", &["nm", "nanometer", "nanometers", "nanometre", "nanometres"]),
    (
        "um",
        &["um", "µm", "μm", "micron", "microns", "micrometer", "micrometre"],
    ),
    ("m", &["m", "meter", "meters", "metre", "metres"]),
    ("Hz", &["hz"]),
    ("THz", &["thz"]),
    ("rad", &["rad", "rads", "radian", "radians"]),
    ("deg", &["deg", "degree", "degrees", "°"]),
    ("waves", &["waves", "turns", "2pi", "2*pi", "cycles"]),
    ("", &["a.u.", "1", "-"]),
];

const COLUMNS: &str = "name the columns in one line before the numbers: `width_nm` or `radius (um)`, if there are several `height` and \
                       `wavelength`, and `re` and `im`, `abs` and `phase (rad)`, `T` and `phase (rad)`, or one complex `t`; or `turns,width_nm` \
                       for a mapping";

/// The table of a text.
pub(super) fn read(path: &Path, text: &str) -> Result<UnitCellTable> {
    let fault = |line: Option<usize>, what: String| Error::Table {
        path: path.to_owned(),
        line,
        what,
        hint: COLUMNS.into(),
    };
    let mut head: Option<(usize, &str)> = None;
    let mut rows = Vec::new();
    for (line, text) in without_mark(text)
        .lines()
        .enumerate()
        // A tab before the first value stands behind an empty column.
        .map(|(k, text)| (k + 1, text.trim_end().trim_start_matches(' ')))
    {
        let is_note = text.trim_start().starts_with(['#', '%']);
        let bare = if is_note {
            text.trim_start().trim_start_matches(['#', '%']).trim()
        } else {
            text
        };
        if bare.is_empty() || (is_note && (!rows.is_empty() || bare.contains('='))) {
            continue;
        }
        let is_number = |field: &&str| complex(field).is_some();
        if rows.is_empty() && (is_note || !fields(bare).iter().find(|f| !f.is_empty()).is_some_and(is_number)) {
            head = Some((line, bare));
        } else {
            if rows.len() == MOST_CELLS {
                return Err(fault(Some(line), format!("more than {MOST_CELLS} rows")));
            }
            rows.push((line, fields(text)));
        }
    }
    let Some((first, fields_of_first)) = rows.first() else {
        return Err(fault(None, "no row begins with a number".into()));
    };
    let Some((head_line, head)) = head else {
        return Err(fault(Some(*first), "numbers whose columns have no names".into()));
    };
    let names = fields(head);
    if names.len() != fields_of_first.len() {
        let what = format!(
            "{} names of columns, and rows of {}",
            names.len(),
            fields_of_first.len()
        );
        return Err(fault(Some(head_line), what));
    }
    let columns = columns(&names).map_err(|what| fault(Some(head_line), what))?;
    let mut values: Vec<Vec<Complex64>> = vec![Vec::with_capacity(rows.len()); columns.len()];
    for (line, fields) in &rows {
        if fields.len() != names.len() {
            return Err(fault(
                Some(*line),
                format!("{} numbers in {} columns", fields.len(), names.len()),
            ));
        }
        for (column, values) in columns.iter().zip(&mut values) {
            let field = fields[column.index];
            let value = complex(field).filter(|v| v.re.is_finite() && v.im.is_finite());
            values.push(value.ok_or_else(|| {
                let what = match field {
                    "" => format!("no number in the column `{}`", quoted(column.name)),
                    _ => format!("`{}` is no number", quoted(field)),
                };
                fault(Some(*line), what)
            })?);
        }
    }
    let mut words = Vec::new();
    let mut lengths: [Option<Vec<f64>>; 3] = Default::default();
    for (column, values) in columns.iter().zip(&values) {
        let (axis, scale) = match column.quantity {
            Quantity::Length(axis, scale) => (axis, scale),
            Quantity::Frequency => (2, 1.0),
            _ => continue,
        };
        let (nm, unit) = lengths_nm(column, values, scale).ok_or_else(|| {
            let what = format!(
                "`{}` holds values that are no {} of a unit cell",
                quoted(column.name),
                AXES[axis]
            );
            fault(Some(head_line), what)
        })?;
        if lengths[axis].replace(nm).is_some() {
            return Err(fault(Some(head_line), format!("two columns of {}", AXES[axis])));
        }
        words.push(format!("`{}` in {unit}", quoted(column.name)));
    }
    if lengths[0].is_none() {
        return Err(fault(Some(head_line), "no column of widths, diameters or radii".into()));
    }
    let t = transmissions(&columns, &values, &mut words).map_err(|what| fault(Some(head_line), what))?;
    let rows: Vec<Row> = (0..rows.len())
        .map(|k| Row {
            at_nm: lengths.each_ref().map(|nm| nm.as_ref().map(|nm| nm[k])),
            t: t[k],
            line: Some(rows[k].0),
        })
        .collect();
    UnitCellTable::of_rows(path, &rows, words.join(", "))
}

/// Fields of a line between tabs, semicolons, commas or spaces; a unit in brackets belongs to the name before it.
fn fields(line: &str) -> Vec<&str> {
    if let Some(separator) = ['\t', ';', ','].into_iter().find(|c| line.contains(*c)) {
        return line.split(separator).map(bare).collect();
    }
    let mut found: Vec<&str> = Vec::new();
    let mut start: Option<usize> = None;
    for (at, c) in line.char_indices().chain([(line.len(), ' ')]) {
        match (c.is_whitespace(), start) {
            (false, None) => start = Some(at),
            (true, Some(from)) => {
                // `radius (um)` is one name.
                let rest = line[at..].trim_start();
                if !rest.starts_with(['(', '['])
                    || complex(&line[from..at]).is_some()
                    || complex(rest.split(' ').next().unwrap_or("")).is_some()
                {
                    found.push(bare(&line[from..at]));
                    start = None;
                }
            }
            _ => {}
        }
    }
    found
}

fn bare(field: &str) -> &str {
    field.trim().trim_matches('"').trim()
}

/// A number as numpy, MATLAB and Lumerical write it: `0.5`, `(0.1+0.2j)`, `0.1-2e-3i`.
fn complex(field: &str) -> Option<Complex64> {
    let field = field.trim().trim_start_matches('(').trim_end_matches(')').trim();
    if let Ok(real) = field.parse::<f64>() {
        return Some(Complex64::new(real, 0.0));
    }
    let field = field.strip_suffix(['j', 'i'])?.trim_end_matches('*');
    let bytes = field.as_bytes();
    let sign = (1..bytes.len())
        .rev()
        .find(|&k| matches!(bytes[k], b'+' | b'-') && !matches!(bytes[k - 1], b'e' | b'E'));
    let number = |text: &str| text.replace(' ', "").parse::<f64>().ok();
    match sign {
        Some(at) => Some(Complex64::new(number(&field[..at])?, number(&field[at..])?)),
        None => Some(Complex64::new(0.0, number(field)?)),
    }
}

/// The columns that are read, by their names.
fn columns<'t>(names: &[&'t str]) -> std::result::Result<Vec<Column<'t>>, String> {
    let mut found: Vec<Column<'t>> = Vec::new();
    for (index, &name) in names.iter().enumerate() {
        let Some((quantity, unit)) = quantity(name) else {
            continue;
        };
        if let Some(other) = found.iter().find(|c| c.quantity == quantity) {
            return Err(format!(
                "`{}` and `{}` are the same quantity",
                quoted(other.name),
                quoted(name)
            ));
        }
        found.push(Column {
            index,
            name,
            quantity,
            unit,
        });
    }
    Ok(found)
}

/// Quantity and unit that a name says, if it is one of a unit cell.
pub(super) fn quantity(name: &str) -> Option<(Quantity, Option<&'static str>)> {
    let lower = name.to_lowercase();
    let unit_of = |text: &str| UNITS.iter().find(|(_, all)| all.contains(&text)).map(|(unit, _)| *unit);
    let in_brackets = lower
        .rsplit_once(['(', '['])
        .and_then(|(before, unit)| Some((before.to_owned(), unit_of(unit.trim_end_matches([')', ']']).trim())?)));
    let behind = || {
        let (before, unit) = lower.rsplit_once(['_', ' '])?;
        Some((before.to_owned(), unit_of(unit)?))
    };
    let (base, unit) = match in_brackets.or_else(behind) {
        Some((base, unit)) => (base, Some(unit)),
        None => (lower.clone(), None),
    };
    let words: Vec<&str> = base
        .split(|c: char| !c.is_alphanumeric())
        .filter(|w| !w.is_empty())
        .collect();
    let has = |all: &[&str]| words.iter().any(|word| all.contains(word));
    let is_upper = |letter: char| name.trim_start().starts_with(letter);
    if has(&["s11", "s12", "s22", "reflection", "reflectance", "refl"]) || (words == ["r"] && is_upper('R')) {
        return None;
    }
    let squared = base.contains("^2") || base.contains("**2");
    let quantity = if has(&["phase", "angle", "arg", "phi"]) && !has(&["theta", "incidence"]) {
        Quantity::Phase
    } else if has(&["re", "real"]) {
        Quantity::Re
    } else if has(&["im", "imag", "imaginary"]) {
        Quantity::Im
    } else if squared
        || has(&["transmittance", "power", "efficiency"])
        || (words.first() == Some(&"t") && is_upper('T'))
    {
        Quantity::Power
    } else if has(&["abs", "mag", "magnitude", "amplitude", "amp", "modulus"])
        || base.contains('|')
        || words.first() == Some(&"t")
        || has(&["s21"])
    {
        Quantity::Amplitude
    } else if has(&["transmission"]) {
        Quantity::Power
    } else if has(&["radius"]) || words == ["r"] {
        Quantity::Length(0, 2.0)
    } else if has(&["width", "diameter", "dia", "side", "edge"]) || words == ["w"] || words == ["d"] {
        Quantity::Length(0, 1.0)
    } else if has(&["height", "thickness"]) || words == ["h"] {
        Quantity::Length(1, 1.0)
    } else if has(&["wavelength", "lambda", "wl", "wvl", "λ"]) {
        Quantity::Length(2, 1.0)
    } else if has(&["frequency", "freq"]) || words == ["f"] {
        Quantity::Frequency
    } else {
        return None;
    };
    Some((quantity, unit))
}

/// Lengths of a column (nm) and the word for their unit.
fn lengths_nm(column: &Column<'_>, values: &[Complex64], scale: f64) -> Option<(Vec<f64>, &'static str)> {
    let real: Vec<f64> = values.iter().map(|v| v.re).collect();
    axis_nm(&real, column.quantity == Quantity::Frequency, column.unit)
        .map(|(nm, unit)| (nm.iter().map(|nm| nm * scale).collect(), unit))
}

/// Widths, heights or wavelengths (nm) of numbers in a unit, or in the one in which a pillar or light has such numbers, and that unit.
pub(super) fn axis_nm(
    values: &[f64],
    is_frequency: bool,
    unit: Option<&'static str>,
) -> Option<(Vec<f64>, &'static str)> {
    let most = values.iter().copied().fold(0.0, f64::max);
    let unit = unit
        .filter(|unit| !unit.is_empty())
        .unwrap_or(match (is_frequency, most) {
            (true, most) if most < 1e6 => "THz",
            (true, _) => "Hz",
            (false, most) if most < MOST_M => "m",
            (false, most) if most < MOST_UM => "um",
            (false, _) => "nm",
        });
    let in_nm = |value: f64| match unit {
        "nm" => Some(value),
        "um" => Some(value * 1e3),
        "m" => Some(value * 1e9),
        "Hz" => Some(LIGHT_NM_PER_S / value),
        "THz" => Some(LIGHT_NM_PER_S / (value * 1e12)),
        _ => None,
    };
    let nm: Vec<f64> = values.iter().map(|value| in_nm(*value)).collect::<Option<_>>()?;
    let is_length = |nm: &f64| nm.is_finite() && *nm >= 0.0 && *nm <= 1e6;
    nm.iter().all(is_length).then_some((nm, unit))
}

/// Transmissions row by row; `words` get what their columns are.
pub(super) fn transmissions(
    columns: &[Column<'_>],
    values: &[Vec<Complex64>],
    words: &mut Vec<String>,
) -> std::result::Result<Vec<Complex64>, String> {
    let find = |quantity: Quantity| {
        let at = columns.iter().position(|c| c.quantity == quantity)?;
        Some((&columns[at], &values[at]))
    };
    let mut say = |column: &Column<'_>, as_what: &str| words.push(format!("`{}` as {as_what}", quoted(column.name)));
    for quantity in [Quantity::Amplitude, Quantity::Power] {
        if let Some((column, values)) = find(quantity)
            && values.iter().any(|v| v.im != 0.0)
        {
            say(column, "complex amplitude");
            return Ok(values.clone());
        }
    }
    if let (Some((re_column, re)), Some((im_column, im))) = (find(Quantity::Re), find(Quantity::Im)) {
        say(re_column, "real part");
        say(im_column, "imaginary part");
        return Ok(re.iter().zip(im).map(|(re, im)| Complex64::new(re.re, im.re)).collect());
    }
    let Some((column, phases)) = find(Quantity::Phase) else {
        return Err("no column of phases, nor a complex transmission".into());
    };
    let most = phases.iter().map(|v| v.re.abs()).fold(0.0, f64::max);
    // An angle of a complex number in radians is within half a turn, or a turn if it was made positive.
    const MOST_ANGLE: f64 = std::f64::consts::TAU * 1.001;
    let (unit, scale) = match column.unit {
        Some("deg") => ("deg", std::f64::consts::PI / 180.0),
        Some("waves") => ("waves", std::f64::consts::TAU),
        Some("rad") => ("rad", 1.0),
        None | Some("") if most <= MOST_ANGLE => ("rad", 1.0),
        _ => {
            let name = quoted(column.name);
            return Err(format!(
                "`{name}` goes to {most} and has no unit: name it `{name} (rad)` or `{name} (deg)`"
            ));
        }
    };
    say(column, &format!("phase in {unit}"));
    let amplitudes: Vec<f64> = match (find(Quantity::Amplitude), find(Quantity::Power)) {
        (Some((column, values)), _) => {
            say(column, "amplitude");
            values.iter().map(|v| v.re).collect()
        }
        (None, Some((column, values))) => {
            say(column, "power");
            values.iter().map(|v| v.re.max(0.0).sqrt()).collect()
        }
        (None, None) => {
            words.push("no amplitude: 1 is taken".into());
            vec![1.0; phases.len()]
        }
    };
    Ok(amplitudes
        .iter()
        .zip(phases)
        .map(|(a, phase)| Complex64::from_polar(*a, phase.re * scale))
        .collect())
}
