//! A layout from one format into the other, cell by cell, with its hierarchy.

mod cut;
mod output;
mod to_gds;
mod to_oasis;

use std::path::Path;

use metalith_core::text::{counted, printable, printable_bytes};
use metalith_core::{Error, Progress, Result};
use metalith_gds::{FileFormat, Layout};

use super::{LayoutFormat, Written};

/// Write the layout that was read to `path` in a format: the same cells with the same content, compressed if the name
/// ends in `.gz`. Properties are left out, and so are nodes of GDSII and private records of OASIS; paths with round ends
/// or odd widths become polygons, circles too. OASIS is written as it comes, whatever encoding of pillars is asked for:
/// cells are copied, not made. References to cells that are not in the file are kept; bytes of names and texts are too,
/// and OASIS, which has printable ASCII only, holds others as `\x` and two digits. The notes of KLayout are kept from
/// GDSII to GDSII.
///
/// Both files are streamed; nothing is held but one block. GDSII has no lists of copies: a layout of more copies than are
/// read of a file of its size is not written in it.
///
/// # Errors
/// If references lead round in a circle or two cells have one name, if something does not fit the format, or if a file
/// cannot be read or written; the old file is then as it was.
pub fn convert(layout: &Layout, format: LayoutFormat, path: &Path, progress: &dyn Progress) -> Result<Written> {
    let mut changes = Changes::default();
    let bytes = match format {
        LayoutFormat::Gds => {
            // Lists of copies are written one by one.
            layout.copies_fit()?;
            to_gds::write(layout, path, &mut changes, progress)?
        }
        LayoutFormat::Oasis(_) => to_oasis::write(layout, path, &mut changes, progress)?,
    };
    let bytes = if crate::format::is_gzip(path) {
        std::fs::metadata(path).map_err(Error::io("read", path))?.len()
    } else {
        bytes
    };
    let mut remarks = changes.remarks();
    let with_properties: u64 = layout.cells().iter().map(|c| c.with_properties).sum();
    if with_properties > 0 {
        let elements = counted(with_properties as usize, "element");
        remarks.push(format!("{elements} with properties, which are not written"));
    }
    if layout.has_notes() && (layout.format() == FileFormat::Oasis || format != LayoutFormat::Gds) {
        remarks.push("the notes in cell $$$CONTEXT_INFO$$$ are no layout and are not written in OASIS".into());
    }
    if format != LayoutFormat::Gds && !(layout.library().is_empty() || layout.is_drawing()) {
        let name = printable(layout.library());
        remarks.push(format!(
            "the name of the library, {name}, is not written: OASIS has no place for it"
        ));
    }
    let missing = layout.dangling();
    if let Some(first) = missing.first() {
        let (cell, name) = (&first.cell, &first.name);
        let count = counted(missing.len(), "reference");
        remarks.push(format!(
            "{count} to cells that are not in the file, such as from {cell} to {name}: kept"
        ));
    }
    if layout.format() == FileFormat::Oasis && format == LayoutFormat::Gds {
        remarks.extend(layout.cells().iter().find(|c| c.name.len() > LONGEST_NAME).map(|c| {
            format!(
                "some names are longer than {LONGEST_NAME} characters, such as {}",
                c.name
            )
        }));
    }
    let top = layout.tops().first().map(|&t| layout.cells()[t].name.clone());
    Ok(Written {
        path: path.to_owned(),
        bytes,
        top_cell: top.unwrap_or_default(),
        remarks,
        beside: Vec::new(),
    })
}

/// Characters of a cell name that every reader of GDSII takes.
const LONGEST_NAME: usize = 32;

/// Changes that a format asked for.
#[derive(Default)]
struct Changes {
    /// Outlines that were cut, the points of the largest, and the parts of all.
    outlines: u64,
    most_points: usize,
    parts: usize,
    /// Names and texts that were escaped, and the first of them.
    strings: u64,
    first: Option<String>,
}

impl Changes {
    fn cut(&mut self, points: usize, parts: usize) {
        self.outlines += 1;
        self.most_points = self.most_points.max(points);
        self.parts += parts;
    }

    fn escape(&mut self, string: &[u8]) {
        self.strings += 1;
        self.first.get_or_insert_with(|| printable_bytes(string));
    }

    fn remarks(&self) -> Vec<String> {
        let cut = (self.outlines > 0).then(|| {
            format!(
                "{} of up to {} points cut along lines into {}: GDSII has 8191 points an outline",
                counted(self.outlines as usize, "outline"),
                self.most_points,
                counted(self.parts, "part")
            )
        });
        let escaped = self.first.as_ref().map(|first| {
            format!(
                "{} with bytes that OASIS has not, such as \"{first}\": each byte was written as \\x and two hexadecimal \
                 digits, and is read back as the byte",
                counted(self.strings as usize, "name or text").replace("name or texts", "names and texts")
            )
        });
        cut.into_iter().chain(escaped).collect()
    }
}

/// Error for content that does not fit the format that is written.
fn does_not_fit(what: String, hint: &str) -> Error {
    Error::refused("convert/does-not-fit", what, hint)
}
