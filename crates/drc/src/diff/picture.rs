//! Page of the places of all changes.

use ndarray::Array2;

use super::report::LayoutDiff;
use metalith_report::{Axis, Cell, Column, HeatMap, Page, Plan, Table, Verdict};

/// Changes that are drawn as shapes.
const DRAWN: usize = 400;

/// The page of a comparison.
pub fn page(diff: &LayoutDiff) -> Page {
    let mut page = Page::new("Two layouts", format!("{} and {}", diff.a, diff.b));
    let words = match (diff.same_geometry, diff.same_bytes, diff.tree.same) {
        (true, true, _) => "The files are the same, byte by byte.",
        (true, _, true) => "The geometry is the same; only bytes differ.",
        (true, ..) => "The geometry is the same, although the hierarchy differs.",
        _ => "The geometry differs.",
    };
    page.verdict(Verdict::of(diff.same_geometry), words);
    let changed: u64 = diff.elements.iter().map(super::report::ElementDiff::changed).sum();
    page.facts(&[
        ("Places that differ", metalith_report::count(diff.changes)),
        ("Pillars that differ", metalith_report::count(changed)),
        ("Elements", diff.elements.len().to_string()),
    ]);
    if diff.changes > 0 {
        page.section("Where");
        page.figure(heat(diff));
        page.figure(shapes(diff));
    }
    page.section("Elements");
    page.table(elements(diff));
    page.section("Layers");
    page.table(layers(diff));
    page
}

fn heat(diff: &LayoutDiff) -> metalith_report::Figure {
    let map = &diff.map;
    let [x0, y0, x1, y1] = map.bounds_nm.map(|v| v * 1e-3);
    let values = Array2::from_shape_fn((map.rows, map.columns), |(row, column)| {
        map.counts[row * map.columns + column] as f64
    });
    HeatMap::new(
        "Changes over the layout",
        values,
        (Axis::linear("x", "um"), x0, x1),
        (Axis::linear("y", "um"), y0, y1),
    )
    .to_scale()
    .values("places that differ in a tile", "")
    .caption("Every change is counted in the tile that holds its middle.")
}

fn shapes(diff: &LayoutDiff) -> metalith_report::Figure {
    let mut plan = Plan::new("The first changes");
    let mut layers = Vec::new();
    // The first change and what is near it: changes far apart would be dots.
    let near = diff
        .listed
        .first()
        .map_or([0.0; 2], |c| [c.bounds_nm[0], c.bounds_nm[1]]);
    const SPAN_NM: f64 = 20_000.0;
    let close = |b: &[f64; 4]| (b[0] - near[0]).abs() < SPAN_NM && (b[1] - near[1]).abs() < SPAN_NM;
    let mut drawn = 0;
    for c in diff.listed.iter().filter(|c| close(&c.bounds_nm)).take(DRAWN) {
        let layer = if let Some((_, layer)) = layers.iter().find(|(what, _)| *what == c.what) {
            *layer
        } else {
            let layer = plan.layer(c.what);
            layers.push((c.what, layer));
            layer
        };
        let b = c.bounds_nm.map(|v| v * 1e-3);
        plan.rectangle(layer, (b[0], b[1]), (b[2], b[3]));
        drawn += 1;
    }
    plan.caption(format!(
        "The first change and the changes within 20 um of it, {drawn} of {}.",
        diff.changes
    ))
}

fn elements(diff: &LayoutDiff) -> Table {
    let mut table = Table::new([
        Column::text("Element"),
        Column::number("Pillars in a", ""),
        Column::number("in b", ""),
        Column::number("Added", ""),
        Column::number("Removed", ""),
        Column::number("Widened", ""),
        Column::number("Narrowed", ""),
        Column::number("Largest change", "nm"),
        Column::number("rms change", "nm"),
        Column::verdict(),
    ]);
    for e in &diff.elements {
        let count = |n: u64| Cell::from(metalith_report::count(n));
        table.row([
            Cell::from(e.name.as_str()),
            count(e.pillars[0]),
            count(e.pillars[1]),
            count(e.added),
            count(e.removed),
            count(e.widened),
            count(e.narrowed),
            count(u64::from(e.largest_change_nm)),
            Cell::sig(e.rms_change_nm, 4),
            Cell::from(Verdict::of(e.changed() == 0)),
        ]);
    }
    table
}

fn layers(diff: &LayoutDiff) -> Table {
    let mut table = Table::new([
        Column::text("Layer"),
        Column::number("Shapes in a", ""),
        Column::number("in b", ""),
        Column::number("Outlines only in a", ""),
        Column::number("only in b", ""),
        Column::verdict(),
    ]);
    for l in &diff.layers {
        let count = |n: u64| Cell::from(metalith_report::count(n));
        table.row([
            Cell::from(l.layer.to_string()),
            count(l.shapes[0]),
            count(l.shapes[1]),
            count(l.only_in_a),
            count(l.only_in_b),
            Cell::from(Verdict::of(l.same_area)),
        ]);
    }
    table
}
