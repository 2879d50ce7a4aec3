//! From pillars to the bytes that a cleanroom writes: GDSII, streamed.
//!
//! gds21 builds and encodes the library, the cells, references, marks and labels; the pillars, of which
//! there are millions, are records of our own between the bytes that it made.

mod aperture;
mod frame;
mod mark;
mod pillars;
mod properties;

use std::path::{Path, PathBuf};

use gds21::GdsElement;

use frame::LibraryFrame;
use metalith_core::{Error, Progress, Result, WholeFile};
use metalith_design::array::PillarArray;
use metalith_design::{Design, Hierarchy, LayoutLayer};
use pillars::PillarWriter;

pub use properties::write_layer_properties;

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    pub path: PathBuf,
    pub bytes: u64,
    /// Name of its top cell.
    pub top_cell: String,
    /// What a person should know of how it was written, such as why nothing was folded.
    pub remarks: Vec<String>,
}

/// Write the pillar layout of a design: pillars, marks of the first step, chip outline and label.
///
/// The same design gives the same bytes on any number of threads; memory does not grow with the number
/// of pillars.
///
/// # Errors
/// If the file cannot be written, or the user stopped it; the old file is then as it was.
pub fn write_pillars(
    design: &Design,
    array: &PillarArray,
    hierarchy: Hierarchy,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Written> {
    let frame = LibraryFrame::new(design)?;
    let layers = &design.layout.layers;
    let mut fixed = mark::crosses(&design.layout.marks, &layers.pillar_marks);
    fixed.push(mark::outline(&design.layout.chip, &layers.outline));
    fixed.push(label(design, &layers.label));
    progress.begin("writing pillars", array.pillars());
    let mut writer = PillarWriter::create(path, &frame, &layers.pillars, progress)?;
    let mut remarks = Vec::new();
    match hierarchy {
        Hierarchy::Folded => {
            let folded = writer.folded(array)?;
            if array.placed.len() == array.classes.len() && array.placed.len() > 1 {
                remarks.push("no two elements are copies of one another: each is written by itself".into());
            }
            remarks.extend(folded);
        }
        Hierarchy::Sref => writer.referenced(array)?,
        Hierarchy::Flat => {}
    }
    let flat = (hierarchy == Hierarchy::Flat).then_some(array);
    let bytes = writer.finish(&top_cell(design), fixed, flat)?;
    Ok(Written {
        path: path.to_owned(),
        bytes,
        top_cell: top_cell(design),
        remarks,
    })
}

/// Write the aperture layout of a design: one flat cell of openings, marks of the second step and label.
///
/// # Errors
/// If the file cannot be written; the old file is then as it was.
pub fn write_apertures(design: &Design, path: &Path) -> Result<Written> {
    let frame = LibraryFrame::new(design)?;
    let layers = &design.layout.layers;
    let mut elements = aperture::openings(design);
    elements.extend(mark::crosses(&design.layout.marks, &layers.aperture_marks));
    elements.push(label(design, &layers.label));
    let (begin, end) = frame.cell(&top_cell(design), elements)?;
    let bytes = [frame.head(), &begin, &end, frame.tail()].concat();
    WholeFile::write(path, &bytes)?;
    Ok(Written {
        path: path.to_owned(),
        bytes: bytes.len() as u64,
        top_cell: top_cell(design),
        remarks: Vec::new(),
    })
}

/// The design's name as a cell name, in the characters that GDSII allows.
fn top_cell(design: &Design) -> String {
    design.name.replace('-', "_").to_ascii_uppercase()
}

/// Name and digest of the design, at the lower left of the chip.
fn label(design: &Design, layer: &LayoutLayer) -> GdsElement {
    let (x, y) = design.layout.chip.size_nm;
    let inset = x.min(y) / 50;
    gds21::GdsTextElem {
        string: format!("{} sha256:{}", design.name, design.digest()),
        layer: layer.layer,
        texttype: layer.datatype,
        xy: point(-x / 2 + inset, -y / 2 + inset),
        ..Default::default()
    }
    .into()
}

/// A point of the layout. Designs are limited to 300 mm, far inside the 2.1 m of a 32-bit nanometre.
fn point(x_nm: i64, y_nm: i64) -> gds21::GdsPoint {
    gds21::GdsPoint::new(coordinate(x_nm), coordinate(y_nm))
}

fn coordinate(nm: i64) -> i32 {
    i32::try_from(nm).expect("designs are limited to 300 mm")
}

/// A polygon; the first point is repeated at the end, as the format asks.
fn polygon(layer: &LayoutLayer, corners: &[(i64, i64)]) -> GdsElement {
    gds21::GdsBoundary {
        layer: layer.layer,
        datatype: layer.datatype,
        xy: corners.iter().chain(&corners[..1]).map(|&(x, y)| point(x, y)).collect(),
        ..Default::default()
    }
    .into()
}

/// What gds21 refuses to encode would be a mistake of ours; it is reported, not hidden.
fn encoding(error: impl std::fmt::Debug) -> Error {
    Error::invalid(
        format!("the layout cannot be encoded: {error:?}"),
        "please report this with the design file",
    )
}
