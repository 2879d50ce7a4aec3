//! Drawings in DXF as layouts in GDSII, which every reader of layouts then reads: blocks become cells, closed outlines polygons,
//! names of layers numbers.
//!
//! | question | file |
//! | --- | --- |
//! | how the text is read | `pairs`, `drawing` |
//! | what an entity draws | `shapes`, `curves`, `hatch` |
//! | which cells there are, and what they hold | `cells` |
//! | open lines that close an outline together | `join` |
//! | numbers of layers | `layers` |
//! | what is written | `records` |

mod affine;
mod cells;
mod curves;
mod drawing;
mod hatch;
mod join;
mod layers;
mod pairs;
mod records;
mod shapes;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::Path;

use tempfile::{NamedTempFile, TempPath};

use crate::error::{Error, LayoutError, Result};
use drawing::Drawing;
use layers::Layers;

/// Bytes at the beginning of a file that tell whether it is a drawing.
const BEGIN: u64 = 1 << 12;

/// Longest drawing that is read (bytes): two million pillars.
const LONGEST: u64 = 1 << 29;

/// Bytes of records that a short drawing may become, and how many more for each of its bytes: a large circle of 40 bytes has a thousand
/// corners.
const SHORT_DRAWING: u64 = 1 << 26;
const PER_BYTE: u64 = 32;

/// Half the size of the largest drawing of a chip (um): larger ones are not in the unit that they state.
const LARGEST_UM: f64 = 500_000.0;

/// Fault of a drawing at a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub line: u64,
    pub what: &'static str,
}

/// Reason why a drawing became no layout.
pub(super) enum Failure {
    Drawing(Fault),
    Io(std::io::Error),
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::Drawing(fault)
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

/// Result of reading a drawing.
#[derive(Clone, Debug, Default)]
pub(super) struct Remarks {
    /// Unit and layers, in words.
    pub taken: String,
    /// Version of the format, and the unit, in words.
    pub version: Option<String>,
    pub unit: String,
    /// Size of the drawing (bytes), unpacked.
    pub bytes: u64,
    /// True if the drawing was compressed by gzip.
    pub gzip: bool,
    /// What was left out by kind: how many, and the line of the first.
    pub left_out: BTreeMap<&'static str, (u64, u64)>,
}

impl Remarks {
    fn leave_out(&mut self, what: &'static str, line: u64) {
        self.left_out.entry(what).or_insert((0, line)).0 += 1;
    }

    /// The first fault of what was left out.
    pub(super) fn fault(&self) -> Option<LayoutError> {
        let (&what, &(_, line)) = self.left_out.iter().min_by_key(|(_, (_, line))| *line)?;
        Some(LayoutError::Drawing { line, what })
    }

    /// Texts for whoever waits.
    pub(super) fn texts(&self) -> impl Iterator<Item = String> {
        let left_out = self.left_out.iter().map(|(what, (count, line))| {
            if *count == 1 {
                format!("warning[layout/odd]: {what} were left out: 1, at line {line}")
            } else {
                format!("warning[layout/odd]: {what} were left out: {count}, the first at line {line}")
            }
        });
        std::iter::once(format!("note: {}", self.taken)).chain(left_out)
    }
}

/// True if a file that begins with these bytes is a drawing in the text form of DXF.
fn is_dxf(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut lines = text.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    // Pairs of a code and a value; comments have the code 999.
    loop {
        match (lines.next(), lines.next()) {
            (Some(b"999"), Some(_)) => {}
            (Some(b"0"), Some(b"SECTION")) => return true,
            _ => return false,
        }
    }
}

/// The layout in GDSII that a drawing is, in a temporary file that is removed with its path, and what was made of it; none if the file
/// at `read` is no drawing. `path` is its name in messages.
pub(super) fn unpacked(path: &Path, read: &Path) -> Result<Option<(TempPath, Remarks)>> {
    let mut file = File::open(read).map_err(Error::io("open", path))?;
    let mut first = Vec::new();
    let begun = (&mut file).take(BEGIN).read_to_end(&mut first);
    begun.map_err(Error::io("read", path))?;
    if !is_dxf(&first) {
        return Ok(None);
    }
    let fault = |cause| Error::Layout {
        path: path.to_owned(),
        offset: 0,
        cause,
    };
    let rest = file.take(LONGEST + 1).read_to_end(&mut first);
    rest.map_err(Error::io("read", path))?;
    if first.len() as u64 > LONGEST {
        return Err(fault(LayoutError::Unpacked { most: LONGEST }));
    }
    let mut out = BufWriter::new(NamedTempFile::new().map_err(Error::io("unpack", path))?);
    let remarks = to_gds(&first, &mut out).map_err(|failure| match failure {
        Failure::Drawing(Fault { line, what }) => fault(LayoutError::Drawing { line, what }),
        Failure::Io(error) => Error::io("unpack", path)(error),
    })?;
    let file = out
        .into_inner()
        .map_err(|e| Error::io("unpack", path)(e.into_error()))?;
    Ok(Some((file.into_temp_path(), remarks)))
}

/// Write a drawing as GDSII in nanometres.
fn to_gds(bytes: &[u8], out: impl Write) -> Result<Remarks, Failure> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let drawing = Drawing::read(bytes)?;
    let layers = Layers::of(drawing.layers.clone());
    let (unit_um, unit) = unit_of(&drawing);
    let mut remarks = Remarks {
        taken: format!("a drawing in DXF: {unit}; layers: {}", layers.words()),
        version: drawing.version.clone(),
        unit,
        bytes: bytes.len() as u64,
        ..Remarks::default()
    };
    cells::write(&drawing, &layers, 1e3 * unit_um, out, &mut remarks)?;
    Ok(remarks)
}

/// Unit of a drawing (um), and a word on why.
fn unit_of(drawing: &Drawing<'_>) -> (f64, String) {
    /// Units by the number of $INSUNITS.
    const UNITS: [(i32, &str, f64); 11] = [
        (1, "inch", 25_400.0),
        (2, "foot", 304_800.0),
        (4, "mm", 1e3),
        (5, "cm", 1e4),
        (6, "m", 1e6),
        (8, "microinch", 0.0254),
        (9, "mil", 25.4),
        (11, "angstrom", 1e-4),
        (12, "nm", 1e-3),
        (13, "um", 1.0),
        (14, "dm", 1e5),
    ];
    let stated = drawing.units.filter(|units| *units != 0);
    let found = stated.and_then(|units| UNITS.iter().find(|u| u.0 == units));
    match (stated, found) {
        (None, _) => (1.0, "a unit is taken as 1 um, as $INSUNITS states none".into()),
        (Some(units), None) => (
            1.0,
            format!("a unit is taken as 1 um, as $INSUNITS is {units}, which is no unit of layouts"),
        ),
        (_, Some((_, name, um))) if drawing.farthest * um > LARGEST_UM => (
            1.0,
            format!("a unit is taken as 1 um, as $INSUNITS states 1 {name}, in which it is larger than a wafer"),
        ),
        (_, Some((_, name, um))) => (*um, format!("a unit is 1 {name}, as $INSUNITS states")),
    }
}
