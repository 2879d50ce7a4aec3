//! The dose matrix: nine blocks of equal geometry, one for each dose.

use std::path::Path;

use super::dose::doses;
use super::drawing::{Drawing, LayerPair, RectNm, Sheet, nm, number};
use super::pad::{PadPillar, dose_pads};
use super::process::Process;
use metalith_core::{Result, Silent};
use metalith_design::Design;
use metalith_design::array::{Class, PillarArray, Symmetry};
use metalith_design::phase::RadialPhase;
use metalith_layout::PillarForm;
use metalith_pillars::{DatabaseUnit, LatticeKind};

/// Space between the parts of a block (nm).
const APART: i64 = 20_000;
/// Height of the number of a block (nm).
const NUMERAL: i64 = 20_000;

/// Position of one dose.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub(super) struct DoseBlock {
    /// 1 to 9; also the datatype.
    pub number: usize,
    /// Centre of the small lens and of the row of pads (nm).
    #[serde(rename = "lens_nm")]
    pub lens: (i64, i64),
    #[serde(rename = "pads_nm")]
    pub pads: (i64, i64),
    #[serde(rename = "bounds_nm")]
    pub bounds: RectNm,
}

/// The blocks of a dose matrix with so many pads each, base dose in the middle of the file, each in the middle of a field of
/// its own: a dose is not to be judged across a seam.
pub(super) fn blocks(process: &Process, pads: usize) -> Vec<DoseBlock> {
    let size = Sizes::of(process, pads);
    let field = nm(process.writer.field_used_um);
    let fields = |length: i64| (length + size.gap).div_euclid(field) * field + field;
    let step = (fields(size.width), fields(size.height));
    (0..9)
        .map(|k| {
            // Row by row from the upper left, as one reads.
            let (column, row) = (k % 3 - 1, 1 - k / 3);
            let (x, y) = (column * step.0, row * step.1);
            let bounds = RectNm::at(x - size.width / 2, y - size.height / 2, size.width, size.height);
            DoseBlock {
                number: k as usize + 1,
                lens: (x, bounds.y1 - size.lens / 2),
                pads: (x, bounds.y0 + size.pad / 2),
                bounds,
            }
        })
        .collect()
}

struct Sizes {
    lens: i64,
    pad: i64,
    gap: i64,
    width: i64,
    height: i64,
}

impl Sizes {
    fn of(process: &Process, pads: usize) -> Self {
        let spec = &process.dose_matrix;
        let (lens, pad, gap) = (nm(spec.lens_diameter_um), nm(spec.pad_um), nm(spec.gap_um));
        let pads = pads as i64;
        let beside = lens + 2 * (APART + NUMERAL);
        Self {
            lens,
            pad,
            gap,
            width: even((pads * pad + (pads - 1) * APART).max(beside)),
            height: even(lens + APART + pad),
        }
    }
}

fn even(n: i64) -> i64 {
    n + n % 2
}

/// A small hyperbolic lens of the design's cell, mapping and F-number.
///
/// # Errors
/// If the user stopped it.
pub(super) fn small_lens(design: &Design, diameter_um: f64, wavelength_nm: f64) -> Result<Class> {
    let mut small = hyperbolic(design, wavelength_nm);
    let share = diameter_um / (2.0 * design.lens.radius_um());
    small.lens.outline = None;
    small.lens.diameter_nm = (diameter_um * 1e3).round() as u32;
    small.lens.focal_length_um = design.lens.focal_length_um * share;
    small.lens.phase = RadialPhase::Hyperbola {
        wavelength_um: wavelength_nm * 1e-3,
        focal_length_um: small.lens.focal_length_um,
    };
    let mut array = PillarArray::build(&small, &Silent)?;
    Ok(array.classes.swap_remove(0))
}

/// The design with one element, not steered, hyperbolic for a wavelength.
pub(super) fn hyperbolic(design: &Design, wavelength_nm: f64) -> Design {
    let mut single = design.clone();
    single.array = design.array.alone();
    single.lens.terms.clear();
    single.lens.along_y = None;
    single.lens.phase = RadialPhase::Hyperbola {
        wavelength_um: wavelength_nm * 1e-3,
        focal_length_um: design.lens.focal_length_um,
    };
    single
}

/// Write the dose matrix.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(path: &Path, design: &Design, process: &Process) -> Result<Vec<DoseBlock>> {
    let diameter_um = process.dose_matrix.lens_diameter_um;
    let lens = small_lens(design, diameter_um, process.reference_wavelength_nm(design))?;
    let pads = dose_pads(design, process);
    let content = BlockContent {
        piece: Piece::Lens(&lens, PillarForm::of(design)),
        pads: &pads,
        lattice: design.cell.lattice,
        pitch: i64::from(pad_pitch(design)),
        marks: number(&design.layout.layers.pillar_marks),
        label: number(&design.layout.layers.label),
    };
    draw(path, Drawing::of(design, "DOSE_MATRIX"), process, &content)
}

/// Content of each block.
pub(super) struct BlockContent<'a> {
    pub piece: Piece<'a>,
    pub pads: &'a [PadPillar],
    /// Lattice and pitch (nm) of the pads.
    pub lattice: LatticeKind,
    pub pitch: i64,
    pub marks: LayerPair,
    pub label: LayerPair,
}

/// Piece of what is exposed, above the pads of a block.
pub(super) enum Piece<'a> {
    /// A small lens.
    Lens(&'a Class, PillarForm),
    /// Outlines from the layout about the middle of the piece (database units).
    Polygons(&'a [Vec<(i64, i64)>]),
}

/// Draw nine blocks into a file.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn draw(
    path: &Path,
    mut drawing: Drawing,
    process: &Process,
    content: &BlockContent<'_>,
) -> Result<Vec<DoseBlock>> {
    let spec = &process.dose_matrix;
    let &BlockContent {
        pads,
        lattice,
        pitch,
        marks,
        label,
        ..
    } = content;
    let blocks = blocks(process, pads.len());
    let mut top = Sheet::new("DOSE_MATRIX");
    for (block, dose) in blocks.iter().zip(doses(process)) {
        let layer: LayerPair = (spec.layer, block.number as i16);
        let lens_name = format!("D{}_LENS", block.number);
        match content.piece {
            Piece::Lens(class, form) => drawing.add_lens(&lens_name, layer, class, form),
            Piece::Polygons(polygons) => drawing.add_polygons(&lens_name, layer, polygons),
        }
        top.place(&lens_name, block.lens, Symmetry::IDENTITY);
        let span = (nm(spec.pad_um) + APART) * (pads.len() as i64 - 1).max(0);
        for (k, pad) in pads.iter().enumerate() {
            let cell = format!("D{}_{}", block.number, pad.cell_name());
            drawing.add_pillar(&cell, layer, &pad.corners());
            let x = block.pads.0 - span / 2 + k as i64 * (nm(spec.pad_um) + APART);
            top_pad(&mut top, &cell, (x, block.pads.1), nm(spec.pad_um), lattice, pitch);
        }
        let left = block.lens.0 - nm(spec.lens_diameter_um) / 2 - APART - NUMERAL * 3 / 5;
        top.numerals(marks, (left, block.lens.1), NUMERAL, &block.number.to_string());
        top.text(
            label,
            (block.bounds.x0, block.bounds.y1),
            format!(
                "dose {} x {:.2} = {:.1} uC/cm2",
                block.number, dose.factor, dose.dose_uc_cm2
            ),
        );
    }
    drawing.add(top);
    drawing.write(path)?;
    Ok(blocks)
}

/// Pitch of pads: that of the design, to whole nanometres.
pub(super) fn pad_pitch(design: &Design) -> u32 {
    design.cell.pitch_nm.nm().round() as u32
}

/// Distance of two rows of a pad (nm).
pub(super) fn row_nm(kind: LatticeKind, pitch_nm: u32) -> i64 {
    kind.row_nm(pitch_nm.into(), DatabaseUnit::Nanometre) as i64
}

/// A square pad of pillars about a place, on a lattice of this kind. Of a hexagonal one every other row is an array, and a pillar
/// is in the middle.
pub(super) fn top_pad(sheet: &mut Sheet, pillar: &str, (x, y): (i64, i64), side: i64, kind: LatticeKind, pitch: i64) {
    let row = row_nm(kind, pitch as u32);
    let mut lines = |columns: i64, rows: i64, steps: [i64; 2]| {
        let first = [columns, rows].map(|n| -(n - 1));
        let at = (x + first[0] * steps[0] / 2, y + first[1] * steps[1] / 2);
        sheet.array(pillar, at, (columns as i16, rows as i16), steps);
    };
    match kind {
        LatticeKind::Square => {
            let n = (side / pitch).max(1);
            lines(n, n, [pitch; 2]);
        }
        LatticeKind::Hexagonal => {
            // As many pitches and rows as fit, half of one beyond the outermost pillars.
            let above = (side / row - 1).max(0) / 2;
            let steps = [pitch, 2 * row];
            lines(odd((side / pitch).max(1)), odd(above + 1), steps);
            let (columns, rows) = (side / pitch / 2 * 2, (above + 1) / 2 * 2);
            if columns > 0 && rows > 0 {
                lines(columns, rows, steps);
            }
        }
    }
}

/// The largest odd number up to this one, which is positive.
fn odd(n: i64) -> i64 {
    n - 1 + n % 2
}
