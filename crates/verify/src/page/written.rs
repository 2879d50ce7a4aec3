//! Page of what was written: every site compared, the layers of the file, the widths as read back.

use super::designed::{numbers, shown_number, step};
use crate::Verification;
use crate::distinct_elements::place_words;
use metalith_design::Design;
use metalith_design::array::Symmetry;
use metalith_report::{Axis, Cell, Chart, Column, Page, Table, count, counted, sig};

/// Odd shapes that are listed in the page; all are in `report.json` up to its own limit.
const MOST_ODDITIES: usize = 20;

/// The section of the file.
pub(super) fn write(page: &mut Page, design: &Design, found: &Verification) {
    page.section("The file");
    let told_by = design.cell.shape.quantity().word;
    let mut table = Table::new([
        Column::text("Element (m, n)"),
        Column::number("Pillars", ""),
        Column::number(format!("Wrong {told_by}"), ""),
        Column::number("Missing", ""),
        Column::number("Extra", ""),
        Column::text("Simulated as"),
    ]);
    let nothing = found.not_simulated.is_some() && found.sampled().is_none();
    for check in &found.elements {
        let turned = check.turned.filter(|s| *s != Symmetry::IDENTITY);
        let turned = turned.map_or_else(String::new, |s| format!(", (x, y) at {}", place_words(s)));
        table.row([
            Cell::from(check.element.label()),
            Cell::from(count(check.widths.pillars)),
            Cell::from(count(check.widths.wrong)),
            Cell::from(count(check.widths.missing)),
            Cell::from(count(check.widths.extra)),
            match found.simulated_as(check) {
                Some(element) => Cell::from(element.label() + &turned),
                None if nothing => Cell::none(),
                None => Cell::from("itself"),
            },
        ]);
    }
    page.table(table.caption(format!(
        "Every site of every element is compared with the {told_by} of the design. The last column names the element that is simulated in its place. The figures of that element hold with the place (x, y) of the table, and with field angles transformed in the same way."
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
        "Layers of {}, shapes of all references counted: {}, {} deep, top cell `{}`.",
        found.layout.file,
        counted(found.layout.cells, "cell"),
        found.layout.depth,
        found.layout.top_cell
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
    let mut widths = Chart::new(
        format!("All pillars by {}", title.to_lowercase()),
        axis,
        Axis::linear("pillars", ""),
    );
    let half = step(design) / 2.0;
    let bars = counts(design, found).into_iter();
    widths.bars("pillars", bars.map(|(at, c)| (at - half, at + half, c as f64)));
    page.figure(widths.caption(format!(
        "Number of pillars of each {}, as read back.",
        title.to_lowercase()
    )));
}

/// Numbers of pillars over what figures show of them.
fn counts(design: &Design, found: &Verification) -> Vec<(f64, u64)> {
    let mut counts: Vec<(f64, u64)> = Vec::new();
    for element in &found.distinct {
        for (w, c) in element.histogram.iter().enumerate().skip(1).filter(|(_, c)| **c > 0) {
            let (at, c) = (shown_number(design, w as u16), c * element.copies as u64);
            match counts.iter_mut().find(|(known, _)| *known == at) {
                Some((_, sum)) => *sum += c,
                None => counts.push((at, c)),
            }
        }
    }
    counts.sort_by(|a, b| a.0.total_cmp(&b.0));
    counts
}
