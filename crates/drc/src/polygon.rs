//! Plane geometry of outlines in whole database units: exact.

use metalith_gds::{Point, Rect};

/// Twice the area of a ring, closed or not.
pub(super) fn twice_area(ring: &[Point]) -> i128 {
    let mut sum = 0;
    for (k, p) in ring.iter().enumerate() {
        let q = ring[(k + 1) % ring.len()];
        sum += i128::from(p.x) * i128::from(q.y) - i128::from(q.x) * i128::from(p.y);
    }
    sum
}

/// Side of `p` on the line from `a` to `b`: positive on the left.
pub(super) fn side(a: Point, b: Point, p: Point) -> i128 {
    i128::from(b.x - a.x) * i128::from(p.y - a.y) - i128::from(b.y - a.y) * i128::from(p.x - a.x)
}

pub(super) fn on_segment(a: Point, b: Point, p: Point) -> bool {
    side(a, b, p) == 0 && p.x >= a.x.min(b.x) && p.x <= a.x.max(b.x) && p.y >= a.y.min(b.y) && p.y <= a.y.max(b.y)
}

/// True if two segments share a point.
fn meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    cross(a, b, c, d) || on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)
}

/// True if two segments cross at a point inside both.
pub(super) fn cross(a: Point, b: Point, c: Point, d: Point) -> bool {
    let (s1, s2) = (side(a, b, c).signum(), side(a, b, d).signum());
    let (s3, s4) = (side(c, d, a).signum(), side(c, d, b).signum());
    s1 * s2 < 0 && s3 * s4 < 0
}

/// True if a point is inside a closed ring (not on its edge).
pub(super) fn inside(ring: &[Point], p: Point) -> bool {
    let mut within = false;
    for s in ring.windows(2) {
        let (a, b) = (s[0], s[1]);
        if on_segment(a, b, p) {
            return false;
        }
        if (a.y > p.y) != (b.y > p.y) {
            let left = side(a, b, p) > 0;
            if left == (b.y > a.y) {
                within = !within;
            }
        }
    }
    within
}

/// Distance of a point from a segment.
pub(super) fn point_segment(p: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = ((b.x - a.x) as f64, (b.y - a.y) as f64);
    let (px, py) = ((p.x - a.x) as f64, (p.y - a.y) as f64);
    let length2 = dx * dx + dy * dy;
    let t = if length2 == 0.0 {
        0.0
    } else {
        ((px * dx + py * dy) / length2).clamp(0.0, 1.0)
    };
    (px - t * dx).hypot(py - t * dy)
}

/// Distance of two closed rings; zero if they meet or one contains the other.
pub(super) fn distance(a: &[Point], b: &[Point]) -> f64 {
    let mut nearest = f64::INFINITY;
    for s in a.windows(2) {
        for t in b.windows(2) {
            if meet(s[0], s[1], t[0], t[1]) {
                return 0.0;
            }
            nearest = nearest
                .min(point_segment(s[0], t[0], t[1]))
                .min(point_segment(s[1], t[0], t[1]))
                .min(point_segment(t[0], s[0], s[1]))
                .min(point_segment(t[1], s[0], s[1]));
        }
    }
    if inside(a, b[0]) || inside(b, a[0]) {
        0.0
    } else {
        nearest
    }
}

/// True if two closed rings share area.
pub(super) fn overlap(a: &[Point], b: &[Point]) -> bool {
    let crossing = a
        .windows(2)
        .any(|s| b.windows(2).any(|t| cross(s[0], s[1], t[0], t[1])));
    crossing
        || b.iter().any(|&p| inside(a, p))
        || a.iter().any(|&p| inside(b, p))
        || middles(a).any(|p| inside(b, p) && inside(a, p))
        || middles(b).any(|p| inside(a, p) && inside(b, p))
}

/// Places between a corner and the next but one: for outlines that share all their edges.
fn middles(ring: &[Point]) -> impl Iterator<Item = Point> + '_ {
    ring.windows(3)
        .map(|c| Point::new(c[0].x + (c[2].x - c[0].x) / 2, c[0].y + (c[2].y - c[0].y) / 2))
}

/// The corners of a rectangle, closed, counter-clockwise.
pub(super) fn ring_of(r: &Rect) -> [Point; 5] {
    let p = Point::new;
    [
        p(r.x0, r.y0),
        p(r.x1, r.y0),
        p(r.x1, r.y1),
        p(r.x0, r.y1),
        p(r.x0, r.y0),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::winding::crosses_itself;
    use super::*;

    fn ring(points: &[(i64, i64)]) -> Vec<Point> {
        points
            .iter()
            .chain(points.first())
            .map(|&(x, y)| Point::new(x, y))
            .collect()
    }

    #[test]
    fn crossings_distances_and_insides() {
        let square = ring(&[(0, 0), (10, 0), (10, 10), (0, 10)]);
        let bow = ring(&[(0, 0), (10, 10), (10, 0), (0, 20)]);
        assert!(!crosses_itself(&square) && crosses_itself(&bow));
        // A hole with a slit, two squares that share a corner, and a spike touch; a loop and the same square
        // twice go round a place twice.
        let slit = [
            (0, 0),
            (9, 0),
            (9, 9),
            (0, 9),
            (0, 5),
            (4, 5),
            (4, 6),
            (6, 6),
            (6, 4),
            (4, 4),
            (4, 5),
            (0, 5),
        ];
        let corner = [(0, 0), (5, 0), (5, 5), (9, 5), (9, 9), (5, 9), (5, 5), (0, 5)];
        let eight = [(0, 0), (5, 0), (5, 5), (5, 9), (9, 9), (9, 5), (5, 5), (0, 5)];
        let spiral = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 3), (6, 3), (6, 6), (0, 6)];
        let twice = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (9, 0), (9, 9), (0, 9)];
        assert!(!crosses_itself(&ring(&slit)) && !crosses_itself(&ring(&corner)) && crosses_itself(&ring(&eight)));
        assert!(crosses_itself(&ring(&spiral)) && crosses_itself(&ring(&twice)));
        assert!(inside(&square, Point::new(5, 5)) && !inside(&square, Point::new(10, 5)));
        let beside = ring(&[(13, 14), (20, 14), (20, 20), (13, 20)]);
        assert_eq!(distance(&square, &beside), 5.0);
        let touching = ring(&[(10, 0), (20, 0), (20, 10), (10, 10)]);
        assert_eq!(distance(&square, &touching), 0.0);
        assert!(!overlap(&square, &touching) && overlap(&square, &square));
        let within = ring(&[(2, 2), (4, 2), (4, 4), (2, 4)]);
        assert!(overlap(&square, &within) && overlap(&within, &square));
        assert_eq!(distance(&square, &within), 0.0);
    }
}
