//! The hand-off of a layout of any program: it is handed over as it is, and what a writer asks of a layout is made from it. What
//! needs a design is left out by name.

mod contents;
mod page;
mod pillars;
mod places;
mod read;

pub use read::handoff_name;

pub(crate) use read::LayoutInputs;

use chrono::NaiveDateTime;

use self::contents::{FoundPillars, LayoutContents, LeftOut, LensPiece};
use self::pillars::{central, pads, sites, snapping};
use self::places::{LayoutPiece, Places};
use self::read::{DOSE_LABEL, DOSE_MARKS, Pattern};
use crate::contents::HandoffCheck;
use crate::dose::doses;
use crate::dose_matrix::{self, BlockContent, DoseBlock, Piece};
use crate::drawing::Drawing;
use crate::exposure::{exposure_of, is_of_dose_matrix, times};
use crate::job::JobPatterns;
use crate::layout_statistics::LayoutStatistics;
use crate::listing::Listing;
use crate::options::HandoffOptions;
use crate::rules::{self, Subject};
use crate::{documents, raith, write_fields};
use metalith_core::{LayerNumber, Progress, Result};
use metalith_gds::{Layout, ReadLimits};
use metalith_pillars::{DatabaseUnit, LatticeKind};
use metalith_report::{Verdict, count, counted, exact, write_json};

/// Write everything but the manifest.
///
/// # Errors
/// A file that cannot be read or written; no beam of the process gives its dose; the user stopped it.
pub(crate) fn fill(
    files: &mut Listing,
    inputs: &LayoutInputs,
    options: &HandoffOptions,
    progress: &dyn Progress,
) -> Result<Vec<HandoffCheck>> {
    let process = &inputs.lab.process;
    let handed = files.add(
        format!("layout/{}", inputs.file_name()),
        "layout of step 1, as it was received",
    );
    inputs.copy_to(&handed, progress)?;
    let mut statistics = inputs.statistics.clone();
    statistics.file = inputs.file_name();
    let exposed = |number: LayerNumber| inputs.exposed.contains(&number);
    let (mut exposure, bounds_um) = exposure_of(&statistics, exposed).expect("its layers have shapes");
    let sizes = (process.writer.field_used_um, process.proximity.range_um);
    let places = Places::of(&inputs.layout, &inputs.exposed, bounds_um, sizes, progress)?;
    exposure.fields = places.fields_um.len() as u64;
    let lens_piece = piece(inputs, places.fullest, progress)?;
    let (matrix, blocks) = matrix(files, inputs, &lens_piece, options, progress)?;
    let matrix_statistics = LayoutStatistics::of(&matrix, progress)?;
    let of_matrix = |number: LayerNumber| number == DOSE_MARKS || is_of_dose_matrix(number, process);
    let mut exposures = vec![(statistics.file.clone(), exposure, times(process, &exposure)?)];
    if let Some((mut exposure, bounds)) = exposure_of(&matrix_statistics, of_matrix) {
        exposure.fields = write_fields::of_bounds(bounds, process);
        exposures.push((matrix_statistics.file.clone(), exposure, times(process, &exposure)?));
    }
    let mut contents = LayoutContents {
        process,
        command: &options.command,
        source: "layout",
        layout: statistics.file.clone(),
        layout_digest: inputs.digest.clone(),
        top: statistics.top.clone(),
        exposed: inputs.exposed.iter().map(ToString::to_string).collect(),
        database_unit_nm: inputs.layout.unit_nm(),
        bounds_um,
        density: places.density,
        found: FoundPillars::of(&inputs.pattern),
        piece: LensPiece::of(&lens_piece, inputs.layout.unit_nm()),
        census: vec![statistics, matrix_statistics],
        exposures,
        snapping: snapping(&inputs.pattern, process)?,
        doses: doses(process),
        sites: sites(&inputs.pattern, process),
        blocks,
        left_out: LeftOut::of(&inputs.pattern, &inputs.waiting),
        checks: Vec::new(),
        rules: Vec::new(),
        files: Vec::new(),
        places,
    };
    write_tables(files, inputs, &contents)?;
    let base = |number: LayerNumber| exposed(number).then(|| raith::datatype(1.0));
    raith::write(files, process, &handed, "layout", base)?;
    let marks = [DOSE_MARKS];
    let of_matrix = raith::dose_matrix(process, &marks);
    raith::write(files, process, matrix.path(), "dose matrix", of_matrix)?;
    inputs.lab.keep(files)?;
    check(files, inputs, &matrix, &mut contents, progress)?;
    for (name, purpose) in [
        ("index.html", "this page: start here"),
        ("handoff.json", "all numbers of this page for programs"),
        ("chip.svg", "the layout with origin, elements and write fields"),
    ] {
        files.add(name, purpose);
    }
    contents.files = files.files.clone();
    page::write(&files.at(""), inputs, &contents)?;
    write_json(&files.at("handoff.json"), "handoff", &contents)?;
    Ok(contents.checks)
}

/// A piece of what is exposed: about the middle of the central element, or of the fullest window.
fn piece(inputs: &LayoutInputs, fullest: [f64; 2], progress: &dyn Progress) -> Result<LayoutPiece> {
    let per_nm = 1.0 / inputs.layout.unit_nm();
    let middle = match &inputs.pattern {
        Pattern::Pillars(found) => {
            let centre_nm = central(found).site.centre_nm.map(|nm| nm as f64);
            found.in_layout_nm(centre_nm).map(|nm| nm * per_nm)
        }
        Pattern::Shapes { .. } => fullest,
    };
    let edge_um = inputs.lab.process.dose_matrix.lens_diameter_um;
    LayoutPiece::of(&inputs.layout, &inputs.exposed, middle, edge_um, progress)
}

/// Write and open the dose matrix.
fn matrix(
    files: &mut Listing,
    inputs: &LayoutInputs,
    piece: &LayoutPiece,
    options: &HandoffOptions,
    progress: &dyn Progress,
) -> Result<(Layout, Vec<DoseBlock>)> {
    let (unit, polygons) = on_a_grid(piece, inputs.layout.unit_nm());
    let pads = pads(&inputs.pattern);
    let (lattice, pitch) = match &inputs.pattern {
        Pattern::Pillars(found) => {
            let lattice = central(found).site.lattice;
            (lattice.kind(), lattice.pitch_nm().nm().round() as i64)
        }
        Pattern::Shapes { .. } => (LatticeKind::Square, 1),
    };
    let content = BlockContent {
        piece: Piece::Polygons(&polygons),
        pads: &pads,
        lattice,
        pitch: pitch.max(1),
        marks: pair(DOSE_MARKS),
        label: pair(DOSE_LABEL),
    };
    let path = files.add(
        format!("dose/{}_dose_matrix.{}", inputs.name, options.format.extension()),
        "dose matrix for step 1: nine doses, datatype is the dose",
    );
    let drawing = Drawing::new("DOSE_MATRIX", unit, NaiveDateTime::default());
    let blocks = dose_matrix::draw(&path, drawing, &inputs.lab.process, &content)?;
    Ok((Layout::open_with(&path, ReadLimits::default(), progress)?, blocks))
}

fn pair(layer: LayerNumber) -> (i16, i16) {
    (layer.layer as i16, layer.datatype as i16)
}

/// The outlines of a piece on a grid that the dose matrix is drawn on: the grid of the layout, or where that is none of 1, 0.5,
/// 0.25 and 0.1 nm the nearest places of 0.1 nm.
fn on_a_grid(piece: &LayoutPiece, unit_nm: f64) -> (DatabaseUnit, Vec<Vec<(i64, i64)>>) {
    if let Some(unit) = DatabaseUnit::of_nm(unit_nm) {
        return (unit, piece.polygons.clone());
    }
    let unit = if unit_nm.fract() == 0.0 {
        DatabaseUnit::Nanometre
    } else {
        DatabaseUnit::Tenth
    };
    let scale = |v: i64| (v as f64 * unit_nm * unit.per_nm() as f64).round() as i64;
    let scaled = |polygon: &Vec<(i64, i64)>| polygon.iter().map(|&(x, y)| (scale(x), scale(y))).collect();
    (unit, piece.polygons.iter().map(scaled).collect())
}

fn write_tables(files: &mut Listing, inputs: &LayoutInputs, contents: &LayoutContents<'_>) -> Result<()> {
    let (process, shape) = (&inputs.lab.process, inputs.pattern.shape());
    let matrix = (&contents.doses[..], &contents.blocks[..]);
    documents::dose_tables(files, process, shape, matrix, &contents.exposures)?;
    if let Some(shape) = shape {
        documents::site_table(files, process, shape, &contents.sites)?;
    }
    documents::jobs(files, &patterns(inputs, contents), process, &[], &contents.snapping)
}

/// The patterns of the job.
fn patterns<'a>(inputs: &'a LayoutInputs, contents: &LayoutContents<'_>) -> JobPatterns<'a> {
    let middle = contents.middle_um();
    JobPatterns {
        name: &inputs.name,
        source: "layout",
        digest: inputs.digest.clone(),
        files: vec![inputs.name.clone(), format!("{}_dose_matrix", inputs.name)],
        middle_um: middle.iter().any(|um| *um != 0.0).then_some(middle),
    }
}

/// Hold the layout and the dose matrix to the rules of the process.
fn check(
    files: &mut Listing,
    inputs: &LayoutInputs,
    matrix: &Layout,
    contents: &mut LayoutContents<'_>,
    progress: &dyn Progress,
) -> Result<()> {
    let first = inputs.lab.first_step();
    let subjects = [
        Subject::of("layout", &inputs.layout, inputs.lab.deck(&first.pillar_rules)).recognising(inputs.exposed[0]),
        Subject::of("dose_matrix", matrix, inputs.lab.deck(&first.dose_rules)),
    ];
    let pitch_nm = match &inputs.pattern {
        Pattern::Pillars(found) => Some(central(found).site.lattice.pitch_nm().nm()),
        Pattern::Shapes { .. } => None,
    };
    let left_out = inputs.left_out.as_ref();
    let left_out = left_out.map_or_else(String::new, |left_out| format!("{}; ", left_out.words));
    let checked = rules::check(files, &subjects, &inputs.lab, pitch_nm, progress)?;
    contents.checks = vec![HandoffCheck {
        name: "pillars".into(),
        verdict: Verdict::of(inputs.left_out.as_ref().is_none_or(|left_out| !left_out.is_much)),
        words: match &inputs.pattern {
            Pattern::Pillars(found) => format!(
                "{}{} {} in {} were found; {} on layer {}{}",
                left_out,
                count(found.pillars),
                found.shape.plural(),
                counted(found.elements.len(), "element"),
                counted(found.oddities.total() as usize, "other shape"),
                inputs.exposed[0],
                found.oddities.listed.first().map_or_else(String::new, |first| format!(
                    " without a place to measure, such as one at ({}, {}) um: {}",
                    exact(first.centre_nm[0] * 1e-3),
                    exact(first.centre_nm[1] * 1e-3),
                    first.why.words()
                ))
            ),
            Pattern::Shapes { why } => {
                format!(
                    "{left_out}none were found: {why}; the shapes are exposed, and there are no pads and no places to measure"
                )
            }
        },
        report: None,
        broken: Vec::new(),
    }];
    contents.checks.extend(checked.checks);
    contents.rules = checked.reports;
    Ok(())
}
