//! The layouts of the hand-off: written, and then read once from their bytes for everything that looks at them.

use std::path::PathBuf;

use super::dose_matrix::{self, DoseBlock};
use super::drawing::RectNm;
use super::inputs::Sources;
use super::layout_statistics::LayoutStatistics;
use super::listing::Listing;
use super::process::Process;
use super::structures::{Structure, Structures};
use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_gds::{Layout, ReadLimits};
use metalith_layout::{LayoutFormat, write_apertures_as, write_layer_properties, write_pillars_as};
use metalith_verify::compensate::compensate;

/// The files that were written.
pub(super) struct Layouts {
    pub array: PillarArray,
    /// The design with one hyperbolic lens on a separate chip, and its pillars.
    pub reference: Design,
    pub reference_array: PillarArray,
    pub blocks: Vec<DoseBlock>,
    pub structures: Vec<Structure>,
    /// Frame of the test structures, and where they cross borders of fields on purpose (nm).
    pub tests_frame: (RectNm, (i64, i64)),
    pub paths: OfEach<PathBuf>,
}

/// One for each layout.
pub(super) struct OfEach<T> {
    pub pillars: T,
    pub apertures: T,
    pub dose_matrix: T,
    pub tests: T,
    pub test_openings: T,
    pub reference: T,
    pub reference_openings: T,
}

impl OfEach<PathBuf> {
    /// Go through each file once.
    ///
    /// # Errors
    /// If one cannot be read, or the user stopped it.
    pub(crate) fn open(&self, progress: &dyn Progress) -> Result<OfEach<Layout>> {
        let open = |path: &PathBuf| Layout::open_with(path, ReadLimits::default(), progress);
        Ok(OfEach {
            pillars: open(&self.pillars)?,
            apertures: open(&self.apertures)?,
            dose_matrix: open(&self.dose_matrix)?,
            tests: open(&self.tests)?,
            test_openings: open(&self.test_openings)?,
            reference: open(&self.reference)?,
            reference_openings: open(&self.reference_openings)?,
        })
    }
}

impl OfEach<Layout> {
    /// Count the content of the files that the front page lists.
    ///
    /// # Errors
    /// If one cannot be read, or the user stopped it.
    pub(crate) fn census(&self, progress: &dyn Progress) -> Result<Vec<LayoutStatistics>> {
        [
            &self.pillars,
            &self.apertures,
            &self.dose_matrix,
            &self.tests,
            &self.test_openings,
            &self.reference,
        ]
        .into_iter()
        .map(|layout| LayoutStatistics::of(layout, progress))
        .collect()
    }
}

/// Write all layouts.
///
/// # Errors
/// If one cannot be written, or the user stopped it.
pub(super) fn write(
    files: &mut Listing,
    sources: &Sources,
    format: LayoutFormat,
    progress: &dyn Progress,
) -> Result<Layouts> {
    let (design, process) = (&sources.design, &sources.lab.process);
    let named = |folder: &str, rest: &str| format!("{folder}/{}_{rest}.{}", design.name, format.extension());
    let mut array = PillarArray::build(design, progress)?;
    if let Some(model) = &sources.model {
        array = compensate(design, &array, model, progress)?.array;
    }
    let pillars = files.add(named("layout", "pillars"), "layout of step 1: pillars and marks");
    write_pillars_as(design, &array, design.layout.hierarchy, format, &pillars, progress)?;
    let apertures = files.add(
        named("layout", "apertures"),
        "layout of step 2: openings in the metal and marks, flat",
    );
    write_apertures_as(design, format, &apertures)?;
    let properties = files.add(
        format!("layout/{}.lyp", design.name),
        "layer names and colours for KLayout",
    );
    write_layer_properties(design, &properties)?;

    let dose_matrix = files.add(
        named("dose", "dose_matrix"),
        "dose matrix for step 1: nine doses, datatype is the dose",
    );
    let blocks = dose_matrix::write(&dose_matrix, design, process)?;
    let structures = Structures::new(design, process);
    let tests_frame = (structures.frame, structures.field_border);
    let tests = files.add(named("tests", "tests_pillars"), "test structures of step 1");
    let test_openings = files.add(named("tests", "tests_apertures"), "test structures of step 2, flat");
    let structures = structures.write(design, &tests, &test_openings)?;

    let reference = reference_design(design, process);
    let reference_array = PillarArray::build(&reference, progress)?;
    let reference_pillars = files.add(named("tests", "reference_pillars"), "hyperbolic reference lens, step 1");
    write_pillars_as(
        &reference,
        &reference_array,
        reference.layout.hierarchy,
        format,
        &reference_pillars,
        progress,
    )?;
    let reference_openings = files.add(
        named("tests", "reference_apertures"),
        "hyperbolic reference lens, step 2",
    );
    write_apertures_as(&reference, format, &reference_openings)?;
    Ok(Layouts {
        array,
        reference,
        reference_array,
        blocks,
        structures,
        tests_frame,
        paths: OfEach {
            pillars,
            apertures,
            dose_matrix,
            tests,
            test_openings,
            reference: reference_pillars,
            reference_openings,
        },
    })
}

/// Distance from the opening over the reference lens to the edge of its chip (nm): rule decks require a margin there.
const BESIDE_REFERENCE: i64 = 50_000;

/// The design with one hyperbolic lens on a separate chip, at full size.
fn reference_design(design: &Design, process: &Process) -> Design {
    let mut reference = dose_matrix::hyperbolic(design, process.reference_wavelength_nm(design));
    reference.name = "reference_lens".into();
    reference.title = "Hyperbolic reference lens".into();
    reference.layout.marks.clear();
    let room = i64::from(design.lens.diameter_nm) + 2 * (design.layout.apertures.margin_nm + BESIDE_REFERENCE);
    let room = room + room % 2;
    reference.layout.chip.size_nm = (room, room);
    reference
}
