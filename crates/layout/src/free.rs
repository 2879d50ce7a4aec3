//! Layouts of pillars that no design describes.

use std::path::Path;

use chrono::NaiveDateTime;

use super::form::PillarForm;
use super::frame::LibraryFrame;
use super::{LayoutFormat, Written, convert, write_array};
use metalith_core::{Error, LayerNumber, PillarShape, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{Hierarchy, LayoutLayer};
use metalith_gds::{Layout, ReadLimits};

/// What a layout needs beside its pillars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeLayout<'a> {
    /// Name of the top cell: letters, digits and `_`.
    pub top: &'a str,
    /// Of the pillars.
    pub layer: LayerNumber,
    /// What the pillars are.
    pub shape: PillarShape,
}

/// Write an array of pillars alone, such as [`PillarArray::of_maps`] makes: no marks, no outline, no label. OASIS is made
/// of the GDSII file, which stands beside it while it is written.
///
/// # Errors
/// If the file cannot be written, or the user stopped it; the old file is then as it was.
pub fn write_free(
    free: &FreeLayout<'_>,
    array: &PillarArray,
    hierarchy: Hierarchy,
    format: LayoutFormat,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Written> {
    let frame = LibraryFrame::named(free.top.to_owned(), NaiveDateTime::default())?;
    let number = |n: u16| {
        let hint = format!("layers and datatypes go to {}", i16::MAX);
        i16::try_from(n).map_err(|_| Error::invalid(format!("there is no layer {}", free.layer), hint))
    };
    let layer = LayoutLayer {
        layer: number(free.layer.layer)?,
        datatype: number(free.layer.datatype)?,
        purpose: "pillars".into(),
    };
    let form = PillarForm::plain(free.shape);
    let write = |path: &Path| {
        write_array(
            &frame,
            free.top,
            &layer,
            form,
            Vec::new(),
            array,
            hierarchy,
            path,
            progress,
        )
    };
    if format == LayoutFormat::Gds {
        return write(path);
    }
    let beside = path.with_extension("oas.gds");
    write(&beside)?;
    let converted = Layout::open_with(&beside, ReadLimits::default(), progress)
        .map_err(Error::from)
        .and_then(|layout| convert(&layout, format, path, progress));
    let removed = std::fs::remove_file(&beside).map_err(Error::io("remove", &beside));
    let written = converted?;
    removed?;
    Ok(written)
}
