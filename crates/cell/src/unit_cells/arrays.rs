//! Tables of unit cells as arrays of HDF5: what Tidy3D, xarray, h5py and MATLAB write.

use std::collections::BTreeMap;
use std::path::Path;

use num_complex::Complex64;

use super::hdf5::{DataSet, File, Parsed};
use super::text::{Column, Quantity, axis_nm, quantity, transmissions};
use super::{AXES, MOST_CELLS, Row, UnitCellTable};
use metalith_core::text::quoted;
use metalith_core::{Error, Result};

/// Name that xarray gives an array without one.
const UNNAMED: &str = "__xarray_dataarray_variable__";

/// The table of a file; none if it is no HDF5.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Option<Result<UnitCellTable>> {
    let refused = |what: String| {
        Error::refused(
            "mapping/hdf5",
            format!("{}: {what}", path.display()),
            "save it as text: in Python, `data.to_dataframe(name=\"t\").to_csv(\"cells.csv\")` of the xarray.DataArray",
        )
    };
    let (file, sets) = match File::data_sets(bytes)? {
        Ok(found) => found,
        Err(what) => return Some(Err(refused(what))),
    };
    let mut groups: BTreeMap<&str, Vec<&DataSet<'_>>> = BTreeMap::new();
    for set in &sets {
        groups.entry(&set.group).or_default().push(set);
    }
    let tables: Vec<_> = groups.values().filter_map(|sets| grid(&file, sets)).collect();
    let (rows, words) = match (tables.len(), tables.into_iter().next()) {
        (1, Some(Ok(table))) => table,
        (1, Some(Err(what))) => return Some(Err(refused(what))),
        (0, _) => return Some(Err(refused("no group has widths and complex transmissions".into()))),
        (count, _) => return Some(Err(refused(format!("{count} groups have transmissions of unit cells")))),
    };
    Some(UnitCellTable::of_rows(path, &rows, words))
}

/// Coordinates along an axis of a table, and their values (nm).
struct Coordinate {
    axis: usize,
    nm: Vec<f64>,
}

/// Rows of the arrays of a group and the meaning of these; none if they are no unit cells.
fn grid<'a>(file: &File<'a>, sets: &[&'a DataSet<'a>]) -> Option<Parsed<(Vec<Row>, String)>> {
    let (mut lengths, mut data) = (Vec::new(), Vec::new());
    for &set in sets {
        match quantity(&set.name) {
            Some((of @ (Quantity::Length(..) | Quantity::Frequency), unit)) => lengths.push((set, of, unit)),
            Some((quantity, unit)) => data.push((set, quantity, unit)),
            None if set.is_complex() && set.name == UNNAMED => data.push((set, Quantity::Amplitude, None)),
            None => {}
        }
    }
    let is_one = !data.is_empty() && lengths.iter().any(|(_, of, _)| matches!(of, Quantity::Length(0, _)));
    is_one.then(|| rows(file, &lengths, &data))
}

type Named<'a> = (&'a DataSet<'a>, Quantity, Option<&'static str>);

fn rows<'a>(file: &File<'a>, lengths: &[Named<'a>], data: &[Named<'a>]) -> Parsed<(Vec<Row>, String)> {
    let mut words = Vec::new();
    let mut coordinates: Vec<Coordinate> = Vec::new();
    for (set, of, unit) in lengths {
        let (axis, scale) = match of {
            Quantity::Length(axis, scale) => (*axis, *scale),
            _ => (2, 1.0),
        };
        let name = quoted(&set.name);
        let real: Vec<f64> = file.values(set)?.iter().map(|v| v.re).collect();
        let found = axis_nm(&real, *of == Quantity::Frequency, *unit).filter(|_| set.shape.len() < 2);
        let (nm, unit) =
            found.ok_or_else(|| format!("`{name}` holds values that are no {} of a unit cell", AXES[axis]))?;
        if coordinates.iter().any(|c| c.axis == axis) {
            return Err(format!("two arrays of {}", AXES[axis]));
        }
        words.push(format!("`{name}` in {unit}"));
        coordinates.push(Coordinate {
            axis,
            nm: nm.iter().map(|nm| nm * scale).collect(),
        });
    }
    let first = data[0].0;
    let count = first.shape.iter().try_fold(1_u64, |count, n| count.checked_mul(*n));
    if count.is_none_or(|count| count > MOST_CELLS as u64) || data.iter().any(|(set, ..)| set.shape != first.shape) {
        return Err("arrays of transmission of different shapes, or too large".into());
    }
    let axes = first
        .shape
        .iter()
        .map(|length| along(&coordinates, first, *length))
        .collect::<Parsed<Vec<_>>>()?;
    let columns: Vec<Column<'_>> = data
        .iter()
        .enumerate()
        .map(|(index, (set, quantity, unit))| Column {
            index,
            name: &set.name,
            quantity: *quantity,
            unit: *unit,
        })
        .collect();
    let values = data
        .iter()
        .map(|(set, ..)| file.values(set))
        .collect::<Parsed<Vec<Vec<Complex64>>>>()?;
    if values.iter().flatten().any(|v| !v.is_finite()) {
        return Err("transmissions that are no numbers".into());
    }
    let t = transmissions(&columns, &values, &mut words)?;
    let mut fixed = [None; 3];
    for coordinate in coordinates.iter().filter(|c| c.nm.len() == 1) {
        fixed[coordinate.axis] = Some(coordinate.nm[0]);
    }
    let rows = t.iter().enumerate().map(|(k, t)| {
        let (mut at_nm, mut rest) = (fixed, k);
        for (coordinate, length) in axes.iter().zip(&first.shape).rev() {
            if let Some(coordinate) = coordinate {
                at_nm[coordinate.axis] = Some(coordinate.nm[rest % *length as usize]);
            }
            rest /= *length as usize;
        }
        Row {
            at_nm,
            t: *t,
            line: None,
        }
    });
    Ok((rows.collect(), words.join(", ")))
}

/// Coordinate along an axis of an array; none where the axis has one entry.
fn along<'c>(coordinates: &'c [Coordinate], set: &DataSet<'_>, length: u64) -> Parsed<Option<&'c Coordinate>> {
    if length == 1 {
        return Ok(None);
    }
    let fits = |c: &&Coordinate| c.nm.len() as u64 == length;
    let found: Vec<_> = coordinates.iter().filter(fits).collect();
    let is_twice = set.shape.iter().filter(|n| **n == length).count() > 1;
    match (found.as_slice(), is_twice) {
        ([one], false) => Ok(Some(one)),
        ([], _) => Err(format!("an axis of {length} entries is no width, height or wavelength")),
        _ => Err(format!(
            "several axes have {length} entries, and no one says which is which"
        )),
    }
}
