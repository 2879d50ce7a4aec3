//! Solid squares and verniers: structures from which depth, film, overlay and stitching are measured.

use super::{APART, BESIDE, StructureLayers, Structures};
use crate::drawing::{RectNm, nm};
use crate::process::Process;
use metalith_design::Design;

/// Bars of a vernier on each side of its middle.
const BARS: i64 = 10;

impl Structures {
    /// Etch depth, film witness, and the verniers between both steps.
    pub(super) fn large(&mut self, design: &Design, process: &Process, layers: &StructureLayers, y: i64) -> RectNm {
        let (etch, witness) = (nm(process.tests.etch_pad_um), nm(process.tests.film_witness_um));
        let pad = RectNm::at(APART, y, etch, etch);
        self.top.rectangle(layers.pillars, pad);
        self.record(
            layers,
            "ETCH".into(),
            "solid square beside bare substrate: height of its step is the depth of the etch",
            pad,
            None,
        );
        let mut row = pad;
        // Pillars that are etched into the substrate have no film.
        if design.cell.pillar_material != design.cell.substrate_material {
            row = row.united(&self.film_witness(layers, (pad.x1 + APART, y), witness));
        }
        let mut x = row.x1 + APART;
        let (pitch, step) = (
            nm(process.tests.overlay_vernier_pitch_um),
            process.tests.overlay_vernier_step_nm as i64,
        );
        for upright in [true, false] {
            let axis = if upright { "x" } else { "y" };
            let span = 2 * BARS * (pitch + step) + pitch;
            let middle = (x + span / 2, y + span / 2);
            let first = comb(middle, pitch, pitch / 2, pitch, upright, -1);
            let second = comb(middle, pitch + step, pitch / 2, pitch, upright, 1);
            let mut bounds = RectNm::at(middle.0, middle.1, 0, 0);
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

    /// A square of film with an opening over it.
    fn film_witness(&mut self, layers: &StructureLayers, (x, y): (i64, i64), witness: i64) -> RectNm {
        let film = RectNm::at(x, y, witness, witness);
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
        film
    }

    /// Verniers over borders of fields, and lines that run across them. Returns the top of the highest.
    pub(super) fn field_verniers(&mut self, process: &Process, layers: &StructureLayers, from_x: i64) -> i64 {
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
            let mut bounds = RectNm::at(middle.0, middle.1, 0, 0);
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
                RectNm::new(cx + reach, cy - 2 * pitch, cx + reach + 500, cy + 2 * pitch)
            } else {
                RectNm::new(cx - 2 * pitch, cy + reach, cx + 2 * pitch, cy + reach + 500)
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
            self.breaks(&[("field_cut", "it measures how two fields meet")]);
            highest = highest.max(bounds.y1);
        }
        highest
    }
}

/// Bars of one half of a vernier about a place: `side` -1 below or left of the border, 1 beyond it.
/// The two halves end one bar width from one another's middle line.
fn comb(middle: (i64, i64), pitch: i64, width: i64, length: i64, upright: bool, side: i64) -> Vec<RectNm> {
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
                RectNm::new(
                    middle.0 + along,
                    middle.1 + low,
                    middle.0 + along + width,
                    middle.1 + high,
                )
            } else {
                RectNm::new(
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
