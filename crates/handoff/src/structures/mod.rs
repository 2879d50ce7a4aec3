//! Test structures: structures from which width, depth, overlay and stitching are measured.

use std::path::Path;

mod rows;
mod verniers;

use super::drawing::{Drawing, LayerPair, RectNm, Sheet, nm, number};
use super::pad::{DrawnSize, PadPillar};
use super::process::Process;
use metalith_core::Result;
use metalith_design::Design;

/// Space between structures (nm).
const APART: i64 = 40_000;
/// Height of the numbers beside structures (nm).
const NUMERAL: i64 = 15_000;
/// Space between a pad and its number (nm).
const BESIDE: i64 = 8_000;
/// Radius about the middle of the reference lens within which its phase is level (nm): a window of density and its
/// neighbours.
const LEVEL_REACH: i64 = 50_000;

/// A test structure and its use.
#[derive(Clone, Debug, serde::Serialize)]
pub(super) struct Structure {
    pub id: String,
    /// Description, and what is measured on it.
    pub purpose: String,
    /// Bounds on the chip of the test structures, whose lower left corner is the origin (nm).
    #[serde(rename = "bounds_nm")]
    pub bounds: RectNm,
    /// Size as drawn, where it is to be measured.
    #[serde(flatten)]
    pub drawn: Option<DrawnSize>,
    /// Rules that it breaks by intention, each with the reason.
    pub on_purpose: &'static [(&'static str, &'static str)],
}

/// Everything of the two files of test structures.
pub(super) struct Structures {
    pub list: Vec<Structure>,
    /// The frame, from the origin; fields begin at its lower left corner (nm).
    pub frame: RectNm,
    /// Place where borders of fields are crossed on purpose (nm).
    pub field_border: (i64, i64),
    /// Pillars that have their own cell.
    pillars: Vec<PadPillar>,
    top: Sheet,
    step2: Sheet,
}

struct StructureLayers {
    pillars: LayerPair,
    marks: LayerPair,
    openings: LayerPair,
    step2: LayerPair,
    outline: LayerPair,
    label: LayerPair,
}

impl Structures {
    /// Lay out all structures that the process asks for, in rows from below.
    pub(crate) fn new(design: &Design, process: &Process) -> Self {
        let all = &design.layout.layers;
        let layers = StructureLayers {
            pillars: number(&all.pillars),
            marks: number(&all.pillar_marks),
            openings: number(&all.apertures),
            step2: number(&all.aperture_marks),
            outline: number(&all.outline),
            label: number(&all.label),
        };
        let mut it = Self {
            list: Vec::new(),
            frame: RectNm::new(0, 0, 0, 0),
            field_border: (0, 0),
            pillars: Vec::new(),
            top: Sheet::new("TESTS"),
            step2: Sheet::new("TESTS_STEP2"),
        };
        let field = nm(process.writer.field_used_um);
        let mut y = APART;
        let mut right = 0;
        for (kind, sparse) in [("dense", 1), ("sparse", process.tests.sparse_pitches)] {
            y = clear_of_borders(y, nm(process.tests.pad_um), field);
            let row = it.pads(design, process, &layers, kind, sparse, y);
            right = right.max(row.x1);
            y = row.y1 + APART;
        }
        for across in [true, false] {
            y = clear_of_borders(y, nm(process.tests.cd_length_um), field);
            let row = it.cd_bars(design, process, &layers, across, y);
            right = right.max(row.x1);
            y = row.y1 + APART;
        }
        y = clear_of_borders(y, nm(process.tests.etch_pad_um), field);
        let row = it.large(design, process, &layers, y);
        right = right.max(row.x1);
        let top = it.field_verniers(process, &layers, right + APART).max(row.y1);
        right = it.field_border.0 + 2 * APART;
        it.frame = RectNm::new(0, 0, right, top + APART);
        it.top.rectangle(layers.outline, it.frame);
        it.step2.rectangle(layers.outline, it.frame);
        it
    }

    fn record(
        &mut self,
        layers: &StructureLayers,
        id: String,
        purpose: impl Into<String>,
        bounds: RectNm,
        drawn: Option<DrawnSize>,
    ) {
        self.top.text(layers.label, (bounds.x0, bounds.y1), id.clone());
        self.list.push(Structure {
            id,
            purpose: purpose.into(),
            bounds,
            drawn,
            on_purpose: &[],
        });
    }

    /// Rules that the structure recorded last breaks by intention.
    fn breaks(&mut self, on_purpose: &'static [(&'static str, &'static str)]) {
        if let Some(last) = self.list.last_mut() {
            last.on_purpose = on_purpose;
        }
    }

    /// The cell of a pillar.
    fn pillar(&mut self, pillar: PadPillar) -> String {
        let name = pillar.cell_name();
        if !self.pillars.iter().any(|known| known.cell_name() == name) {
            self.pillars.push(pillar);
        }
        name
    }

    /// Write both files.
    ///
    /// # Errors
    /// If one cannot be written.
    pub(crate) fn write(self, design: &Design, pillars: &Path, step2: &Path) -> Result<Vec<Structure>> {
        let mut drawing = Drawing::of(design, "TESTS");
        for pillar in &self.pillars {
            let layer = number(&design.layout.layers.pillars);
            drawing.add_pillar(&pillar.cell_name(), layer, &pillar.corners());
        }
        drawing.add(self.top);
        drawing.write(pillars)?;
        let mut drawing = Drawing::of(design, "TESTS_STEP2");
        drawing.add(self.step2);
        drawing.write(step2)?;
        Ok(self.list)
    }
}

/// The middle of the hyperbolic reference lens, which is a separate file with its origin there.
pub(super) fn middle_of_reference() -> Structure {
    const LEVEL: &str = "the phase of a hyperbola is level in its middle, and so all pillars there are about as wide";
    Structure {
        id: "REFERENCE".into(),
        purpose: "hyperbolic lens to compare the elements with".into(),
        bounds: RectNm::new(-LEVEL_REACH, -LEVEL_REACH, LEVEL_REACH, LEVEL_REACH),
        drawn: None,
        on_purpose: &[("fill", LEVEL), ("fill_gradient", LEVEL)],
    }
}

/// The next place at which something of this size is not cut by a border of fields, if it fits into one.
fn clear_of_borders(at: i64, size: i64, field: i64) -> i64 {
    let cut = at.div_euclid(field) != (at + size).div_euclid(field);
    if cut && size + BESIDE < field {
        (at.div_euclid(field) + 1) * field + BESIDE
    } else {
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_into_a_field_is_not_cut() {
        for at in (0..1_000_000).step_by(7_919) {
            let x = clear_of_borders(at, 100_000, 499_800);
            assert!(x >= at && x / 499_800 == (x + 100_000) / 499_800, "{at} -> {x}");
        }
        assert_eq!(clear_of_borders(30, 600_000, 499_800), 30);
    }
}
