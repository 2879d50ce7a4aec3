//! Test structures: what tells width, depth, overlay and stitching apart from everything else.

use std::path::Path;

use super::drawing::{Drawing, LayerNumber, Rect, Sheet, nm, number};
use super::matrix::{legal_width, top_pad};
use super::process::Process;
use metalith_core::Result;
use metalith_design::Design;

/// Room between structures [nm].
const APART: i64 = 40_000;
/// Height of the numbers beside structures [nm].
const NUMERAL: i64 = 15_000;
/// Room between a pad and its number [nm].
const BESIDE: i64 = 8_000;
/// Lines of a dense CD group; odd, so that the middle one is as dense as lines get.
const LINES: i64 = 5;
/// How far from the middle of the reference lens its phase is level [nm]: a window of density and its neighbours.
const LEVEL_REACH: i64 = 50_000;
/// Bars of a vernier on each side of its middle.
const BARS: i64 = 10;

/// A structure and what to do with it.
#[derive(Clone, Debug, serde::Serialize)]
pub(super) struct Structure {
    pub id: String,
    /// What it is and what it tells.
    pub purpose: String,
    /// On the chip of the test structures, whose lower left corner is the origin [nm].
    #[serde(rename = "bounds_nm")]
    pub bounds: Rect,
    /// Width drawn, where one is to be measured [nm].
    pub width_nm: Option<i64>,
    /// Checks that it breaks because it is what it is, each with the reason.
    pub on_purpose: &'static [(&'static str, &'static str)],
}

/// Everything of the two files of test structures.
pub(super) struct Structures {
    pub list: Vec<Structure>,
    /// The frame, from the origin; fields begin at its lower left corner [nm].
    pub frame: Rect,
    /// Where borders of fields are crossed on purpose [nm].
    pub field_border: (i64, i64),
    pillars: Vec<Cell>,
    top: Sheet,
    step2: Sheet,
}

/// A cell of one pillar.
struct Cell {
    name: String,
    width: i64,
}

struct Layers {
    pillars: LayerNumber,
    marks: LayerNumber,
    openings: LayerNumber,
    step2: LayerNumber,
    outline: LayerNumber,
    label: LayerNumber,
}

impl Structures {
    /// Lay out all structures that the process asks for, in rows from below.
    pub fn new(design: &Design, process: &Process) -> Self {
        let all = &design.layout.layers;
        let layers = Layers {
            pillars: number(&all.pillars),
            marks: number(&all.pillar_marks),
            openings: number(&all.apertures),
            step2: number(&all.aperture_marks),
            outline: number(&all.outline),
            label: number(&all.label),
        };
        let mut it = Self {
            list: Vec::new(),
            frame: Rect::new(0, 0, 0, 0),
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
        let row = it.large(process, &layers, y);
        right = right.max(row.x1);
        let top = it.field_verniers(process, &layers, right + APART).max(row.y1);
        right = it.field_border.0 + 2 * APART;
        it.frame = Rect::new(0, 0, right, top + APART);
        it.top.rectangle(layers.outline, it.frame);
        it.step2.rectangle(layers.outline, it.frame);
        it
    }

    fn record(&mut self, layers: &Layers, id: String, purpose: impl Into<String>, bounds: Rect, width_nm: Option<i64>) {
        self.top.text(layers.label, (bounds.x0, bounds.y1), id.clone());
        self.list.push(Structure {
            id,
            purpose: purpose.into(),
            bounds,
            width_nm,
            on_purpose: &[],
        });
    }

    /// What the structure recorded last breaks on purpose.
    fn breaks(&mut self, on_purpose: &'static [(&'static str, &'static str)]) {
        if let Some(last) = self.list.last_mut() {
            last.on_purpose = on_purpose;
        }
    }

    fn pillar(&mut self, width: i64) -> String {
        let name = format!("W{width}");
        if !self.pillars.iter().any(|c| c.width == width) {
            self.pillars.push(Cell {
                name: name.clone(),
                width,
            });
        }
        name
    }

    /// A row of uniform pads, and the line along which to cleave through the dense ones.
    fn pads(&mut self, design: &Design, process: &Process, layers: &Layers, kind: &str, sparse: i64, y: i64) -> Rect {
        let side = nm(process.tests.pad_um);
        let pitch = i64::from(design.cell.pitch_nm) * sparse;
        let cleave = sparse == 1;
        // Room at the left for the dashes of the cleave line.
        let mut x = APART + side + APART;
        let mut row = Rect::at(x, y, side, side);
        for width in pad_widths(design, process) {
            let pillar = self.pillar(width);
            x = clear_of_borders(x, side, nm(process.writer.field_used_um));
            let pad = Rect::at(x, y, side, side);
            top_pad(&mut self.top, &pillar, pad.centre(), side, pitch);
            let words = width.to_string();
            let numeral = pad.centre().0 - Sheet::numerals_width(NUMERAL, &words) / 2;
            self.top
                .numerals(layers.marks, (numeral, pad.y1 + BESIDE), NUMERAL, &words);
            self.step2.rectangle(layers.openings, pad.grown(BESIDE / 2));
            let bounds = Rect::new(pad.x0, pad.y0, pad.x1, pad.y1 + BESIDE + NUMERAL);
            self.record(
                layers,
                format!("{}{width}", if cleave { "D" } else { "S" }),
                format!("uniform pillars of {width} nm, {kind}, pitch {pitch} nm: transmission, width, height"),
                bounds,
                Some(width),
            );
            row = row.united(&bounds);
            x = pad.x1 + APART;
        }
        if cleave {
            let middle = y + side / 2;
            for left in [APART, x] {
                // Five dashes, thin enough to aim by.
                for k in 0..5 {
                    let dash = Rect::at(left + k * side / 5, middle - 1_000, side / 10, 2_000);
                    self.top.rectangle(layers.marks, dash);
                    row = row.united(&dash);
                }
            }
            let line = Rect::new(APART, middle - 1_000, x + side, middle + 1_000);
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
    fn cd_bars(&mut self, design: &Design, process: &Process, layers: &Layers, upright: bool, y: i64) -> Rect {
        let length = nm(process.tests.cd_length_um);
        let (axis, turned) = if upright { ("x", "upright") } else { ("y", "level") };
        let mut x = APART;
        let mut row = Rect::at(x, y, 0, length);
        for &asked in &process.tests.cd_widths_nm {
            let width = legal_width(design, asked);
            let across = if upright {
                2 * width * (LINES + 1) + 10_000
            } else {
                length
            };
            x = clear_of_borders(x, across, nm(process.writer.field_used_um));
            let bar = |at: i64| {
                if upright {
                    Rect::at(x + at, y, width, length)
                } else {
                    Rect::at(x, y + at, length, width)
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
            let label = Rect::at(
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
                Some(width),
            );
            row = row.united(&bounds);
            x = bounds.x1 + APART;
        }
        row
    }

    /// Etch depth, film witness, and the verniers between both steps.
    fn large(&mut self, process: &Process, layers: &Layers, y: i64) -> Rect {
        let (etch, witness) = (nm(process.tests.etch_pad_um), nm(process.tests.film_witness_um));
        let pad = Rect::at(APART, y, etch, etch);
        self.top.rectangle(layers.pillars, pad);
        self.record(
            layers,
            "ETCH".into(),
            "solid square beside bare glass: height of its step is the depth of the etch",
            pad,
            None,
        );
        let film = Rect::at(pad.x1 + APART, y, witness, witness);
        self.top.rectangle(layers.pillars, film);
        self.step2.rectangle(layers.openings, film.grown(BESIDE));
        self.record(
            layers,
            "FILM".into(),
            "solid film that is left whole: thickness and index by ellipsometry after all steps",
            film,
            None,
        );
        self.breaks(&[(
            "field_cut",
            "solid, and its thickness is the same on both sides of a seam",
        )]);
        let mut row = pad.united(&film);
        let (pitch, step) = (
            nm(process.tests.overlay_vernier_pitch_um),
            process.tests.overlay_vernier_step_nm as i64,
        );
        let mut x = film.x1 + APART;
        for upright in [true, false] {
            let axis = if upright { "x" } else { "y" };
            let span = 2 * BARS * (pitch + step) + pitch;
            let middle = (x + span / 2, y + span / 2);
            let first = comb(middle, pitch, pitch / 2, pitch, upright, -1);
            let second = comb(middle, pitch + step, pitch / 2, pitch, upright, 1);
            let mut bounds = Rect::at(middle.0, middle.1, 0, 0);
            for bar in first {
                self.top.rectangle(layers.marks, bar);
                bounds = bounds.united(&bar);
            }
            for bar in second {
                self.step2.rectangle(layers.step2, bar);
                bounds = bounds.united(&bar);
            }
            self.record(
                layers,
                format!("OVER_{axis}"),
                format!(
                    "vernier between the steps along {axis}: the bars that meet, counted from the middle, times {step} nm \
                     is the place of step 2 against step 1 (towards +{axis} if they meet on the minus side)"
                ),
                bounds,
                None,
            );
            row = row.united(&bounds);
            x = bounds.x1 + APART;
        }
        row
    }

    /// Verniers over borders of fields, and lines that run across them. Returns the top of the highest.
    fn field_verniers(&mut self, process: &Process, layers: &Layers, from_x: i64) -> i64 {
        let field = nm(process.writer.field_used_um);
        let (pitch, step) = (nm(process.tests.vernier_pitch_um), process.tests.vernier_step_nm as i64);
        let reach = BARS * (pitch + step) + pitch;
        let beside = |from: i64| (from + reach + field - 1) / field * field;
        self.field_border = (beside(from_x + 2 * reach + APART), beside(APART));
        let (bx, by) = self.field_border;
        let mut highest = 0;
        for upright in [true, false] {
            // Upright bars stand over a level border and tell the shift along x; level ones along y.
            let axis = if upright { "x" } else { "y" };
            let (middle, border) = if upright {
                ((bx - reach - APART, by), "level")
            } else {
                ((bx, by - 2 * reach - APART), "upright")
            };
            let middle = if upright {
                middle
            } else {
                (middle.0, middle.1.max(APART + reach))
            };
            let mut bounds = Rect::at(middle.0, middle.1, 0, 0);
            let combs = comb(middle, pitch, pitch / 4, pitch, upright, -1)
                .into_iter()
                .chain(comb(middle, pitch + step, pitch / 4, pitch, upright, 1));
            for bar in combs {
                self.top.rectangle(layers.pillars, bar);
                bounds = bounds.united(&bar);
            }
            // A line across the border: it necks or swells where the fields part or overlap.
            let (cx, cy) = middle;
            let line = if upright {
                Rect::new(cx + reach, cy - 2 * pitch, cx + reach + 500, cy + 2 * pitch)
            } else {
                Rect::new(cx - 2 * pitch, cy + reach, cx + 2 * pitch, cy + reach + 500)
            };
            self.top.rectangle(layers.pillars, line);
            let bounds = bounds.united(&line);
            self.record(
                layers,
                format!("FIELD_{axis}"),
                format!(
                    "vernier over a {border} border of two fields: bars that meet, counted from the middle, times {step} nm \
                     is the shift of one field against the other along {axis}; the line across shows gap or overlap"
                ),
                bounds,
                None,
            );
            self.breaks(&[("field_cut", "it tells how two fields meet")]);
            highest = highest.max(bounds.y1);
        }
        highest
    }

    /// Write both files.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn write(self, design: &Design, pillars: &Path, step2: &Path) -> Result<Vec<Structure>> {
        let timestamp = &design.layout.timestamp;
        let mut drawing = Drawing::new("TESTS", timestamp);
        for cell in &self.pillars {
            drawing.add_pillar(&cell.name, number(&design.layout.layers.pillars), cell.width);
        }
        drawing.add(self.top);
        drawing.write(pillars)?;
        let mut drawing = Drawing::new("TESTS_STEP2", timestamp);
        drawing.add(self.step2);
        drawing.write(step2)?;
        Ok(self.list)
    }
}

/// The middle of the hyperbolic reference lens, which is a file of its own with its origin there.
pub(super) fn middle_of_reference() -> Structure {
    const LEVEL: &str = "the phase of a hyperbola is level in its middle, and so all pillars there are about as wide";
    Structure {
        id: "REFERENCE".into(),
        purpose: "hyperbolic lens to compare the elements with".into(),
        bounds: Rect::new(-LEVEL_REACH, -LEVEL_REACH, LEVEL_REACH, LEVEL_REACH),
        width_nm: None,
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

/// Widths of the uniform pads [nm], from the narrowest to the widest that the design may write.
fn pad_widths(design: &Design, process: &Process) -> Vec<i64> {
    let (low, high) = design.cell.width_range_nm;
    let step = process
        .tests
        .pad_width_step_nm
        .max(f64::from(design.cell.width_step_nm));
    let count = (f64::from(high - low) / step).floor() as i64;
    let mut widths: Vec<i64> = (0..=count)
        .map(|k| legal_width(design, f64::from(low) + k as f64 * step))
        .collect();
    widths.dedup();
    widths
}

/// Bars of one half of a vernier about a place: `side` -1 below or left of the border, 1 beyond it.
/// The two halves end one bar width from one another's middle line.
fn comb(middle: (i64, i64), pitch: i64, width: i64, length: i64, upright: bool, side: i64) -> Vec<Rect> {
    (-BARS..=BARS)
        .map(|k| {
            // The middle bar and every fifth are longer, to count by.
            let reach = if k == 0 {
                2 * length
            } else if k % 5 == 0 {
                length * 3 / 2
            } else {
                length
            };
            let along = k * pitch - width / 2;
            let (near, far) = (side * 100, side * (100 + reach));
            let (low, high) = (near.min(far), near.max(far));
            if upright {
                Rect::new(
                    middle.0 + along,
                    middle.1 + low,
                    middle.0 + along + width,
                    middle.1 + high,
                )
            } else {
                Rect::new(
                    middle.0 + low,
                    middle.1 + along,
                    middle.0 + high,
                    middle.1 + along + width,
                )
            }
        })
        .collect()
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

    #[test]
    fn a_vernier_reads_the_shift_that_makes_bars_meet() {
        let (pitch, step) = (4_000, 20);
        let first = comb((0, 0), pitch, 1_000, pitch, true, -1);
        // The second comb shifted by three steps towards -x: bars +3 meet.
        let second = comb((-3 * step, 0), pitch + step, 1_000, pitch, true, 1);
        let meet: Vec<_> = (0..first.len())
            .filter(|&k| first[k].x0 == second[k].x0)
            .map(|k| k as i64 - BARS)
            .collect();
        assert_eq!(meet, [3]);
        assert!(first.iter().all(|a| a.y1 < 0) && second.iter().all(|b| b.y0 > 0));
    }
}
