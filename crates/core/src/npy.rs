//! Arrays of numbers from NPY files.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read};
use std::path::Path;

use npyz::num_complex::{Complex32, Complex64};

/// An array as the file has it, in C order.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Entries along each axis, slowest first.
    pub shape: Vec<u64>,
    pub values: Vec<f64>,
    /// True if the file holds whole numbers.
    pub whole: bool,
}

/// Reason why a file holds no array that can be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NpyError {
    #[error("it cannot be read: {0}")]
    Io(#[from] io::Error),
    #[error("it is not an ordinary file")]
    NotAFile,
    #[error("it is no NPY file: {0}")]
    Format(String),
    #[error("its header says that entries have several fields, or is nested")]
    Nested,
    #[error("it holds an array of shape {shape:?}")]
    Shape { shape: Vec<u64> },
    #[error("its entries are neither float32, float64 nor whole numbers of 8 to 32 bits")]
    Type,
    #[error("its entries are neither float32, float64, complex64 nor complex128")]
    NoPhase,
    #[error("its entries are neither complex64 nor complex128")]
    NoField,
    #[error("it ends early: {0}")]
    Short(io::Error),
}

/// Longest header that is read (bytes): that of a plain array has 118.
const LONGEST_HEADER: usize = 1 << 12;

/// Most entries of an array: no file that is read has as many.
const MOST_ENTRIES: u64 = 1 << 40;

/// Read an array of float32, float64 or whole numbers of 8 to 32 bits, in C or Fortran order, if its shape is one that the caller
/// takes: nothing is read or set aside for entries before that.
///
/// # Errors
/// If the file cannot be read or holds something else.
pub fn read(path: &Path, takes: impl FnOnce(&[u64]) -> bool) -> Result<Array, NpyError> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(NpyError::NotAFile);
    }
    read_from(BufReader::new(File::open(path)?), takes)
}

/// Variant of [`read`] for phases (rad), as other programs write them: real numbers, or complex fields of which the phase is the
/// angle.
///
/// # Errors
/// As [`read`].
pub fn read_phases(path: &Path, takes: impl FnOnce(&[u64]) -> bool) -> Result<Array, NpyError> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(NpyError::NotAFile);
    }
    phases_from(BufReader::new(File::open(path)?), takes)
}

/// Read complex64 or complex128 fields of two axes, in C or Fortran order: real part and imaginary part in turn.
///
/// # Errors
/// As [`read`].
pub fn read_fields(path: &Path, takes: impl FnOnce(&[u64]) -> bool) -> Result<Array, NpyError> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(NpyError::NotAFile);
    }
    let (npy, shape, columns_first) = opened(BufReader::new(File::open(path)?), takes)?;
    let fields: io::Result<Vec<Complex64>> = match npy.try_data::<Complex64>() {
        Ok(data) => data.collect(),
        Err(npy) => {
            let data = npy.try_data::<Complex32>().map_err(|_| NpyError::NoField)?;
            data.map(|v| v.map(|v| Complex64::new(v.re.into(), v.im.into())))
                .collect()
        }
    };
    let fields = fields.map_err(NpyError::Short)?;
    let part =
        |of: fn(&Complex64) -> f64| rows_first(shape.clone(), columns_first, fields.iter().map(of).collect()).values;
    let (real, imaginary) = (part(|v| v.re), part(|v| v.im));
    Ok(Array {
        shape: shape.clone(),
        values: real.into_iter().zip(imaginary).flat_map(|(a, b)| [a, b]).collect(),
        whole: false,
    })
}

fn phases_from(from: impl Read, takes: impl FnOnce(&[u64]) -> bool) -> Result<Array, NpyError> {
    let (npy, shape, columns_first) = opened(from, takes)?;
    let npy = match npy.try_data::<Complex64>() {
        Ok(data) => return angles(shape, columns_first, data),
        Err(npy) => npy,
    };
    let npy = match npy.try_data::<Complex32>() {
        Ok(data) => {
            let wide = |v: Complex32| Complex64::new(v.re.into(), v.im.into());
            return angles(shape, columns_first, data.map(|v| v.map(wide)));
        }
        Err(npy) => npy,
    };
    let values = reals(npy).map_err(|_| NpyError::NoPhase)?;
    Ok(rows_first(shape, columns_first, values.map_err(NpyError::Short)?))
}

/// A file behind its header, as it is in memory.
type Headed<R> = npyz::NpyFile<io::Chain<Cursor<Vec<u8>>, R>>;

/// A plain array of a shape that is taken, and whether its columns come first, with that shape.
fn opened<R: Read>(mut from: R, takes: impl FnOnce(&[u64]) -> bool) -> Result<(Headed<R>, Vec<u64>, bool), NpyError> {
    let header = plain_header(&mut from)?;
    let npy = npyz::NpyFile::new(Cursor::new(header).chain(from)).map_err(|e| NpyError::Format(e.to_string()))?;
    let shape = npy.shape().to_vec();
    let columns_first = npy.order() != npyz::Order::C;
    if takes(&shape) {
        Ok((npy, shape, columns_first))
    } else {
        Err(NpyError::Shape { shape })
    }
}

/// Real numbers in double or single precision; the file itself if it holds others.
fn reals<R: Read>(npy: npyz::NpyFile<R>) -> Result<io::Result<Vec<f64>>, npyz::NpyFile<R>> {
    match npy.try_data::<f64>() {
        Ok(data) => Ok(data.collect()),
        Err(npy) => Ok(npy.try_data::<f32>()?.map(|v| v.map(f64::from)).collect()),
    }
}

/// The angles of complex numbers (rad).
fn angles(
    shape: Vec<u64>,
    columns_first: bool,
    fields: impl Iterator<Item = io::Result<Complex64>>,
) -> Result<Array, NpyError> {
    let values = fields.map(|v| v.map(|v| if v.is_finite() { v.arg() } else { f64::NAN }));
    let values = values.collect::<io::Result<_>>().map_err(NpyError::Short)?;
    Ok(rows_first(shape, columns_first, values))
}

/// An array in C order.
fn rows_first(shape: Vec<u64>, columns_first: bool, values: Vec<f64>) -> Array {
    let values = if columns_first && shape.len() > 1 {
        let sides: Vec<usize> = shape.iter().map(|n| *n as usize).collect();
        // Entries from one to the next along each axis, as they are stored.
        let mut strides = vec![1; sides.len()];
        for k in 1..sides.len() {
            strides[k] = strides[k - 1] * sides[k - 1];
        }
        let stored = |k: usize| {
            let along = sides.iter().zip(&strides).rev();
            along
                .fold((k, 0), |(k, at), (side, stride)| (k / side, at + k % side * stride))
                .1
        };
        (0..values.len()).map(|k| values[stored(k)]).collect()
    } else {
        values
    };
    Array {
        shape,
        values,
        whole: false,
    }
}

/// Variant of [`read`] for anything that can be read.
///
/// # Errors
/// As [`read`].
pub fn read_from(from: impl Read, takes: impl FnOnce(&[u64]) -> bool) -> Result<Array, NpyError> {
    let (npy, shape, columns_first) = opened(from, takes)?;
    let (values, whole) = match reals(npy) {
        Ok(values) => (values, false),
        Err(npy) => (whole_numbers(npy).ok_or(NpyError::Type)?, true),
    };
    let array = rows_first(shape, columns_first, values.map_err(NpyError::Short)?);
    Ok(Array { whole, ..array })
}

/// Whole numbers of 8 to 32 bits; none if the file holds others.
fn whole_numbers<R: Read>(npy: npyz::NpyFile<R>) -> Option<io::Result<Vec<f64>>> {
    fn of<T: npyz::Deserialize + Into<f64>, R: Read>(
        npy: npyz::NpyFile<R>,
    ) -> Result<io::Result<Vec<f64>>, npyz::NpyFile<R>> {
        Ok(npy.try_data::<T>()?.map(|v| v.map(Into::into)).collect())
    }
    of::<u8, R>(npy)
        .or_else(of::<u16, R>)
        .or_else(of::<u32, R>)
        .or_else(of::<i8, R>)
        .or_else(of::<i16, R>)
        .or_else(of::<i32, R>)
        .ok()
}

/// The bytes before the entries, if they describe a plain array. The parser behind takes twice the time for each
/// bracket inside brackets, and a plain array has none: its header is one dictionary with one tuple, the shape.
fn plain_header(from: &mut impl Read) -> Result<Vec<u8>, NpyError> {
    const MAGIC: &[u8] = b"\x93NUMPY";
    let early = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => NpyError::Format("it ends in its header".into()),
        _ => NpyError::Io(error),
    };
    let mut bytes = vec![0; 8];
    from.read_exact(&mut bytes).map_err(early)?;
    if !bytes.starts_with(MAGIC) {
        return Err(NpyError::Format("it does not begin like one".into()));
    }
    // Version 1 has two bytes for the length of the header, later ones four.
    let digits = if bytes[6] == 1 { 2 } else { 4 };
    let mut length = [0; 4];
    from.read_exact(&mut length[..digits]).map_err(early)?;
    bytes.extend(&length[..digits]);
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST_HEADER {
        return Err(NpyError::Format(format!("a header of {length} bytes")));
    }
    let start = bytes.len();
    bytes.resize(start + length, 0);
    from.read_exact(&mut bytes[start..]).map_err(early)?;
    let opening = |bracket: u8| bytes[start..].iter().filter(|&&b| b == bracket).count();
    if opening(b'[') > 0 || opening(b'(') > 1 || opening(b'{') > 1 {
        return Err(NpyError::Nested);
    }
    check_entries(&bytes[start..])?;
    Ok(bytes)
}

/// The product of the numbers in the one tuple, the shape: the parser behind multiplies without a look.
fn check_entries(header: &[u8]) -> Result<(), NpyError> {
    let tuple = header.split(|&b| b == b'(').nth(1).unwrap_or_default();
    let tuple = tuple.split(|&b| b == b')').next().unwrap_or_default();
    let entries = tuple.split(|&b| b == b',').try_fold(1u64, |entries, digits| {
        let digits = digits.trim_ascii();
        if digits.is_empty() {
            return Some(entries);
        }
        entries.checked_mul(std::str::from_utf8(digits).ok()?.parse().ok()?)
    });
    match entries {
        Some(entries) if entries <= MOST_ENTRIES => Ok(()),
        _ => {
            let shape = crate::text::printable_bytes(tuple);
            Err(NpyError::Format(format!("its shape is ({shape})")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn outcome(bytes: &[u8]) -> Result<Array, NpyError> {
        read_from(bytes, |shape| shape == [2, 2])
    }

    const PLAIN: &str = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2), }\n";

    #[test]
    fn plain_arrays_are_read() {
        let numbers = [1.5f32, -2.0, 3.25, f32::INFINITY];
        let data: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        let read = outcome(&file(PLAIN, &data)).unwrap();
        assert_eq!(read.values, numbers.map(f64::from));
        let double = PLAIN.replace("<f4", ">f8");
        let data: Vec<u8> = numbers.iter().flat_map(|&v| f64::from(v).to_be_bytes()).collect();
        assert_eq!(outcome(&file(&double, &data)).unwrap().values, numbers.map(f64::from));
        assert!(!read.whole && outcome(&file(&PLAIN.replace("<f4", "|u1"), &[7; 4])).unwrap().whole);
        assert!(matches!(outcome(&file(PLAIN, &[0; 15])), Err(NpyError::Short(_))));
    }

    /// Entries of which the number is that of the place, along any number of axes in either order.
    #[test]
    fn fortran_order_is_put_into_rows() {
        let read = |order: &str, shape: &str, values: &[u32]| {
            let header = PLAIN
                .replace("<f4", "<u4")
                .replace("(2, 2)", shape)
                .replace("False", order);
            let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            read_from(&file(&header, &data)[..], |_| true).unwrap()
        };
        let rows: Vec<u32> = (0..24).collect();
        let columns: Vec<u32> = (0..24).map(|k| k % 2 * 12 + k / 2 % 3 * 4 + k / 6).collect();
        let found = read("True", "(2, 3, 4)", &columns);
        assert_eq!(found, read("False", "(2, 3, 4)", &rows));
        assert!(found.whole && found.values[23] == 23.0);
        assert_eq!(
            read("True", "(24,)", &rows).values,
            read("False", "(24,)", &rows).values
        );
        assert_eq!(read("False", "(1,)", &[u32::MAX]).values, [4_294_967_295.0]);
    }

    #[test]
    fn phases_are_read_as_other_programs_write_them() {
        let phases = |header: &str, numbers: &[f64]| {
            let data: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
            phases_from(&file(header, &data)[..], |shape| shape == [2, 3])
                .unwrap()
                .values
        };
        let header = PLAIN.replace("<f4", "<f8").replace("(2, 2)", "(2, 3)");
        let in_rows = phases(&header, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let in_columns = phases(&header.replace("False", "True"), &[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        assert_eq!(in_rows, in_columns);
        let fields = [1.0, 0.0, 0.0, 2.0, -1.0, 0.0, 0.0, -3.0, 1.0, 1.0, f64::NAN, 0.0];
        let angles = phases(&header.replace("<f8", "<c16"), &fields);
        let quarter = std::f64::consts::FRAC_PI_2;
        assert_eq!(angles[..5], [0.0, quarter, 2.0 * quarter, -quarter, 0.5 * quarter]);
        assert!(angles[5].is_nan());
        let whole = phases_from(&file(&header.replace("<f8", "<i8"), &[0; 48])[..], |_| true);
        assert!(matches!(whole, Err(NpyError::NoPhase)));
    }

    #[test]
    fn what_is_no_plain_array_is_named() {
        let with = |from: &str, to: &str| outcome(&file(&PLAIN.replace(from, to), &[0; 64]));
        assert!(matches!(with("(2, 2)", "(2, 3)"), Err(NpyError::Shape { .. })));
        assert!(matches!(with("<f4", "<i8"), Err(NpyError::Type)));
        assert!(matches!(
            with("(2, 2)", "(99999999999, 99999999999)"),
            Err(NpyError::Format(_))
        ));
        assert!(matches!(with("'shape'", "'form'"), Err(NpyError::Format(_))));
        assert!(matches!(outcome(b"\x93NUMPY\x01\x00"), Err(NpyError::Format(_))));
        assert!(matches!(outcome(b"P5 2 2"), Err(NpyError::Format(_))));
        assert!(matches!(
            outcome(b"\x93NUMPY\x02\x00\xff\xff\xff\xff{}"),
            Err(NpyError::Format(_))
        ));
    }

    /// A header of nested brackets, for which the parser behind would take 2^n steps.
    #[test]
    fn nested_headers_are_refused_before_they_are_parsed() {
        for (open, close) in [("[", "]"), ("(", ")"), ("{", "}")] {
            let deep = format!("{}1{}", open.repeat(100), close.repeat(100));
            let header = PLAIN.replace("(2, 2)", &deep);
            assert!(matches!(outcome(&file(&header, &[0; 64])), Err(NpyError::Nested)));
        }
    }
}
