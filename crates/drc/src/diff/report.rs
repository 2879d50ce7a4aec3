//! The report of a comparison.

use std::fmt::Write;

use metalith_pillars::Pitch;
use metalith_report::{count, counted, exact};
use serde::Serialize;

use metalith_core::text::printable;
use metalith_gds::LayerNumber;

/// Pillars of one element in both layouts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElementDiff {
    pub name: String,
    pub centre_nm: [i64; 2],
    /// Sites an axis and their distance: the frame of the counts.
    pub sites: usize,
    pub pitch_nm: Pitch,
    pub pillars: [u64; 2],
    /// Sites with a pillar only in the second layout.
    pub added: u64,
    /// Sites with a pillar only in the first layout.
    pub removed: u64,
    pub widened: u64,
    pub narrowed: u64,
    /// Number of sites of rectangles whose pillar is rotated otherwise; their edges are equal.
    #[serde(skip_serializing_if = "is_zero")]
    pub rotated: u64,
    /// Pillars that both layouts have, in the second less than a pitch away or of another size, off the site.
    #[serde(skip_serializing_if = "is_zero")]
    pub moved: u64,
    /// Largest distance along an axis that a pillar was moved by (nm).
    #[serde(skip_serializing_if = "is_still")]
    pub largest_move_nm: f64,
    /// Largest change of width where both have a pillar (nm).
    pub largest_change_nm: u16,
    /// Root of the mean squared change over all sites where both have a pillar (nm).
    pub rms_change_nm: f64,
}

fn is_still(nm: &f64) -> bool {
    *nm == 0.0
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl ElementDiff {
    /// Sites that differ.
    pub fn changed(&self) -> u64 {
        self.added + self.removed + self.widened + self.narrowed + self.rotated + self.moved
    }
}

/// One layer in both layouts, pillars on lattices left out of the outlines.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerDiff {
    pub layer: LayerNumber,
    /// All areas, references followed.
    pub shapes: [u64; 2],
    /// Outlines that only one of the layouts has.
    pub only_in_a: u64,
    pub only_in_b: u64,
    /// Outlines that both layouts have, moved or resized by less than a pitch.
    #[serde(skip_serializing_if = "is_zero")]
    pub moved: u64,
    /// True if the outlines that differ cover the same area, only cut up differently.
    pub same_area: bool,
}

/// One text.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextAt {
    pub layer: LayerNumber,
    pub string: String,
    pub at_nm: [f64; 2],
}

/// A reference to a cell that the layout does not have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MissingAt {
    pub cell: String,
    pub at_nm: [f64; 2],
}

/// References to cells that the layouts do not have: compared by name and place, since nothing is known of what they hold.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MissingDiff {
    pub in_both: u64,
    /// References that only one of the layouts has, all of them.
    pub apart: [u64; 2],
    /// The first of them.
    pub only_in_a: Vec<MissingAt>,
    pub only_in_b: Vec<MissingAt>,
}

impl MissingDiff {
    /// True if all cells that are referred to are there.
    pub fn is_none(&self) -> bool {
        self.in_both == 0 && self.apart == [0, 0]
    }
}

/// One place that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// `added`, `removed`, `widened`, `narrowed`, `rotated` for pillars; `only in a`, `only in b` for other outlines;
    /// `moved`, `resized`, `moved and resized` for a shape of both.
    pub what: &'static str,
    pub layer: LayerNumber,
    /// Left, bottom, right, top (nm).
    pub bounds_nm: [f64; 4],
    /// Widths of a pillar (nm), zero where there is none.
    pub width_nm: Option<[u16; 2]>,
    /// Move of a shape of both along x and y (nm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moved_nm: Option<[f64; 2]>,
    /// Extents of a shape of both along x and y in each layout (nm), if they differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_nm: Option<[[f64; 2]; 2]>,
}

impl Change {
    /// Change of place and size in words: `moved by (1, 0) nm, width 150 -> 151 nm`; empty for a shape of one layout.
    pub fn words(&self) -> String {
        let moved = self.moved_nm.map(|[dx, dy]| format!("moved by ({dx}, {dy}) nm"));
        let size = self.size_nm.map(|[[a, b], [c, d]]| {
            if a == b && c == d {
                format!("width {a} -> {c} nm")
            } else {
                format!("{a} x {b} -> {c} x {d} nm")
            }
        });
        moved.into_iter().chain(size).collect::<Vec<_>>().join(", ")
    }
}

/// References of one cell to another, arrays counted out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReferenceChange {
    pub cell: String,
    pub child: String,
    pub a: u64,
    pub b: u64,
}

/// Difference of the nesting of two layouts.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TreeDiff {
    /// True if both have the same cells and as many references of each to each.
    pub same: bool,
    pub cells: [usize; 2],
    pub levels: [u32; 2],
    pub tops: [String; 2],
    pub cells_only_in_a: Vec<String>,
    pub cells_only_in_b: Vec<String>,
    pub references_changed: usize,
    pub references: Vec<ReferenceChange>,
}

/// Map of changes: counts in a grid of square tiles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChangeMap {
    /// Left, bottom, right, top of all geometry (nm).
    pub bounds_nm: [f64; 4],
    pub columns: usize,
    pub rows: usize,
    /// Changes in each tile, row by row from the bottom; empty if there are none.
    pub counts: Vec<u64>,
}

/// Differences of two layouts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayoutDiff {
    pub a: String,
    pub b: String,
    pub same_bytes: bool,
    /// Every layer covers the same area with as many exposures, and all texts are the same.
    pub same_geometry: bool,
    pub tree: TreeDiff,
    /// Layer that the pillars of the elements are on.
    #[serde(skip)]
    pub pillar_layer: LayerNumber,
    pub elements: Vec<ElementDiff>,
    pub layers: Vec<LayerDiff>,
    /// Texts that only one of the layouts has, all of them.
    pub texts_apart: [u64; 2],
    /// The first of them.
    pub texts_only_in_a: Vec<TextAt>,
    pub texts_only_in_b: Vec<TextAt>,
    #[serde(skip_serializing_if = "MissingDiff::is_none")]
    pub missing: MissingDiff,
    /// Places that differ, all of them.
    pub changes: u64,
    /// The first of them.
    pub listed: Vec<Change>,
    /// The first of each tile of the map, tile by tile.
    #[serde(skip)]
    pub examples: Vec<Change>,
    pub map: ChangeMap,
}

/// Plain text.
pub fn text(diff: &LayoutDiff) -> String {
    const SHOWN: usize = 10;
    let mut out = String::new();
    let yes = |b: bool| if b { "same" } else { "different" };
    let _ = writeln!(out, "a: {}\nb: {}\n", printable(&diff.a), printable(&diff.b));
    let _ = writeln!(
        out,
        "bytes {}, hierarchy {}, geometry {}",
        yes(diff.same_bytes),
        yes(diff.tree.same),
        yes(diff.same_geometry)
    );
    for e in &diff.elements {
        if e.changed() == 0 {
            continue;
        }
        let _ = writeln!(
            out,
            "{} at ({:.1}, {:.1}) um: {} added, {} removed, {} widened, {} narrowed{}{} of {}; largest change of width {} nm, rms {:.4} nm{}",
            e.name,
            e.centre_nm[0] as f64 * 1e-3,
            e.centre_nm[1] as f64 * 1e-3,
            count(e.added),
            count(e.removed),
            count(e.widened),
            count(e.narrowed),
            if e.rotated > 0 {
                format!(", {} rotated", count(e.rotated))
            } else {
                String::new()
            },
            if e.moved > 0 {
                format!(", {} moved or resized", count(e.moved))
            } else {
                String::new()
            },
            count(e.pillars[0]),
            e.largest_change_nm,
            e.rms_change_nm,
            if e.largest_move_nm > 0.0 {
                format!("; moved by up to {} nm", exact(e.largest_move_nm))
            } else {
                String::new()
            }
        );
    }
    for l in diff.layers.iter().filter(|l| l.only_in_a + l.only_in_b + l.moved > 0) {
        let _ = writeln!(
            out,
            "layer {}: {} only in a, {} only in b{}{}",
            l.layer,
            counted(l.only_in_a as usize, "outline"),
            count(l.only_in_b),
            if l.moved > 0 {
                format!(", {} moved or resized", count(l.moved))
            } else {
                String::new()
            },
            if l.same_area { ", which cover the same area" } else { "" }
        );
    }
    for (which, texts) in [("a", &diff.texts_only_in_a), ("b", &diff.texts_only_in_b)] {
        for t in texts.iter().take(SHOWN) {
            let [x, y] = t.at_nm.map(|v| v * 1e-3);
            let _ = writeln!(
                out,
                "text only in {which}: \"{}\" on {} at ({x:.3}, {y:.3}) um",
                t.string, t.layer
            );
        }
    }
    for (which, apart) in [("a", diff.texts_apart[0]), ("b", diff.texts_apart[1])] {
        if apart > SHOWN as u64 {
            let _ = writeln!(out, "and {} more texts only in {which}", count(apart - SHOWN as u64));
        }
    }
    if diff.missing.in_both > 0 {
        let _ = writeln!(
            out,
            "{} to cells that neither file has, the same in both; what they hold was not compared",
            counted(diff.missing.in_both as usize, "reference")
        );
    }
    let missing = [&diff.missing.only_in_a, &diff.missing.only_in_b];
    for ((which, list), apart) in ["a", "b"].into_iter().zip(missing).zip(diff.missing.apart) {
        for m in list.iter().take(SHOWN) {
            let [x, y] = m.at_nm.map(|v| v * 1e-3);
            let _ = writeln!(
                out,
                "only in {which}: a reference to {}, which the file does not have, at ({x:.3}, {y:.3}) um",
                m.cell
            );
        }
        if apart > SHOWN as u64 {
            let _ = writeln!(
                out,
                "and {} more such references only in {which}",
                count(apart - SHOWN as u64)
            );
        }
    }
    for c in diff.listed.iter().take(SHOWN) {
        let b = c.bounds_nm.map(|v| v * 1e-3);
        let widths = c
            .width_nm
            .map_or_else(String::new, |[a, b]| format!(", {a} to {b} nm wide"));
        let words = c.words();
        let between = if words.is_empty() { "" } else { ", " };
        let _ = writeln!(
            out,
            "  {} on {}: ({:.3}, {:.3}) to ({:.3}, {:.3}) um{widths}{between}{words}",
            c.what, c.layer, b[0], b[1], b[2], b[3]
        );
    }
    if diff.changes > SHOWN as u64 {
        let _ = writeln!(out, "  and {} more", count(diff.changes - SHOWN as u64));
    }
    if !diff.tree.same {
        let t = &diff.tree;
        let _ = writeln!(
            out,
            "cells: {} in {}, {} in {}; {} of cells with another number of references",
            t.cells[0],
            counted(t.levels[0] as usize, "level"),
            t.cells[1],
            counted(t.levels[1] as usize, "level"),
            counted(t.references_changed, "pair")
        );
    }
    out
}
