//! Layouts: pillars written as the bytes that a cleanroom takes, GDSII or OASIS, streamed, and read back as the pillars
//! of a design.
//!
//! [`metalith_gds::library`] encodes for GDSII the library, the cells, references, marks and labels; the pillars, of which
//! there are millions, are records of templates between the bytes that it made. In OASIS all is written by
//! [`metalith_oasis`].

mod aperture;
mod convert;
mod fixed_shapes;
mod format;
mod free_layout;
mod gds_frame;
mod layer_properties;
mod mark;
mod oasis;
mod pillar_form;
mod pillars;
mod read;

use std::path::{Path, PathBuf};

use chrono::NaiveDateTime;

use fixed_shapes::FixedShapes;
use gds_frame::LibraryFrame;
use metalith_core::{AtomicFile, Error, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{Design, Hierarchy, LayoutLayer};
use metalith_gds::library::GdsElement;
use oasis::PiecesOf;
use pillars::PillarWriter;

pub use convert::convert;
pub use format::{LayoutFormat, OasisEncoding};
pub use free_layout::{FreeLayout, write_free};
pub use gds_frame::{gds_date, gds_units};
pub use layer_properties::write_layer_properties;
pub use oasis::{KeptPieces, PieceShard};
pub use pillar_form::PillarForm;
pub use pillars::orientation;
pub use read::{extraction_plan, read_pillars};

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    pub path: PathBuf,
    pub bytes: u64,
    /// Name of its top cell.
    pub top_cell: String,
    /// Remarks for people on how it was written, such as why nothing was folded.
    pub remarks: Vec<String>,
    /// Further files that belong to it: one for each further layer, where a file may have one only.
    pub beside: Vec<PathBuf>,
}

/// Write the pillar layout of a design as GDSII: pillars, marks of the first step, chip outline and label.
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
    write_pillars_as(design, array, hierarchy, LayoutFormat::Gds, path, progress)
}

/// Write the pillar layout of a design in a format. In the plain encoding of OASIS each further layer has a file of its
/// own beside it, with its numbers in the name.
///
/// # Errors
/// As [`write_pillars`].
pub fn write_pillars_as(
    design: &Design,
    array: &PillarArray,
    hierarchy: Hierarchy,
    format: LayoutFormat,
    path: &Path,
    progress: &dyn Progress,
) -> Result<Written> {
    PillarLayout::of(design).write(array, hierarchy, (format, PiecesOf::None), path, progress)
}

/// Variant of [`write_pillars_as`] in OASIS that takes the pieces of the file that are kept, and keeps all others: a run that was
/// stopped goes on, to the same bytes.
///
/// # Errors
/// As [`write_pillars`], and if a piece cannot be kept.
pub fn write_pillars_by_pieces(
    design: &Design,
    array: &PillarArray,
    hierarchy: Hierarchy,
    encoding: OasisEncoding,
    (path, kept): (&Path, &KeptPieces),
    progress: &dyn Progress,
) -> Result<Written> {
    let format = (LayoutFormat::Oasis(encoding), PiecesOf::All(kept));
    PillarLayout::of(design).write(array, hierarchy, format, path, progress)
}

/// Make a shard of the pieces of a layout in OASIS, and keep them: several machines make one file.
///
/// # Errors
/// If a piece cannot be kept, or the user stopped it; the pieces that were made stay.
pub fn make_pieces(
    design: &Design,
    array: &PillarArray,
    hierarchy: Hierarchy,
    encoding: OasisEncoding,
    (kept, shard): (&KeptPieces, PieceShard),
    progress: &dyn Progress,
) -> Result<()> {
    progress.begin("writing pieces", pillars_in_file(array, hierarchy) / shard.of as u64);
    oasis::make_pieces(
        &PillarLayout::of(design),
        array,
        hierarchy,
        encoding,
        (kept, shard),
        progress,
    )
}

/// Write the aperture layout of a design in a format: one flat cell of openings, marks of the second step and label; in
/// the plain encoding of OASIS a file for each layer.
///
/// # Errors
/// As [`write_apertures`].
pub fn write_apertures_as(design: &Design, format: LayoutFormat, path: &Path) -> Result<Written> {
    match format {
        LayoutFormat::Gds => write_apertures(design, path),
        LayoutFormat::Oasis(encoding) => oasis::write_apertures(design, encoding, path),
    }
}

/// Form in which an array of pillars is written, in any format.
struct PillarLayout<'a> {
    /// Name of the top cell.
    top: String,
    /// Date of all cells, where the format has a date.
    date: NaiveDateTime,
    layer: &'a LayoutLayer,
    form: PillarForm,
    /// Shapes of the top cell other than the pillars.
    fixed: FixedShapes<'a>,
}

impl<'a> PillarLayout<'a> {
    fn of(design: &'a Design) -> Self {
        Self {
            top: top_cell(design),
            date: gds_frame::date(design),
            layer: &design.layout.layers.pillars,
            form: PillarForm::of(design),
            fixed: FixedShapes::of_pillars(design),
        }
    }

    fn write(
        &self,
        array: &PillarArray,
        hierarchy: Hierarchy,
        (format, pieces): (LayoutFormat, PiecesOf<'_>),
        path: &Path,
        progress: &dyn Progress,
    ) -> Result<Written> {
        progress.begin("writing pillars", pillars_in_file(array, hierarchy));
        match format {
            LayoutFormat::Gds => self.write_gds(array, hierarchy, path, progress),
            LayoutFormat::Oasis(encoding) => {
                oasis::write_pillars(self, array, hierarchy, (encoding, pieces), path, progress)
            }
        }
    }

    fn write_gds(
        &self,
        array: &PillarArray,
        hierarchy: Hierarchy,
        path: &Path,
        progress: &dyn Progress,
    ) -> Result<Written> {
        let frame = LibraryFrame::new(self.top.clone(), self.form.unit(), self.date)?;
        let mut writer = PillarWriter::create(path, &frame, self.layer, self.form, progress)?;
        let mut remarks = Vec::new();
        match hierarchy {
            Hierarchy::Folded => {
                let folded = writer.folded(array)?;
                remarks.extend(no_copies(array));
                remarks.extend(folded);
            }
            Hierarchy::Sref => writer.referenced(array)?,
            Hierarchy::Flat => {}
        }
        let flat = (hierarchy == Hierarchy::Flat).then_some(array);
        let bytes = writer.finish(&self.top, self.fixed.gds(), flat)?;
        Ok(Written {
            path: path.to_owned(),
            bytes,
            top_cell: self.top.clone(),
            remarks,
            beside: Vec::new(),
        })
    }
}

/// Pillars that a layout of this hierarchy has records of: folded layouts have those alone that symmetry leaves unique.
fn pillars_in_file(array: &PillarArray, hierarchy: Hierarchy) -> u64 {
    if hierarchy != Hierarchy::Folded {
        return array.pillars();
    }
    let parts = array.classes.iter().flat_map(|class| class.group.domain(&class.widths));
    parts.map(|part| part.pillars).sum()
}

/// Remark for people if nothing could be copied.
fn no_copies(array: &PillarArray) -> Option<String> {
    (array.placed.len() == array.classes.len() && array.placed.len() > 1)
        .then(|| "no two elements are copies of one another: each is written by itself".into())
}

/// Remark for people on a class that has no symmetry.
fn no_symmetry(array: &PillarArray, class: usize) -> Option<String> {
    let first = array.first_of(class)?;
    (array.classes[class].group.members().len() == 1).then(|| {
        format!(
            "element {} has no symmetry: all its pillars are written",
            first.element.label()
        )
    })
}

/// Write the aperture layout of a design as GDSII: one flat cell of openings, marks of the second step and label.
///
/// # Errors
/// If the file cannot be written; the old file is then as it was.
pub fn write_apertures(design: &Design, path: &Path) -> Result<Written> {
    let frame = LibraryFrame::new(top_cell(design), design.cell.database_unit, gds_frame::date(design))?;
    let (begin, end) = frame.cell(&top_cell(design), FixedShapes::of_apertures(design).gds())?;
    let bytes = [frame.head(), &begin, &end, frame.tail()].concat();
    AtomicFile::write(path, &bytes)?;
    Ok(Written {
        path: path.to_owned(),
        bytes: bytes.len() as u64,
        top_cell: top_cell(design),
        remarks: Vec::new(),
        beside: Vec::new(),
    })
}

/// The design's name as a cell name, in the characters that GDSII allows, and none that a cell below it may have.
fn top_cell(design: &Design) -> String {
    let name = design.name.replace('-', "_").to_ascii_uppercase();
    if is_of_a_part(&name) { name + "_TOP" } else { name }
}

/// True if a cell of an element, of its parts or of its pillars may have this name: `E0`, `LENS0`, `LENS0_A`, `W120`,
/// `R17`.
fn is_of_a_part(name: &str) -> bool {
    let lens = name.strip_prefix("LENS").map(|rest| match rest.split_once('_') {
        Some((number, letter)) if letter.len() == 1 => number,
        _ => rest,
    });
    let others = ["E", "W", "R"].into_iter().filter_map(|kind| name.strip_prefix(kind));
    let mut numbers = lens.into_iter().chain(others);
    numbers.any(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}

/// A point of the layout in database units. Designs are limited to 300 mm about the origin, inside the 429 mm of 32 bits of
/// 0.1 nm.
fn point(x: i64, y: i64) -> [i32; 2] {
    [coordinate(x), coordinate(y)]
}

fn coordinate(units: i64) -> i32 {
    i32::try_from(units).expect("designs are limited to 300 mm")
}

/// A polygon; the first point is repeated at the end, as the format asks.
fn polygon(layer: &LayoutLayer, corners: &[(i64, i64)]) -> GdsElement {
    GdsElement::Polygon {
        layer: layer.number(),
        corners: corners.iter().chain(&corners[..1]).map(|&(x, y)| point(x, y)).collect(),
    }
}

/// Error for what has no record: a mistake of this program, which is reported, not hidden.
fn encoding(error: impl std::fmt::Debug) -> Error {
    Error::refused(
        "layout/encoding-failed",
        format!("the layout cannot be encoded: {error:?}"),
        "please report this with the design file",
    )
}
