//! Stacks of arrays in the classic format of NetCDF, with 64-bit offsets (Unidata, *NetCDF Classic Format Specification*): what xarray,
//! MATLAB, Julia and `ncdump` read, with axes, units and notes.

use std::path::Path;

use metalith_core::{AtomicFile, Error, Result};

/// Tags of the lists of a header.
const DIMENSIONS: u32 = 10;
const VARIABLES: u32 = 11;
const ATTRIBUTES: u32 = 12;

/// Largest array that a header of this version can state (bytes).
const MOST_BYTES: usize = (u32::MAX - 3) as usize;

/// Values of an array.
pub(crate) enum Values {
    Text(String),
    Double(Vec<f64>),
}

impl Values {
    /// Number of the type in the format.
    fn kind(&self) -> u32 {
        match self {
            Self::Text(_) => 2,
            Self::Double(_) => 6,
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Text(text) => text.len(),
            Self::Double(numbers) => numbers.len(),
        }
    }

    /// Values as a file holds them: the most significant byte first, then zeros to a multiple of four.
    fn bytes(&self) -> Vec<u8> {
        let bytes = match self {
            Self::Text(text) => text.as_bytes().to_vec(),
            Self::Double(numbers) => numbers.iter().flat_map(|v| v.to_be_bytes()).collect(),
        };
        padded(bytes)
    }

    fn size(&self) -> usize {
        let one = match self {
            Self::Text(_) => 1,
            Self::Double(_) => 8,
        };
        (one * self.len()).next_multiple_of(4)
    }
}

/// Array with the names of its axes.
pub(crate) struct Variable {
    pub name: &'static str,
    /// Indices of its axes in [`Dataset::axes`].
    pub axes: Vec<usize>,
    /// Notes such as its unit.
    pub notes: Vec<(&'static str, String)>,
    pub values: Values,
}

/// Arrays of one file.
#[derive(Default)]
pub(crate) struct Dataset {
    /// Name and length of each axis.
    pub axes: Vec<(&'static str, usize)>,
    pub notes: Vec<(&'static str, String)>,
    pub variables: Vec<Variable>,
}

impl Dataset {
    /// Write it.
    ///
    /// # Errors
    /// If an array has more than 4 GB, or the file cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        if self.variables.iter().any(|v| v.values.size() > MOST_BYTES) {
            return Err(Error::refused(
                "netcdf/too-large",
                format!("{}: an array has more than 4 GB", path.display()),
                "simulate fewer elements or wavelengths at a time, or a smaller window",
            ));
        }
        AtomicFile::write(path, &self.bytes())
    }

    fn bytes(&self) -> Vec<u8> {
        // The header has the same length wherever the arrays begin.
        let header = self.header(0).len() as u64;
        let mut bytes = self.header(header);
        self.variables.iter().for_each(|v| bytes.extend(v.values.bytes()));
        bytes
    }

    /// Header of a file whose arrays begin at a byte.
    fn header(&self, first: u64) -> Vec<u8> {
        let mut to = b"CDF\x02".to_vec();
        // No axis grows.
        number(&mut to, 0);
        list(&mut to, DIMENSIONS, self.axes.len());
        for (name, length) in &self.axes {
            word(&mut to, name);
            number(&mut to, *length);
        }
        notes(&mut to, &self.notes);
        list(&mut to, VARIABLES, self.variables.len());
        let mut begin = first;
        for variable in &self.variables {
            word(&mut to, variable.name);
            number(&mut to, variable.axes.len());
            variable.axes.iter().for_each(|axis| number(&mut to, *axis));
            notes(&mut to, &variable.notes);
            number(&mut to, variable.values.kind() as usize);
            number(&mut to, variable.values.size());
            to.extend(begin.to_be_bytes());
            begin += variable.values.size() as u64;
        }
        to
    }
}

fn padded(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

fn number(to: &mut Vec<u8>, value: usize) {
    to.extend((value as u32).to_be_bytes());
}

fn word(to: &mut Vec<u8>, text: &str) {
    number(to, text.len());
    to.extend(padded(text.as_bytes().to_vec()));
}

/// Head of a list; one without members has no tag.
fn list(to: &mut Vec<u8>, tag: u32, members: usize) {
    number(to, if members == 0 { 0 } else { tag as usize });
    number(to, members);
}

fn notes(to: &mut Vec<u8>, all: &[(&'static str, String)]) {
    list(to, ATTRIBUTES, all.len());
    for (name, text) in all {
        let text = Values::Text(text.clone());
        word(to, name);
        number(to, text.kind() as usize);
        number(to, text.len());
        to.extend(text.bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes by the grammar of the specification: header, then values, each padded to four bytes.
    #[test]
    fn a_file_has_the_bytes_of_the_specification() {
        let file = Dataset {
            axes: vec![("x", 3)],
            notes: Vec::new(),
            variables: vec![
                Variable {
                    name: "name",
                    axes: vec![0],
                    notes: vec![("of", "abcde".into())],
                    values: Values::Text("xyz".into()),
                },
                Variable {
                    name: "v",
                    axes: vec![0],
                    notes: Vec::new(),
                    values: Values::Double(vec![1.0, -2.0, 0.5]),
                },
            ],
        };
        let int = |v: u32| v.to_be_bytes().to_vec();
        let text = |t: &[u8]| t.to_vec();
        let header = |name_at: u64| {
            [
                text(b"CDF\x02"),
                int(0),
                [int(10), int(1), int(1), text(b"x\0\0\0"), int(3)].concat(),
                [int(0), int(0)].concat(),
                [int(11), int(2)].concat(),
                [int(4), text(b"name"), int(1), int(0)].concat(),
                [
                    int(12),
                    int(1),
                    int(2),
                    text(b"of\0\0"),
                    int(2),
                    int(5),
                    text(b"abcde\0\0\0"),
                ]
                .concat(),
                [int(2), int(4), name_at.to_be_bytes().to_vec()].concat(),
                [int(1), text(b"v\0\0\0"), int(1), int(0), int(0), int(0)].concat(),
                [int(6), int(24), (name_at + 4).to_be_bytes().to_vec()].concat(),
            ]
            .concat()
        };
        let values: Vec<u8> = [1.0f64, -2.0, 0.5].iter().flat_map(|v| v.to_be_bytes()).collect();
        let expected = [header(header(0).len() as u64), text(b"xyz\0"), values].concat();
        assert_eq!(file.bytes(), expected);
    }
}
