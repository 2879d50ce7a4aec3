//! Boxes around everything below a cell, by layer, from the bottom up: nothing is expanded.

use std::collections::{BTreeMap, HashMap};

use crate::cell::LayoutCell;
use crate::extract::survey;
use crate::layout::Layout;
use crate::limits::FARTHEST;
use crate::shape::{Point, Rect};
use crate::transform::Transform;
use crate::tree::Tree;
use crate::visit::Selection;
use crate::{Error, Result};
use metalith_core::{LayerNumber, Progress};

/// Boxes that are placed at most: each layer of each cell once for each rotation by which another refers to it.
const MOST_BOXES: usize = 1 << 23;

/// Boxes around areas, by layer.
pub(super) type LayerBoxes = BTreeMap<LayerNumber, Rect>;

/// Boxes of some cells.
pub(super) struct Boxes {
    /// Around all areas of each cell, in its coordinates.
    pub cells: Vec<Rect>,
    /// Around the areas on each layer, of all roots together.
    pub layers: LayerBoxes,
}

/// True if a cell is placed by other than quarter turns.
pub(super) fn has_turned(layout: &Layout) -> bool {
    let counts = layout.cells().iter().filter_map(|cell| cell.counts.as_deref());
    counts
        .flat_map(|counts| &counts.reaches)
        .any(|reach| !reach.turn.is_square())
}

/// Replaces the boxes of the layers, and of these cells, by those around all shapes as they are placed: boxes around turned boxes are
/// too large. Layouts that have too many copies to be read keep theirs.
pub(super) fn tighten(boxes: &mut Boxes, layout: &Layout, roots: &[usize], progress: &dyn Progress) -> Result<()> {
    let mut layers = LayerBoxes::new();
    for &root in roots {
        let selection = Selection {
            top: Some(layout.cells()[root].name.clone()),
            lenient: true,
            ..Selection::default()
        };
        let found = match survey::boxes(layout, &selection, progress) {
            Ok(found) => found,
            Err(Error::Layout { .. }) => return Ok(()),
            Err(other) => return Err(other),
        };
        boxes.cells[root] = Rect::EMPTY;
        for (layer, around) in found {
            boxes.cells[root].unite(&around);
            layers.entry(layer).or_insert(Rect::EMPTY).unite(&around);
        }
    }
    boxes.layers = layers;
    Ok(())
}

/// Boxes of everything below these cells; `None` if there are too many to be found.
pub(super) fn boxes(layout: &Layout, roots: &[usize]) -> Option<Boxes> {
    let (cells, tree) = (layout.cells(), layout.tree());
    let mut users = vec![0u32; cells.len()];
    let mut found: Vec<LayerBoxes> = vec![LayerBoxes::new(); cells.len()];
    let mut out = Boxes {
        cells: vec![Rect::EMPTY; cells.len()],
        layers: LayerBoxes::new(),
    };
    for child in cells.iter().flat_map(|cell| &cell.children) {
        if let (Some(target), false) = (child.cell, child.cut) {
            users[target] += 1;
        }
    }
    let mut placed = 0;
    for &index in tree.order.iter().rev() {
        let cell = &cells[index];
        let counts = cell.counts.as_deref()?;
        if counts.incomplete {
            return None;
        }
        let own = cell.layers.iter().filter(|(_, tally)| !tally.bounds.is_empty());
        let mut boxes: LayerBoxes = own.map(|(layer, tally)| (*layer, tally.bounds)).collect();
        let target = followed(cell, tree);
        for reach in &counts.reaches {
            let Some(target) = target(reach.number) else { continue };
            placed += found[target].len();
            if placed > MOST_BOXES {
                return None;
            }
            for (&layer, area) in &found[target] {
                let around = swept(&reach.turn, area, &reach.shifts);
                boxes.entry(layer).or_insert(Rect::EMPTY).unite(&around);
            }
        }
        for child in cell.children.iter().filter(|child| !child.cut) {
            if let Some(target) = child.cell {
                users[target] -= 1;
                if users[target] == 0 && !roots.contains(&target) {
                    found[target].clear();
                }
            }
        }
        boxes.values().for_each(|area| out.cells[index].unite(area));
        found[index] = boxes;
    }
    for &root in roots {
        for (&layer, area) in &found[root] {
            out.layers.entry(layer).or_insert(Rect::EMPTY).unite(area);
        }
    }
    Some(out)
}

/// Cell that a reference of `cell` to a name of this number leads to; none where the name has no cell or closes a circle.
pub(super) fn followed<'t>(cell: &LayoutCell, tree: &'t Tree) -> impl Fn(u32) -> Option<usize> + 't {
    // Circles and dangling names are rare, and so is this map.
    let whole = cell.children.iter().all(|child| child.cell.is_some() && !child.cut);
    let followed = cell.children.iter().filter(|child| !whole && !child.cut);
    let followed: HashMap<u32, Option<usize>> = followed.map(|child| (child.number, child.cell)).collect();
    move |number| {
        if whole {
            tree.definitions[number as usize]
        } else {
            followed.get(&number).copied().flatten()
        }
    }
}

/// The box around a box that is turned, then shifted by everything in `shifts`.
fn swept(turn: &Transform, area: &Rect, shifts: &Rect) -> Rect {
    let mut around = Rect::EMPTY;
    for shift in [Point::new(shifts.x0, shifts.y0), Point::new(shifts.x1, shifts.y1)] {
        let placed = turn.moved(shift);
        let [a, b, c, d, _] = area.outline();
        for corner in [a, b, c, d].map(|corner| placed.apply(corner)) {
            let [x, y] = [corner.x, corner.y].map(|v| v.clamp(-FARTHEST, FARTHEST));
            around.include(Point::new(x, y));
        }
    }
    around
}
