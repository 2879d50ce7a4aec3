//! Comparison of the nesting of two layouts.

use std::collections::{BTreeMap, BTreeSet};

use super::report::{ReferenceChange, TreeDiff};
use metalith_gds::Layout;

/// Cells by name, and references by (cell, child): names and numbers, not places.
pub(super) fn compare(a: &Layout, b: &Layout, listed: usize) -> TreeDiff {
    let names = |l: &Layout| l.cells().iter().map(|c| c.name.clone()).collect::<BTreeSet<_>>();
    let (in_a, in_b) = (names(a), names(b));
    let references = |l: &Layout| {
        let mut counts: BTreeMap<(String, String), u64> = BTreeMap::new();
        for cell in l.cells() {
            for child in &cell.children {
                *counts.entry((cell.name.clone(), child.name.clone())).or_default() += child.copies;
            }
        }
        counts
    };
    let (from_a, from_b) = (references(a), references(b));
    let keys: BTreeSet<_> = from_a.keys().chain(from_b.keys()).collect();
    let changes: Vec<ReferenceChange> = keys
        .into_iter()
        .map(|key| ReferenceChange {
            cell: key.0.clone(),
            child: key.1.clone(),
            a: from_a.get(key).copied().unwrap_or(0),
            b: from_b.get(key).copied().unwrap_or(0),
        })
        .filter(|c| c.a != c.b)
        .collect();
    let tops = |l: &Layout| l.tops().iter().map(|&t| l.cells()[t].name.clone()).collect::<Vec<_>>();
    TreeDiff {
        same: in_a == in_b && changes.is_empty(),
        cells: [a.cells().len(), b.cells().len()],
        levels: [a.depth() + 1, b.depth() + 1],
        tops: [tops(a).join(", "), tops(b).join(", ")],
        cells_only_in_a: in_a.difference(&in_b).take(listed).cloned().collect(),
        cells_only_in_b: in_b.difference(&in_a).take(listed).cloned().collect(),
        references_changed: changes.len(),
        references: changes.into_iter().take(listed).collect(),
    }
}
