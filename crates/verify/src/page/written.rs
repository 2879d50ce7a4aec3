//! What was written: every site compared, the layers of the file, the widths as read back.

use super::designed::{numbers, shown_number};
use crate::Verification;
use crate::copies::place_words;
use metalith_design::Design;
use metalith_design::array::Symmetry;
use metalith_report::{Axis, Cell, Chart, Column, Page, Table, count, sig};

/// Odd shapes that are listed in the page; all are in `report.json` up to its own limit.
const MOST_ODDITIES: usize = 20;

/// The section of the file.
pub(super) fn write(page: &mut Page, design: &Design, found: &Verification) {
    page.section("What was written");
    let rotated = design.cell.shape.rectangles().is_some();
    let mut table = Table::new([
        Column::text("Element (m, n)"),
        Column::number("Pillars", ""),
        Column::number(if rotated { "Wrong rotation" } else { "Wrong width" }, ""),
        Column::number("Missing", ""),
        Column::number("Extra", ""),
        Column::text("Simulated as"),
    ]);
    for check in &found.elements {
        let copy = check.copy_of.and_then(|k| found.distinct.get(k));
        let turned = check.turned.filter(|s| *s != Symmetry::IDENTITY);
        let turned = turned.map_or_else(String::new, |s| format!(", (x, y) at {}", place_words(s)));
        table.row([
            Cell::from(check.element.label()),
            Cell::from(count(check.widths.pillars)),
            Cell::from(count(check.widths.wrong)),
            Cell::from(count(check.widths.missing)),
            Cell::from(count(check.widths.extra)),
            Cell::from(copy.map_or_else(|| "itself".into(), |d| d.element.label() + &turned)),
        ]);
    }
    page.table(table.caption(format!(
        "Every site of every element, compared with the {} that the design asks for. An element that is simulated as another has its figures with the place (x, y) where the table says; its field angles are turned alike.",
        if rotated { "rotation" } else { "width" }
    )));
    let mut layers = Table::new([
        Column::text("Layer"),
        Column::number("Shapes", ""),
        Column::number("Texts", ""),
        Column::text("Purpose"),
    ]);
    for layer in &found.layout.survey.layers {
        let known = design.layout.layers.all();
        let purpose = known.iter().find(|(_, l)| l.number() == layer.layer);
        layers.row([
            Cell::code(format!("{}/{}", layer.layer.layer, layer.layer.datatype)),
            Cell::from(count(layer.shapes)),
            Cell::from(count(layer.texts)),
            Cell::from(purpose.map_or("not a layer of the design", |(_, l)| l.purpose.as_str())),
        ]);
    }
    page.table(layers.caption(format!(
        "Layers of {}, all references followed: {} cells, {} deep, top cell `{}`.",
        found.layout.file, found.layout.cells, found.layout.depth, found.layout.top_cell
    )));
    for oddity in found.foreign.listed.iter().take(MOST_ODDITIES) {
        page.note(format!(
            "{} at ({}, {}) um, {} x {} nm",
            oddity.why.words(),
            sig(oddity.centre_nm[0] * 1e-3, 9),
            sig(oddity.centre_nm[1] * 1e-3, 9),
            sig(oddity.size_nm[0], 6),
            sig(oddity.size_nm[1], 6)
        ));
    }
    let (title, axis) = numbers(design);
    let mut widths = Chart::new(format!("{title}s of all pillars"), axis, Axis::linear("pillars", ""));
    let mut histogram = Vec::new();
    for element in &found.distinct {
        for (w, c) in element.histogram.iter().enumerate().skip(1) {
            histogram.resize(histogram.len().max(w + 1), 0);
            histogram[w] += c * element.copies as u64;
        }
    }
    let step = match design.cell.shape.rectangles() {
        None => f64::from(design.cell.width_step_nm),
        Some(pillars) => pillars.step_deg(),
    };
    let at = |w: usize, steps: f64| shown_number(design, w as u16) + steps * step;
    let bars = histogram.iter().enumerate().filter(|(_, c)| **c > 0);
    widths.bars("pillars", bars.map(|(w, &c)| (at(w, -0.5), at(w, 0.5), c as f64)));
    page.figure(widths.caption(format!(
        "Number of pillars of each {}, as read back.",
        if rotated { "rotation" } else { "width" }
    )));
}
