//! Layouts of pillars that no design describes.

use std::path::Path;

use chrono::NaiveDateTime;

use super::fixed_shapes::FixedShapes;
use super::pillar_form::PillarForm;
use super::{LayoutFormat, PiecesOf, PillarLayout, Written};
use metalith_core::{Error, LayerNumber, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{Hierarchy, LayoutLayer};
use metalith_pillars::PillarShape;

/// Contents of a layout other than its pillars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeLayout<'a> {
    /// Name of the top cell: letters, digits and `_`.
    pub top: &'a str,
    /// Layer of the pillars.
    pub layer: LayerNumber,
    /// Shape of the pillars.
    pub shape: PillarShape,
}

/// Write an array of pillars alone, such as [`PillarArray::of_maps`] makes: no marks, no outline, no label.
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
    if !free.shape.has_width() && array.shape != free.shape {
        return Err(Error::refused(
            "layout/rectangles-without-design",
            "rectangles cannot be written without a design",
            "write squares or circles, or give a design with `shape = \"rectangle\"` or `\"upright_rectangle\"`",
        ));
    }
    let number = |n: u16| {
        let hint = format!("layers and datatypes go to {}", i16::MAX);
        i16::try_from(n).map_err(|_| {
            Error::refused(
                "layout/unknown-layer",
                format!("there is no layer {}", free.layer),
                hint,
            )
        })
    };
    let layer = LayoutLayer {
        layer: number(free.layer.layer)?,
        datatype: number(free.layer.datatype)?,
        purpose: "pillars".into(),
    };
    let layout = PillarLayout {
        top: free.top.to_owned(),
        date: NaiveDateTime::default(),
        layer: &layer,
        form: PillarForm::plain(free.shape).on_grid(array.lattice.unit()),
        fixed: FixedShapes::default(),
    };
    layout.write(array, hierarchy, (format, PiecesOf::None), path, progress)
}
