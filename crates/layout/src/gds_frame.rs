//! The bytes of a GDSII library around its pillars, encoded by gds21.

use chrono::NaiveDateTime;
use gds21::{GdsDateTimes, GdsElement, GdsLibrary, GdsStruct, GdsUnits};

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
        let mut library = GdsLibrary::new(name);
        library.units = gds_units(unit);
        library.dates = GdsDateTimes {
            modified: date,
            accessed: date,
        };
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
        library.structs.push(GdsStruct {
            name: name.to_owned(),
            dates: self.empty.dates.clone(),
            elems: elements,
        });
        let bytes = encode(&library)?;
        let cell = &bytes[self.head().len()..bytes.len() - END];
        let (begin, end) = cell.split_at(cell.len() - END);
        Ok((begin.to_vec(), end.to_vec()))
    }
}

/// Database unit in user units of 1 um, and in metres.
pub fn gds_units(unit: DatabaseUnit) -> GdsUnits {
    match unit {
        DatabaseUnit::Nanometre => GdsUnits::new(1e-3, 1e-9),
        DatabaseUnit::Half => GdsUnits::new(0.5e-3, 0.5e-9),
        DatabaseUnit::Quarter => GdsUnits::new(0.25e-3, 0.25e-9),
        DatabaseUnit::Tenth => GdsUnits::new(1e-4, 1e-10),
    }
}

/// The date that the files of a design bear: its own, so that its bytes depend on nothing else.
pub(super) fn date(design: &Design) -> NaiveDateTime {
    let date = design.layout.timestamp.parse();
    date.expect("checked when the design was read")
}

pub(super) fn encode(library: &GdsLibrary) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    library.write(&mut bytes).map_err(encoding)?;
    Ok(bytes)
}
