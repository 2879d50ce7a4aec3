//! The bytes of a GDSII library around its pillars.

use chrono::{Datelike, NaiveDateTime, Timelike};
use metalith_gds::library::{GdsCell, GdsElement, GdsLibrary};

use super::encoding;
use metalith_core::Result;
use metalith_design::Design;
use metalith_pillars::DatabaseUnit;

/// Length of the records ENDSTR and ENDLIB.
const END: usize = 4;

/// Head and tail of a library, and cells cut so that more records fit before their end.
pub(super) struct LibraryFrame {
    empty: GdsLibrary,
    bytes: Vec<u8>,
}

impl LibraryFrame {
    /// An empty library of this name with a database unit: user unit 1 um, one date for everything.
    pub(crate) fn new(name: String, unit: DatabaseUnit, date: NaiveDateTime) -> Result<Self> {
        let library = GdsLibrary::new(name, gds_units(unit), gds_date(date));
        let bytes = encode(&library)?;
        Ok(Self { empty: library, bytes })
    }

    /// The records before the first cell.
    pub(crate) fn head(&self) -> &[u8] {
        &self.bytes[..self.bytes.len() - END]
    }

    /// The record after the last cell.
    pub(crate) fn tail(&self) -> &[u8] {
        &self.bytes[self.bytes.len() - END..]
    }

    /// A cell with these elements, cut before its end.
    pub(crate) fn cell(&self, name: &str, elements: Vec<GdsElement>) -> Result<(Vec<u8>, Vec<u8>)> {
        let mut library = self.empty.clone();
        library.cells.push(GdsCell {
            name: name.to_owned(),
            elements,
        });
        let bytes = encode(&library)?;
        let cell = &bytes[self.head().len()..bytes.len() - END];
        let (begin, end) = cell.split_at(cell.len() - END);
        Ok((begin.to_vec(), end.to_vec()))
    }
}

/// Database unit in user units of 1 um, and in metres.
pub fn gds_units(unit: DatabaseUnit) -> [f64; 2] {
    match unit {
        DatabaseUnit::Nanometre => [1e-3, 1e-9],
        DatabaseUnit::Half => [0.5e-3, 0.5e-9],
        DatabaseUnit::Quarter => [0.25e-3, 0.25e-9],
        DatabaseUnit::Tenth => [1e-4, 1e-10],
    }
}

/// A date as the format has it.
pub fn gds_date(date: NaiveDateTime) -> [i16; 6] {
    let [month, day, hour, minute, second] =
        [date.month(), date.day(), date.hour(), date.minute(), date.second()].map(|number| number as i16);
    [date.year() as i16, month, day, hour, minute, second]
}

/// The date that the files of a design bear: its own, so that its bytes depend on nothing else.
pub(super) fn date(design: &Design) -> NaiveDateTime {
    let date = design.layout.timestamp.parse();
    date.expect("checked when the design was read")
}

pub(super) fn encode(library: &GdsLibrary) -> Result<Vec<u8>> {
    library.encode().map_err(encoding)
}
