//! Whether two sets of shapes with sides along the axes cover the same area, however it is cut up.

use metalith_gds::Point;

/// Shapes that are compared this way; the work grows with their square.
const MOST: usize = 4000;

/// Whether both sets of rings cover the same area; none if that cannot be told: a side that is not along
/// an axis, or too many shapes.
pub(super) fn same_cover(a: &[Vec<Point>], b: &[Vec<Point>]) -> Option<bool> {
    let all = || a.iter().chain(b);
    let sides = |ring: &Vec<Point>| {
        (0..ring.len())
            .map(|k| (ring[k], ring[(k + 1) % ring.len()]))
            .collect::<Vec<_>>()
    };
    if a.len() + b.len() > MOST || all().flat_map(sides).any(|(p, q)| p.x != q.x && p.y != q.y) {
        return None;
    }
    let mut levels: Vec<i64> = all().flatten().map(|p| p.y).collect();
    levels.sort_unstable();
    levels.dedup();
    Some(levels.windows(2).all(|slab| covered(a, slab[0]) == covered(b, slab[0])))
}

/// Intervals along x that a set covers just above a level, merged.
fn covered(rings: &[Vec<Point>], level: i64) -> Vec<(i64, i64)> {
    let mut spans: Vec<(i64, i64)> = Vec::new();
    for ring in rings {
        // Upright sides that pass through; between the first and second the ring is inside, and so on.
        let mut sides: Vec<i64> = (0..ring.len())
            .map(|k| (ring[k], ring[(k + 1) % ring.len()]))
            .filter(|(p, q)| p.x == q.x && p.y.min(q.y) <= level && p.y.max(q.y) > level)
            .map(|(p, _)| p.x)
            .collect();
        sides.sort_unstable();
        spans.extend(sides.chunks_exact(2).map(|s| (s[0], s[1])));
    }
    spans.sort_unstable();
    let mut merged: Vec<(i64, i64)> = Vec::new();
    for (from, to) in spans.into_iter().filter(|(from, to)| from < to) {
        match merged.last_mut() {
            Some(last) if from <= last.1 => last.1 = last.1.max(to),
            _ => merged.push((from, to)),
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x0: i64, y0: i64, x1: i64, y1: i64) -> Vec<Point> {
        [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
            .map(|(x, y)| Point::new(x, y))
            .to_vec()
    }

    #[test]
    fn cut_up_differently() {
        let whole = [rect(0, 0, 10, 10)];
        assert_eq!(same_cover(&whole, &[rect(0, 0, 4, 10), rect(4, 0, 10, 10)]), Some(true));
        assert_eq!(
            same_cover(&whole, &[rect(0, 0, 4, 10), rect(5, 0, 10, 10)]),
            Some(false)
        );
        let l = [(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)]
            .map(|(x, y)| Point::new(x, y))
            .to_vec();
        assert_eq!(
            same_cover(std::slice::from_ref(&l), &[rect(0, 0, 10, 5), rect(0, 3, 5, 10)]),
            Some(true)
        );
        assert_eq!(same_cover(&[l], &whole), Some(false));
        let slanted = [Point::new(0, 0), Point::new(5, 1), Point::new(0, 9)].to_vec();
        assert_eq!(same_cover(&[slanted], &whole), None);
    }
}
