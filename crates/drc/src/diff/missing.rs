//! References to cells that a layout does not have, by name and place.

use super::compare::apart;
use super::report::{MissingAt, MissingDiff};
use metalith_core::Result;
use metalith_core::text::printable_bytes;
use metalith_gds::{Layout, Point};

/// Length of the axes by which rotations and magnifications are compared (database units): a millionth of each counts.
const AXIS: i64 = 1_000_000;

/// One such reference: name, place in the common unit, ends of the axes of the cell from there (database units).
type Missing = (Vec<u8>, Point, [Point; 2]);

/// The references of both layouts side by side; `unit_nm` is the common unit, to which `factors` lead.
pub(super) fn compare(layouts: [&Layout; 2], factors: [i64; 2], unit_nm: f64, listed: usize) -> Result<MissingDiff> {
    let [a, b] = [0, 1].map(|k| of(layouts[k], factors[k]));
    let (a, b) = (a?, b?);
    let (only_a, only_b) = apart(&a, &b);
    let at = |list: &[&Missing]| -> Vec<MissingAt> {
        let each = list.iter().take(listed).map(|(name, at, _)| MissingAt {
            cell: printable_bytes(name),
            at_nm: [at.x, at.y].map(|v| v as f64 * unit_nm),
        });
        each.collect()
    };
    Ok(MissingDiff {
        in_both: (a.len() - only_a.len()) as u64,
        apart: [only_a.len() as u64, only_b.len() as u64],
        only_in_a: at(&only_a),
        only_in_b: at(&only_b),
    })
}

/// The references of one layout, sorted.
fn of(layout: &Layout, factor: i64) -> Result<Vec<Missing>> {
    let roots = layout.roots(&super::everything())?;
    let mut all: Vec<Missing> = layout
        .missing_cells(&roots)?
        .into_iter()
        .map(|missing| {
            let place = |x, y| missing.transform.apply(Point::new(x, y));
            let origin = place(0, 0);
            let axes = [place(AXIS, 0), place(0, AXIS)].map(|p| Point::new(p.x - origin.x, p.y - origin.y));
            let at = Point::new(origin.x.saturating_mul(factor), origin.y.saturating_mul(factor));
            (missing.name, at, axes)
        })
        .collect();
    all.sort_unstable();
    Ok(all)
}
