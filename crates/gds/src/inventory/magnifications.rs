//! Magnifications by which cells stand, from the top down: nothing is expanded.

use super::boxes::followed;
use crate::layout::Layout;

/// The least and the greatest magnification by which each cell stands below these cells. One where references are not known, as of a
/// layout that was not opened by [`Layout::open_counted`], and of cells that do not stand there.
pub(super) fn magnifications(layout: &Layout, roots: &[usize]) -> Vec<[f64; 2]> {
    let (cells, tree) = (layout.cells(), layout.tree());
    let mut found: Vec<Option<[f64; 2]>> = vec![None; cells.len()];
    roots.iter().for_each(|&root| found[root] = Some([1.0; 2]));
    for &index in &tree.order {
        let (Some([least, greatest]), Some(counts)) = (found[index], cells[index].counts.as_deref()) else {
            continue;
        };
        let target = followed(&cells[index], tree);
        for reach in &counts.reaches {
            let Some(target) = target(reach.number) else { continue };
            let own = reach.turn.magnification();
            let [low, high] = found[target].unwrap_or([f64::INFINITY, 0.0]);
            found[target] = Some([low.min(least * own), high.max(greatest * own)]);
        }
    }
    found.into_iter().map(|range| range.unwrap_or([1.0; 2])).collect()
}
