//! Shapes of both layouts that are one shape, moved or resized: a shape that only the first has, and the nearest of like size that only
//! the second has.

use std::collections::HashMap;

use super::report::Change;

/// Differences that are held to be paired; of more, each shape is a change of its own.
pub(super) const MOST_HELD: usize = 1 << 19;

/// Largest ratio of the sides of two shapes that may be one.
const LIKE: f64 = 1.5;

/// Least move and change of size (nm): sums of database units are not exact.
const LEAST_NM: f64 = 1e-6;

/// Shapes in one cell of the search that are compared with each of the other layout, at most.
const MOST_NEAR: usize = 64;

/// Where a change is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counted {
    /// Pillar of an element, by its number.
    Element(usize),
    /// Outline on the layer of the change.
    Outline,
    /// Change that is never half of a pair.
    Alone,
}

/// A change, and where it is counted.
pub(super) struct Held {
    pub change: Change,
    pub counted: Counted,
}

/// Layout that alone has the shape of a change: 0 or 1.
pub(super) fn side(change: &Change) -> Option<usize> {
    match change.what {
        "removed" | "only in a" => Some(0),
        "added" | "only in b" => Some(1),
        _ => None,
    }
}

fn centre([x0, y0, x1, y1]: [f64; 4]) -> [f64; 2] {
    [f64::midpoint(x0, x1), f64::midpoint(y0, y1)]
}

fn size([x0, y0, x1, y1]: [f64; 4]) -> [f64; 2] {
    [x1 - x0, y1 - y0]
}

/// Pairs of numbers in a list of changes, the first of each pair in the first layout. Both are on one layer, less than `reach_nm`
/// apart along x and y, and of like size.
pub(super) fn pairs(held: &[Held], reach_nm: f64) -> Vec<[usize; 2]> {
    let of_pairs = |k: &usize| held[*k].counted != Counted::Alone;
    let on_side = |which: usize| {
        let all = (0..held.len()).filter(of_pairs);
        all.filter(move |&k| side(&held[k].change) == Some(which))
    };
    let place = |k: usize| centre(held[k].change.bounds_nm).map(|v| (v / reach_nm).floor() as i64);
    let mut near: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for k in on_side(1) {
        near.entry(place(k)).or_default().push(k);
    }
    let mut found = Vec::new();
    for a in on_side(0) {
        let [column, row] = place(a);
        let mut best: Option<(f64, [i64; 2], usize)> = None;
        for cell in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [column + dx, row + dy])) {
            let listed = near.get(&cell).map_or(&[][..], Vec::as_slice);
            for (at, &b) in listed.iter().take(MOST_NEAR).enumerate() {
                if let Some(apart) = distance(&held[a].change, &held[b].change, reach_nm)
                    && best.is_none_or(|(least, ..)| apart < least)
                {
                    best = Some((apart, cell, at));
                }
            }
        }
        if let Some((_, cell, at)) = best
            && let Some(listed) = near.get_mut(&cell)
        {
            found.push([a, listed.swap_remove(at)]);
        }
    }
    found
}

/// Distance of two shapes that may be one (nm).
fn distance(a: &Change, b: &Change, reach_nm: f64) -> Option<f64> {
    let (from, to) = (size(a.bounds_nm), size(b.bounds_nm));
    let alike = (0..2).all(|axis| from[axis] <= LIKE * to[axis] && to[axis] <= LIKE * from[axis]);
    let (at, then) = (centre(a.bounds_nm), centre(b.bounds_nm));
    let [dx, dy] = [0, 1].map(|axis| (then[axis] - at[axis]).abs());
    let differs = dx > LEAST_NM || dy > LEAST_NM || (0..2).any(|axis| (from[axis] - to[axis]).abs() > LEAST_NM);
    (a.layer == b.layer && alike && differs && dx < reach_nm && dy < reach_nm).then(|| dx.hypot(dy))
}

/// The change of a shape that both layouts have.
pub(super) fn joined(a: &Change, b: &Change) -> Change {
    let (at, then) = (centre(a.bounds_nm), centre(b.bounds_nm));
    let (from, to) = (size(a.bounds_nm), size(b.bounds_nm));
    let exact = |v: f64| (v * 1e4).round() / 1e4;
    let moved = [0, 1].map(|axis| exact(then[axis] - at[axis]));
    let sizes = [from, to].map(|size| size.map(exact));
    let resized = sizes[0] != sizes[1];
    // A shape that grows by one step on a grid has its middle half a step off.
    let by_size = (0..2).all(|axis| moved[axis].abs() <= (sizes[0][axis] - sizes[1][axis]).abs() / 2.0 + LEAST_NM);
    let kept = resized && by_size;
    let [x0, y0, x1, y1] = a.bounds_nm;
    let [u0, v0, u1, v1] = b.bounds_nm;
    Change {
        what: match (resized, kept) {
            (false, _) => "moved",
            (true, true) => "resized",
            (true, false) => "moved and resized",
        },
        layer: a.layer,
        bounds_nm: [x0.min(u0), y0.min(v0), x1.max(u1), y1.max(v1)],
        width_nm: None,
        moved_nm: (!kept).then_some(moved),
        size_nm: resized.then_some(sizes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_gds::LayerNumber;

    fn held(what: &'static str, [x, y]: [f64; 2], width: f64) -> Held {
        let half = width / 2.0;
        Held {
            change: Change {
                what,
                layer: LayerNumber::new(1, 0),
                bounds_nm: [x - half, y - half, x + half, y + half],
                width_nm: None,
                moved_nm: None,
                size_nm: None,
            },
            counted: Counted::Outline,
        }
    }

    #[test]
    fn the_nearest_of_like_size_are_one_shape() {
        let all = [
            held("removed", [0.0, 0.0], 150.0),
            held("only in b", [40.0, 0.0], 150.0),
            held("only in b", [1.0, 0.0], 150.0),
            held("only in b", [0.0, 1.0], 900.0),
            held("only in a", [5000.0, 0.0], 150.0),
            held("only in b", [5000.5, 0.5], 151.0),
            held("only in b", [9000.0, 0.0], 150.0),
        ];
        assert_eq!(pairs(&all, 350.0), [[0, 2], [4, 5]]);
        let moved = joined(&all[0].change, &all[2].change);
        assert_eq!(
            (moved.what, moved.moved_nm, moved.size_nm),
            ("moved", Some([1.0, 0.0]), None)
        );
        let wider = joined(&all[4].change, &all[5].change);
        assert_eq!((wider.what, wider.moved_nm), ("resized", None));
        assert_eq!(wider.size_nm, Some([[150.0; 2], [151.0; 2]]));
    }
}
