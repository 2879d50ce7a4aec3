//! Rows of pads and of lines to measure widths on.

use super::{APART, BESIDE, NUMERAL, StructureLayers, Structures, clear_of_borders};
use crate::dose_matrix::{pad_pitch, row_nm, top_pad};
use crate::drawing::{RectNm, Sheet, nm};
use crate::kind_words::KindWords;
use crate::pad::{DrawnSize, line_width, test_pads};
use crate::process::Process;
use metalith_design::Design;
use metalith_pillars::LatticeKind;

/// Lines of a dense CD group; odd, so that the middle one is as dense as lines get.
const LINES: i64 = 5;

/// Pitch of a pad with one pillar in so many pitches of the design (nm). Between sparse rows of a hexagonal lattice there is an even
/// number of nanometres, as shot steps are, and the pitch is as much wider.
fn pad_pitch_nm(kind: LatticeKind, pitch_nm: u32, sparse: i64) -> i64 {
    let wanted = pitch_nm * sparse as u32;
    let mut fitting = (wanted..).step_by(2).filter(|pitch| row_nm(kind, *pitch) % 2 == 0);
    let found = if sparse == 1 { None } else { fitting.next() };
    i64::from(found.unwrap_or(wanted))
}

impl Structures {
    /// A row of uniform pads, and the line along which to cleave through the dense ones.
    pub(super) fn pads(
        &mut self,
        design: &Design,
        process: &Process,
        layers: &StructureLayers,
        kind: &str,
        sparse: i64,
        y: i64,
    ) -> RectNm {
        let side = nm(process.tests.pad_um);
        let pitch = pad_pitch_nm(design.cell.lattice, pad_pitch(design), sparse);
        let cleave = sparse == 1;
        let KindWords { sizes, .. } = KindWords::of(design.cell.shape);
        // Room at the left for the dashes of the cleave line.
        let mut x = APART + side + APART;
        let mut row = RectNm::at(x, y, side, side);
        for pillar in test_pads(design, process) {
            let cell = self.pillar(pillar);
            x = clear_of_borders(x, side, nm(process.writer.field_used_um));
            let pad = RectNm::at(x, y, side, side);
            top_pad(&mut self.top, &cell, pad.centre(), side, design.cell.lattice, pitch);
            let words = pillar.digits();
            let numeral = pad.centre().0 - Sheet::numerals_width(NUMERAL, &words) / 2;
            self.top
                .numerals(layers.marks, (numeral, pad.y1 + BESIDE), NUMERAL, &words);
            self.step2.rectangle(layers.openings, pad.grown(BESIDE / 2));
            let bounds = RectNm::new(pad.x0, pad.y0, pad.x1, pad.y1 + BESIDE + NUMERAL);
            self.record(
                layers,
                format!("{}{words}", if cleave { "D" } else { "S" }),
                format!(
                    "uniform pillars of {}, {kind}, pitch {pitch} nm: transmission, {sizes}, height",
                    pillar.words()
                ),
                bounds,
                Some(pillar.drawn()),
            );
            row = row.united(&bounds);
            x = pad.x1 + APART;
        }
        if cleave {
            let middle = y + side / 2;
            for left in [APART, x] {
                // Five dashes, thin enough to aim by.
                for k in 0..5 {
                    let dash = RectNm::at(left + k * side / 5, middle - 1_000, side / 10, 2_000);
                    self.top.rectangle(layers.marks, dash);
                    row = row.united(&dash);
                }
            }
            let line = RectNm::new(APART, middle - 1_000, x + side, middle + 1_000);
            self.record(
                layers,
                "CLEAVE".into(),
                "line between the dashes: a cleave along it opens every dense pad for a cross-section",
                line,
                None,
            );
        }
        row
    }

    /// Lines for CD, dense and single: upright ones give the width along x, level ones along y.
    pub(super) fn cd_bars(
        &mut self,
        design: &Design,
        process: &Process,
        layers: &StructureLayers,
        upright: bool,
        y: i64,
    ) -> RectNm {
        let length = nm(process.tests.cd_length_um);
        let (axis, turned) = if upright { ("x", "upright") } else { ("y", "level") };
        let mut x = APART;
        let mut row = RectNm::at(x, y, 0, length);
        for &asked in &process.tests.cd_widths_nm {
            let width = line_width(design, asked);
            let across = if upright {
                2 * width * (LINES + 1) + 10_000
            } else {
                length
            };
            x = clear_of_borders(x, across, nm(process.writer.field_used_um));
            let bar = |at: i64| {
                if upright {
                    RectNm::at(x + at, y, width, length)
                } else {
                    RectNm::at(x, y + at, length, width)
                }
            };
            let mut bounds = bar(0);
            // Dense lines at equal line and space, then one line far from all others.
            let places = (0..LINES).map(|k| 2 * width * k);
            for at in places.chain([2 * width * LINES + 10_000]) {
                self.top.rectangle(layers.pillars, bar(at));
                bounds = bounds.united(&bar(at));
            }
            let words = format!("{}{width}", axis.to_ascii_uppercase());
            self.top
                .numerals(layers.marks, (bounds.x0, y + length + BESIDE), NUMERAL, &words);
            let label = RectNm::at(
                bounds.x0,
                y + length + BESIDE,
                Sheet::numerals_width(NUMERAL, &words),
                NUMERAL,
            );
            let bounds = bounds.united(&label);
            self.record(
                layers,
                format!("CD_{axis}_{width}"),
                format!("{turned} lines {width} nm wide, {LINES} at equal space and one single: width along {axis}"),
                bounds,
                Some(DrawnSize::width(width as u16)),
            );
            row = row.united(&bounds);
            x = bounds.x1 + APART;
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_pads_stand_on_the_shots() {
        for pitch in [350, 450, 700] {
            assert_eq!(pad_pitch_nm(LatticeKind::Square, pitch, 3), 3 * i64::from(pitch));
            assert_eq!(pad_pitch_nm(LatticeKind::Hexagonal, pitch, 1), i64::from(pitch));
            let sparse = pad_pitch_nm(LatticeKind::Hexagonal, pitch, 3) as u32;
            assert!((3 * pitch..3 * pitch + 10).contains(&sparse), "{sparse}");
            assert!(row_nm(LatticeKind::Hexagonal, sparse) % 2 == 0 && sparse.is_multiple_of(2));
        }
    }
}
