//! A layout from one format into the other, cell by cell, with its hierarchy.

mod to_gds;
mod to_oasis;

use std::path::Path;

use metalith_core::{Error, Progress, Result};
use metalith_gds::{FileFormat, Layout};

use super::{LayoutFormat, Written};

/// Write the layout that was read to `path` in a format: the same cells with the same content. Properties are left out,
/// and so are nodes of GDSII and private records of OASIS; paths with round ends or odd widths become polygons, circles
/// too. OASIS is written as it comes, whatever encoding of pillars is asked for: cells are copied, not made.
///
/// Both files are streamed; nothing is held but one block. GDSII has no lists of copies: a layout of more copies than are
/// read of a file of its size is not written in it.
///
/// # Errors
/// If the tree of cells has faults, if something does not fit the format, or if a file cannot be read or written; the
/// old file is then as it was.
pub fn convert(layout: &Layout, format: LayoutFormat, path: &Path, progress: &dyn Progress) -> Result<Written> {
    let tops: Vec<&str> = layout.tops().iter().map(|&t| layout.cells()[t].name.as_str()).collect();
    let bytes = match format {
        LayoutFormat::Gds => {
            // Lists of copies are written one by one.
            layout.copies_fit()?;
            to_gds::write(layout, path, progress)?
        }
        LayoutFormat::Oasis(_) => to_oasis::write(layout, &tops, path, progress)?,
    };
    let mut remarks = Vec::new();
    let with_properties: u64 = layout.cells().iter().map(|c| c.with_properties).sum();
    if with_properties > 0 {
        remarks.push(format!(
            "{with_properties} elements have properties, which are not written"
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
    Ok(Written {
        path: path.to_owned(),
        bytes,
        top_cell: tops.first().map_or_else(String::new, |&t| t.to_owned()),
        remarks,
        beside: Vec::new(),
    })
}

/// Characters of a cell name that every reader of GDSII takes.
const LONGEST_NAME: usize = 32;

/// Error for content that does not fit the format that is written.
fn does_not_fit(what: String, hint: &str) -> Error {
    Error::refused("convert/does-not-fit", what, hint)
}
