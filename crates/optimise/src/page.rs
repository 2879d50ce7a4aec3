//! The report of an optimisation: phase, PSF, Strehl and MTF before and after.

use std::path::Path;

use ndarray::Array2;
use serde::Serialize;

use crate::rings::mapping::step;
use crate::strehl_gain::StrehlSummary;
use metalith_cell::Fidelity;
use metalith_core::Result;
use metalith_report::{Axis, Cell, Chart, Column, HeatMap, Page, Table, Verdict, sig, write_json};

/// Basis of the figures of an optimisation, in words for people.
const BY_EQUAL_NEIGHBOURS: &str = "Merit and all Strehl ratios, of the layout as read back too, use the local periodic approximation (LPA): each pillar transmits as in a lattice of equal pillars. `metalith run` may give other Strehl ratios, because it uses the coupled model for the cell of the paper, unless `fidelity` in [verify] states another.";

const BY_UNLIKE_NEIGHBOURS: &str = "Merit and Strehl ratios of the model `neighbours` use the coupled model: each pillar transmits with its real neighbours, as in `metalith run` by default for the cell of the paper. Figures over wavelength use the mean of each ring. Strehl ratios of the model `rigorous` use the local periodic approximation (LPA).";

const BY_CONVERTED_LIGHT: &str = "Merit and figures are of converted light of the handedness that is focused. Each rectangle transmits as in a lattice of equally rotated rectangles, with the diffraction orders for wavelengths of a band. `metalith run` solves its wavelengths with more orders, also counts light that is not converted, and simulates the `polarisation` of [verify].";

/// All that is reported.
#[derive(Clone, Debug, Serialize)]
pub struct OptimiseReport {
    /// Name and title of the design.
    pub design: String,
    /// Commands that made the phase.
    pub command: String,
    /// Phases that the best chain began from.
    pub start: String,
    /// Merit, as optimised.
    pub merit: f64,
    /// Steps of the rotation (degrees), of rotated rectangles: figures of widths are then those of rotations, by their number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_step_deg: Option<f64>,
    /// Limit on the step (waves).
    pub step_limit_waves: f64,
    /// Reference of gains, judged in each way: the design's own phase, or where that is a table, a hyperbolic one.
    pub before: Vec<StrehlSummary>,
    /// The table that the design has.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub own: Vec<StrehlSummary>,
    /// The optimised phase.
    pub after: Vec<StrehlSummary>,
    /// Wavelengths of `[verify]` (um) and Strehl ratios of the layout there by the cell as it judges single wavelengths, where that
    /// of a band is solved with fewer orders.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub at_single_wavelengths: Vec<(f64, f64)>,
    /// Geometric-mean Strehl ratio that exchange reaches for other limits (waves).
    pub merit_over_limit: Vec<(f64, f64)>,
    /// Expected PSNR of restored images (dB) at each field angle (degrees), before and after.
    pub expected_psnr_db: Vec<(f64, f64, f64)>,
    /// Geometric-mean Strehl ratios with drawn errors of fabrication, one a draw, of several phases by name.
    pub with_errors: Vec<(&'static str, Vec<f64>)>,
    /// Merit along the way.
    #[serde(skip)]
    pub history: Vec<(u32, f64)>,
    /// Radius (um), phase before and after (waves), width after (nm) of each ring.
    #[serde(skip)]
    pub rings: Vec<(f64, f64, f64, u16)>,
    /// Wavelengths of the pictures (um), their greatest radius (um), and PSFs before and after.
    #[serde(skip)]
    pub psf: (Vec<f64>, f64, Vec<Array2<f64>>),
    /// Wavelengths (um), and MTF at half and all of Nyquist, before and after.
    #[serde(skip)]
    pub mtf: (Vec<f64>, Vec<Vec<(f64, f64)>>),
}

impl OptimiseReport {
    /// True if every step of the optimised phase keeps the limit, rings and layout.
    pub fn limit_kept(&self) -> bool {
        self.after
            .iter()
            .all(|j| j.largest_step_waves <= self.step_limit_waves + 1e-6)
    }

    /// Cost of the limit on the step, in words, where the result is worse than its reference and the reference has
    /// larger steps.
    pub fn limit_costs(&self) -> Option<String> {
        let (before, after) = (self.before.first()?, self.after.first()?);
        limit_costs(
            (before.largest_step_waves, before.geometric_mean),
            (self.step_limit_waves, after.geometric_mean),
            &self.merit_over_limit,
        )
    }

    /// All phases that were judged, with what they are called.
    pub fn phases(&self) -> [(&'static str, &[StrehlSummary]); 3] {
        [
            ("before", &self.before),
            ("table of the design", &self.own),
            ("after", &self.after),
        ]
    }

    /// Words for people on whether pillars were taken for equals of their neighbours, and on what counts of the light
    /// that they change.
    pub fn neighbours(&self) -> &'static str {
        if self.rotation_step_deg.is_some() {
            return BY_CONVERTED_LIGHT;
        }
        let unlike = self.after.iter().any(|j| j.fidelity == Fidelity::Neighbours);
        if unlike {
            BY_UNLIKE_NEIGHBOURS
        } else {
            BY_EQUAL_NEIGHBOURS
        }
    }

    /// Write `report.html` and `report.json` into a folder.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join("report.json"), "optimise", self)?;
        self.page().write(&folder.join("report.html"))
    }

    fn page(&self) -> Page {
        let mut page = Page::new("Optimised radial phase", &self.design);
        let kept = self.limit_kept();
        let words = if kept {
            format!(
                "Every phase step, of the rings and of the layout, is within {} waves.",
                self.step_limit_waves
            )
        } else {
            format!("A phase step is beyond the limit of {} waves.", self.step_limit_waves)
        };
        page.verdict(Verdict::of(kept), words);
        if let (Some(before), Some(after)) = (self.before.first(), self.after.first()) {
            page.facts(&[
                ("Geometric-mean Strehl before", sig(before.geometric_mean, 3)),
                ("after", sig(after.geometric_mean, 3)),
                ("Smallest after", sig(after.smallest, 3)),
                ("Began from", self.start.clone()),
            ]);
        }
        page.code(&self.command);
        page.note(self.neighbours());
        if let Some(words) = self.limit_costs() {
            page.note(words);
        }
        page.section("Strehl ratio");
        page.paragraph(
            "On a grid of 0.5 nm, also between the optimised wavelengths, against the same aperture \
             passing all its power in the zero order with the perfect phase.",
        );
        page.table(self.table());
        if !self.at_single_wavelengths.is_empty() {
            let each = self.at_single_wavelengths.iter();
            let words: Vec<String> = each
                .map(|(um, s)| format!("{} at {} nm", sig(*s, 3), sig(um * 1e3, 5)))
                .collect();
            page.paragraph(format!(
                "The layout at single wavelengths, each solved with as many orders as for `metalith run`: {}.",
                words.join(", ")
            ));
        }
        page.figure(self.strehl());
        page.section("PSF over wavelength");
        page.row(self.psfs());
        page.section("MTF over wavelength");
        page.figure(self.mtfs());
        page.section(match self.rotation_step_deg {
            None => "Phase and width",
            Some(_) => "Phase and rotation",
        });
        page.figure(self.phase());
        page.figure(self.width());
        self.rest(&mut page);
        page
    }

    /// Sections that not every optimisation has.
    fn rest(&self, page: &mut Page) {
        if !self.merit_over_limit.is_empty() {
            let mut chart = Chart::new(
                "Merit over the limit",
                Axis::linear("limit on the phase step", "waves").range(0.0, 0.5),
                Axis::linear("geometric-mean Strehl ratio", ""),
            );
            chart.line("reached by exchange", self.merit_over_limit.iter().copied());
            chart.marker(self.step_limit_waves, "this design");
            page.section("Merit against limit");
            page.figure(
                chart.caption("Exchange at temperature zero from the optimised phase, at the optimised wavelengths."),
            );
        }
        if !self.expected_psnr_db.is_empty() {
            let mut table = Table::new([
                Column::number("Field angle", "deg"),
                Column::number("Before", "dB"),
                Column::number("After", "dB"),
            ]);
            for &(angle, before, after) in &self.expected_psnr_db {
                table.row([Cell::fixed(angle, 1), Cell::fixed(before, 2), Cell::fixed(after, 2)]);
            }
            page.section("Expected images");
            page.paragraph(
                "Expected PSNR after inverse filtering, in closed form, at wavelengths between the optimised ones.",
            );
            page.table(table);
        }
        if let Some((_, draws)) = self.with_errors.first() {
            let mut table = Table::new([
                Column::text("Phase"),
                Column::number("Mean", ""),
                Column::number("Standard deviation", ""),
                Column::number("Smallest", ""),
            ]);
            for (name, values) in &self.with_errors {
                let (mean, deviation) = mean_and_deviation(values);
                let least = values.iter().copied().fold(f64::INFINITY, f64::min);
                table.row([
                    Cell::from(*name),
                    Cell::sig(mean, 4),
                    Cell::sig(deviation, 3),
                    Cell::sig(least, 3),
                ]);
            }
            page.section("With errors of fabrication");
            page.paragraph(format!(
                "Geometric-mean Strehl ratio over {} draws of width, film height and defocus.",
                draws.len()
            ));
            page.table(table);
        }
        if self.history.len() > 1 {
            let mut chart = Chart::new(
                "Progress of the merit",
                Axis::linear("sweep or step", ""),
                Axis::linear("merit", ""),
            );
            chart.line("best chain", self.history.iter().map(|&(i, m)| (f64::from(i), m)));
            page.section("Progress");
            page.figure(chart.caption("Merit as optimised: larger is better."));
        }
    }

    fn table(&self) -> Table {
        let mut table = Table::new([
            Column::text("Phase"),
            Column::text("From"),
            Column::text("Cell"),
            Column::number("Geometric mean", ""),
            Column::number("Mean", ""),
            Column::number("Smallest", ""),
            Column::number("Largest step", "waves"),
        ]);
        for (name, list) in self.phases() {
            for judged in list {
                table.row([
                    Cell::from(name),
                    Cell::from(judged.source),
                    Cell::from(judged.fidelity.name()),
                    Cell::sig(judged.geometric_mean, 3),
                    Cell::sig(judged.mean, 3),
                    Cell::sig(judged.smallest, 3),
                    Cell::fixed(judged.largest_step_waves, 3),
                ]);
            }
        }
        table
    }

    fn strehl(&self) -> metalith_report::Figure {
        let mut chart = Chart::new(
            "Strehl ratio on the axis",
            Axis::linear("wavelength", "nm"),
            Axis::log("Strehl ratio", ""),
        );
        for (name, list) in [("before", &self.before), ("after", &self.after)] {
            let rings = list.iter().filter(|j| j.source == "rings");
            if let Some(judged) = rings.max_by_key(|j| j.fidelity) {
                let points = judged.strehl.wavelength_um.iter().zip(&judged.strehl.ratio);
                let floored = points.map(|(l, s)| (l * 1e3, s.max(1e-7)));
                chart.line(format!("{name}, model {}", judged.fidelity.name()), floored);
            }
        }
        chart.caption("Before and after.")
    }

    fn psfs(&self) -> Vec<metalith_report::Figure> {
        let (lengths, radius, maps) = &self.psf;
        let (Some(first), Some(last)) = (lengths.first(), lengths.last()) else {
            return Vec::new();
        };
        let most = maps.iter().flat_map(|m| m.iter()).copied().fold(0.0, f64::max);
        ["Before", "After"]
            .iter()
            .zip(maps)
            .map(|(name, map)| {
                HeatMap::new(
                    *name,
                    map.mapv(|v| v.max(most * 1e-6)),
                    (Axis::linear("wavelength", "nm"), first * 1e3, last * 1e3),
                    (Axis::linear("distance from the axis", "um"), 0.0, *radius),
                )
                .log()
                .range(most * 1e-5, most)
                .values("intensity", "of the incident")
                .size(460.0, 320.0)
                .caption("PSF around the axis over wavelength, on one scale for both.")
            })
            .collect()
    }

    fn mtfs(&self) -> metalith_report::Figure {
        let mut chart = Chart::new(
            "MTF on the axis",
            Axis::linear("wavelength", "nm"),
            Axis::linear("MTF", "").range(0.0, 1.0),
        );
        for (name, pairs) in ["before", "after"].iter().zip(&self.mtf.1) {
            let points = |pick: fn(&(f64, f64)) -> f64| {
                self.mtf
                    .0
                    .iter()
                    .zip(pairs)
                    .map(move |(l, p)| (l * 1e3, pick(p)))
                    .collect::<Vec<_>>()
            };
            chart.line(format!("{name}, half Nyquist"), points(|p| p.0));
            chart.line(format!("{name}, Nyquist"), points(|p| p.1));
        }
        chart.caption("At half and at all of the Nyquist frequency of the pixels, pixel included.")
    }

    fn phase(&self) -> metalith_report::Figure {
        let mut chart = Chart::new("Phase", Axis::linear("radius", "um"), Axis::linear("phase", "waves"));
        for (name, pick) in [("before", 0), ("after", 1)] {
            let (mut sum, mut last) = (0.0, None);
            let points = self.rings.iter().map(|&(r, a, b, _)| {
                let t = if pick == 0 { a } else { b };
                sum += last.map_or(0.0, |l| step(l, t));
                last = Some(t);
                (r, sum)
            });
            chart.line(name, points.collect::<Vec<_>>());
        }
        chart.caption("Phase with the wrapped steps from ring to ring added up.")
    }

    fn width(&self) -> metalith_report::Figure {
        let (title, axis, each, caption) = match self.rotation_step_deg {
            None => (
                "Pillar width",
                Axis::linear("width", "nm"),
                1.0,
                "Width of the pillars of each ring.",
            ),
            Some(step_deg) => (
                "Pillar rotation",
                Axis::linear("rotation", "deg"),
                step_deg,
                "Rotation of the pillars of each ring, from x towards y, before corners are rounded to the grid.",
            ),
        };
        let mut chart = Chart::new(title, Axis::linear("radius", "um"), axis);
        chart.points("after", self.rings.iter().map(|&(r, _, _, w)| (r, each * f64::from(w))));
        chart.caption(caption)
    }
}

/// Mean and standard deviation.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean, variance.sqrt())
}

/// Words from the largest step (waves) and the Strehl ratio before, the limit and the ratio after, and what wider
/// limits reach.
fn limit_costs(before: (f64, f64), after: (f64, f64), over_limit: &[(f64, f64)]) -> Option<String> {
    let ((step, was), (limit, is)) = (before, after);
    if step <= limit || is >= was {
        return None;
    }
    // The first that lets the phase before through.
    let wider = over_limit.iter().find(|(wider, merit)| *wider >= step && *merit > is);
    let hint = wider.map_or_else(String::new, |(wider, merit)| {
        format!(
            "; with `step_limit_waves = {wider}` in [optimise] {} is reached",
            sig(*merit, 3)
        )
    });
    Some(format!(
        "The phase before has steps of {step:.3} waves from ring to ring, those of a phase that is found are limited to {limit}, and this costs more than was gained{hint}."
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_costs_more_than_was_gained_is_named() {
        let over = [(0.1, 0.2), (0.2, 0.36), (0.3, 0.54), (0.4, 0.55)];
        let words = limit_costs((0.295, 0.525), (0.2, 0.36), &over).unwrap();
        insta::assert_snapshot!(words, @"The phase before has steps of 0.295 waves from ring to ring, those of a phase that is found are limited to 0.2, and this costs more than was gained; with `step_limit_waves = 0.3` in [optimise] 0.540 is reached.");
        // No limit that was tried is as wide.
        let words = limit_costs((0.45, 0.525), (0.2, 0.36), &over).unwrap();
        insta::assert_snapshot!(words, @"The phase before has steps of 0.450 waves from ring to ring, those of a phase that is found are limited to 0.2, and this costs more than was gained.");
        // Better than before, or before within the limit.
        assert!(limit_costs((0.295, 0.3), (0.2, 0.36), &over).is_none());
        assert!(limit_costs((0.2, 0.525), (0.2, 0.36), &over).is_none());
    }
}
