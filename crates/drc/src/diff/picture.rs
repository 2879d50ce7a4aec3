//! Page of the places of all changes.

use metalith_core::text::printable;
use ndarray::Array2;

use super::report::{Change, LayoutDiff};
use metalith_report::{Axis, Cell, Column, HeatMap, Page, Plan, Table, Verdict, count, fixed};

/// Changes that are drawn as shapes in one figure.
const DRAWN: usize = 400;
/// Figures of changes near one another.
const PLACES: usize = 6;
/// Least width of what a figure shows around its first change (um).
const AROUND_UM: f64 = 1.0;
/// Texts, references and moved shapes that the page lists.
const LABELS: usize = 50;
/// Distance from the first change of a figure to the farthest that it draws (nm): changes far apart would be dots.
const SPAN_NM: f64 = 20_000.0;

/// The page of a comparison.
pub fn page(diff: &LayoutDiff) -> Page {
    let mut page = Page::new(
        "Two layouts",
        format!("{} and {}", printable(&diff.a), printable(&diff.b)),
    );
    let words = match (diff.same_geometry, diff.same_bytes, diff.tree.same) {
        (true, true, _) => "The files are the same, byte by byte.",
        (true, _, true) => "The geometry is the same; only bytes differ.",
        (true, ..) => "The geometry is the same, although the hierarchy differs.",
        _ => "The geometry differs.",
    };
    page.verdict(Verdict::of(diff.same_geometry), words);
    let changed: u64 = diff.elements.iter().map(super::report::ElementDiff::changed).sum();
    let texts = diff.texts_apart.iter().sum();
    let missing = diff.missing.apart.iter().sum();
    let mut facts = vec![
        ("Places that differ", count(diff.changes)),
        ("Pillars that differ", count(changed)),
        ("Elements", diff.elements.len().to_string()),
        ("Texts that differ", count(texts)),
    ];
    if !diff.missing.is_none() {
        facts.push(("References to missing cells that differ", count(missing)));
    }
    page.facts(&facts);
    if diff.changes > 0 {
        page.section("Where");
        let places = places(diff);
        page.figure(heat(diff, &places));
        for (k, changes) in places.iter().enumerate() {
            page.figure(shapes(diff, changes, k + 1));
        }
    }
    if diff.listed.iter().any(|c| !c.words().is_empty()) {
        page.section("Moved and resized");
        page.table(moved(diff));
    }
    page.section("Elements");
    page.table(elements(diff));
    page.section("Layers");
    page.table(layers(diff));
    if texts + missing > 0 {
        page.section("Texts and missing cells");
        page.table(labels(diff));
    }
    page
}

/// Changes near one another, the first change first, then those farthest from all before them.
fn places(diff: &LayoutDiff) -> Vec<Vec<&Change>> {
    let all: Vec<&Change> = diff.listed.iter().chain(&diff.examples).collect();
    let mut places: Vec<&Change> = all.first().copied().into_iter().collect();
    let mut nearest = vec![f64::INFINITY; all.len()];
    while let (Some(last), true) = (places.last(), places.len() < PLACES) {
        for (known, change) in nearest.iter_mut().zip(&all) {
            *known = known.min(apart(last, change));
        }
        let farthest = (0..all.len()).max_by(|&a, &b| nearest[a].total_cmp(&nearest[b]).then(b.cmp(&a)));
        match farthest.filter(|&k| nearest[k] > SPAN_NM) {
            Some(k) => places.push(all[k]),
            None => break,
        }
    }
    places.into_iter().map(|place| near(place, &all)).collect()
}

/// Extent along x or y, whichever is more, from one change to another (nm).
fn apart(a: &Change, b: &Change) -> f64 {
    let along = |axis: usize| (a.bounds_nm[axis] - b.bounds_nm[axis]).abs();
    along(0).max(along(1))
}

/// A change and those near it.
fn near<'d>(place: &'d Change, all: &[&'d Change]) -> Vec<&'d Change> {
    let mut own: Vec<&Change> = all.iter().copied().filter(|c| apart(place, c) < SPAN_NM).collect();
    // An example may be listed too.
    own.sort_by(|a, b| {
        a.bounds_nm
            .partial_cmp(&b.bounds_nm)
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    own.dedup();
    own.retain(|c| *c != place);
    own.insert(0, place);
    own
}

fn heat(diff: &LayoutDiff, places: &[Vec<&Change>]) -> metalith_report::Figure {
    let map = &diff.map;
    let [x0, y0, x1, y1] = map.bounds_nm.map(|v| v * 1e-3);
    let values = Array2::from_shape_fn((map.rows, map.columns), |(row, column)| {
        map.counts[row * map.columns + column] as f64
    });
    let mut map = HeatMap::new(
        "Changes over the layout",
        values,
        (Axis::linear("x", "um"), x0, x1),
        (Axis::linear("y", "um"), y0, y1),
    )
    .to_scale()
    .values("places that differ in a tile", "");
    for (k, changes) in places.iter().enumerate() {
        let [left, bottom, right, top] = changes[0].bounds_nm.map(|v| v * 1e-3);
        map = map.mark((left + right) / 2.0, (bottom + top) / 2.0, (k + 1).to_string());
    }
    map.caption("Every change is counted in the tile that holds its middle. Numbers mark the places drawn below.")
}

/// Changes near one another.
fn shapes(diff: &LayoutDiff, changes: &[&Change], place: usize) -> metalith_report::Figure {
    let [x, y] = [0, 1].map(|axis| fixed(changes[0].bounds_nm[axis] * 1e-3, 3));
    let mut plan = Plan::new(format!("{place}: changes near ({x}, {y}) um"));
    let mut layers = Vec::new();
    let drawn = changes.len().min(DRAWN);
    for c in &changes[..drawn] {
        let layer = if let Some((_, layer)) = layers.iter().find(|(what, _)| *what == c.what) {
            *layer
        } else {
            let layer = plan.layer(c.what);
            layers.push((c.what, layer));
            layer
        };
        let b = c.bounds_nm.map(|v| v * 1e-3);
        plan.rectangle(layer, (b[0], b[1]), (b[2], b[3]));
    }
    // One pillar alone would fill the figure.
    let [left, bottom, right, top] = changes[0].bounds_nm.map(|v| v * 1e-3);
    plan.reach(left - AROUND_UM, bottom - AROUND_UM)
        .reach(right + AROUND_UM, top + AROUND_UM);
    plan.caption(format!(
        "{drawn} of {} changes, all within 20 um of the mark along x and y.",
        count(diff.changes)
    ))
}

/// Shapes of both layouts that are at another place or of another size.
fn moved(diff: &LayoutDiff) -> Table {
    let mut table = Table::new([
        Column::text("Layer"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::text("Change from a to b"),
    ]);
    for change in diff.listed.iter().filter(|c| !c.words().is_empty()).take(LABELS) {
        let [x0, y0, x1, y1] = change.bounds_nm;
        table.row([
            Cell::from(change.layer.to_string()),
            Cell::from(fixed(f64::midpoint(x0, x1) * 1e-3, 3)),
            Cell::from(fixed(f64::midpoint(y0, y1) * 1e-3, 3)),
            Cell::from(change.words()),
        ]);
    }
    table
}

/// Texts and references to missing cells that only one layout has.
fn labels(diff: &LayoutDiff) -> Table {
    let mut table = Table::new([
        Column::text("Only in"),
        Column::text("What"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::verdict(),
    ]);
    let mut row = |which: &str, what: String, at_nm: [f64; 2]| {
        let [x, y] = at_nm.map(|v| fixed(v * 1e-3, 3));
        table.row([
            Cell::from(which),
            Cell::from(what),
            Cell::from(x),
            Cell::from(y),
            Cell::from(Verdict::of(false)),
        ]);
    };
    for (which, texts, missing) in [
        ("a", &diff.texts_only_in_a, &diff.missing.only_in_a),
        ("b", &diff.texts_only_in_b, &diff.missing.only_in_b),
    ] {
        for text in texts.iter().take(LABELS) {
            row(which, format!("text \"{}\" on {}", text.string, text.layer), text.at_nm);
        }
        for reference in missing.iter().take(LABELS) {
            row(
                which,
                format!("reference to {}, which the file does not have", reference.cell),
                reference.at_nm,
            );
        }
    }
    table
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
        Column::number("Moved or resized", ""),
        Column::number("Largest move", "nm"),
        Column::number("Largest change of width", "nm"),
        Column::number("rms change", "nm"),
        Column::verdict(),
    ]);
    for e in &diff.elements {
        let count = |n: u64| Cell::from(count(n));
        table.row([
            Cell::from(e.name.as_str()),
            count(e.pillars[0]),
            count(e.pillars[1]),
            count(e.added),
            count(e.removed),
            count(e.widened),
            count(e.narrowed),
            count(e.moved),
            Cell::exact(e.largest_move_nm),
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
        Column::number("Moved or resized", ""),
        Column::number("Pillars that differ", ""),
        Column::verdict(),
    ]);
    let changed: u64 = diff.elements.iter().map(super::report::ElementDiff::changed).sum();
    for l in &diff.layers {
        // Pillars on lattices are no outlines.
        let pillars = if l.layer == diff.pillar_layer { changed } else { 0 };
        let count = |n: u64| Cell::from(count(n));
        table.row([
            Cell::from(l.layer.to_string()),
            count(l.shapes[0]),
            count(l.shapes[1]),
            count(l.only_in_a),
            count(l.only_in_b),
            count(l.moved),
            count(pillars),
            Cell::from(Verdict::of(l.same_area && pillars == 0)),
        ]);
    }
    table
}
