//! Plane geometry of outlines in whole database units: exact.

use std::cell::OnceCell;

use metalith_gds::{LayerNumber, Point, Rect, ShapeKind, Transform, simplified};

/// One outline of a cell as it is drawn, with what rules ask of it computed when first asked.
pub(super) struct Outline<'a> {
    pub layer: LayerNumber,
    pub kind: ShapeKind,
    pub points: &'a [Point],
    pub rect: Option<Rect>,
    pub placements: &'a [Transform],
    pub unit_nm: f64,
    simple: OnceCell<Vec<Point>>,
    crosses: OnceCell<bool>,
}

impl<'a> Outline<'a> {
    pub fn new(shape: &metalith_gds::Shape<'a>, placements: &'a [Transform], unit_nm: f64) -> Self {
        Self {
            layer: shape.layer,
            kind: shape.kind,
            points: shape.points,
            rect: shape.rect,
            placements,
            unit_nm,
            simple: OnceCell::new(),
            crosses: OnceCell::new(),
        }
    }

    /// Corners alone, closed.
    pub fn corners(&self) -> &[Point] {
        self.simple.get_or_init(|| simplified(self.points))
    }

    /// Twice the area, positive if counter-clockwise.
    pub fn twice_area(&self) -> i128 {
        twice_area(self.points)
    }

    pub fn bounds(&self) -> Rect {
        self.rect.unwrap_or_else(|| Rect::around(self.points))
    }

    /// The upright rectangle that its corners make.
    pub fn rectangle(&self) -> Option<Rect> {
        self.rect.or_else(|| metalith_gds::rectangle_of(self.corners()))
    }

    /// Whether two sides cross, or touch where they should not.
    pub fn crosses_itself(&self) -> bool {
        *self
            .crosses
            .get_or_init(|| self.rect.is_none() && crosses_itself(self.corners()))
    }

    /// Whether all sides are along the axes.
    pub fn is_manhattan(&self) -> bool {
        self.rect.is_some() || self.corners().windows(2).all(|s| s[0].x == s[1].x || s[0].y == s[1].y)
    }

    /// Smallest interior or exterior angle between two sides [degrees]; 180 if there is no corner.
    pub fn sharpest_deg(&self) -> f64 {
        let c = self.corners();
        if c.len() < 4 {
            return if c.is_empty() { 180.0 } else { 0.0 };
        }
        let n = c.len() - 1;
        (0..n)
            .map(|k| {
                let (a, b, d) = (c[(k + n - 1) % n], c[k], c[k + 1]);
                let (ux, uy) = ((a.x - b.x) as f64, (a.y - b.y) as f64);
                let (vx, vy) = ((d.x - b.x) as f64, (d.y - b.y) as f64);
                (ux * vy - uy * vx).abs().atan2(ux * vx + uy * vy).to_degrees()
            })
            .fold(180.0, f64::min)
    }
}

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
fn side(a: Point, b: Point, p: Point) -> i128 {
    i128::from(b.x - a.x) * i128::from(p.y - a.y) - i128::from(b.y - a.y) * i128::from(p.x - a.x)
}

fn on_segment(a: Point, b: Point, p: Point) -> bool {
    side(a, b, p) == 0 && p.x >= a.x.min(b.x) && p.x <= a.x.max(b.x) && p.y >= a.y.min(b.y) && p.y <= a.y.max(b.y)
}

/// Whether two segments share a point.
fn meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    cross(a, b, c, d) || on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)
}

/// Whether two segments cross at a point inside both.
fn cross(a: Point, b: Point, c: Point, d: Point) -> bool {
    let (s1, s2) = (side(a, b, c).signum(), side(a, b, d).signum());
    let (s3, s4) = (side(c, d, a).signum(), side(c, d, b).signum());
    s1 * s2 < 0 && s3 * s4 < 0
}

/// Whether a closed ring of corners crosses or overlaps itself. One that only touches itself does not: a hole
/// drawn with a slit is a good outline.
fn crosses_itself(ring: &[Point]) -> bool {
    if ring.len() < 5 {
        return false;
    }
    let n = ring.len() - 1;
    let mut sides: Vec<usize> = (0..n).collect();
    let left = |k: usize| ring[k].x.min(ring[k + 1].x);
    let right = |k: usize| ring[k].x.max(ring[k + 1].x);
    sides.sort_unstable_by_key(|&k| left(k));
    let mut touches = false;
    for (at, &i) in sides.iter().enumerate() {
        for &j in sides[at + 1..].iter().take_while(|&&j| left(j) <= right(i)) {
            let neighbours = (i + 1) % n == j || (j + 1) % n == i;
            if !neighbours && cross(ring[i], ring[i + 1], ring[j], ring[j + 1]) {
                return true;
            }
            touches |= !neighbours && meet(ring[i], ring[i + 1], ring[j], ring[j + 1]);
        }
    }
    touches && winds_twice(ring)
}

/// Whether a closed ring whose sides meet at vertices alone goes round some place twice, or round one place
/// to the left and round another to the right. Between two neighbouring heights of vertices its sides keep
/// their order, and the turns about each place are counted from the left.
fn winds_twice(ring: &[Point]) -> bool {
    let mut heights: Vec<i64> = ring.iter().map(|p| p.y).collect();
    heights.sort_unstable();
    heights.dedup();
    let (mut least, mut most) = (0, 0);
    for slab in heights.windows(2) {
        let twice_y = slab[0] + slab[1];
        let mut sides: Vec<(Fraction, i32)> = ring
            .windows(2)
            .filter(|s| s[0].y.min(s[1].y) <= slab[0] && s[0].y.max(s[1].y) >= slab[1])
            .map(|s| {
                let rise = 2 * i128::from(s[1].y - s[0].y);
                let x = i128::from(s[0].x) * rise + i128::from(s[1].x - s[0].x) * i128::from(twice_y - 2 * s[0].y);
                (Fraction::new(x, rise), if rise > 0 { -1 } else { 1 })
            })
            .collect();
        sides.sort_unstable_by_key(|side| side.0);
        let mut turns = 0;
        for sides_at_one_place in sides.chunk_by(|a, b| a.0 == b.0) {
            turns += sides_at_one_place.iter().map(|s| s.1).sum::<i32>();
            (least, most) = (least.min(turns), most.max(turns));
        }
    }
    most - least > 1
}

/// An exact place on a level line: a whole number and a proper fraction.
#[derive(Clone, Copy)]
struct Fraction {
    whole: i128,
    over: i128,
    under: i128,
}

impl Fraction {
    fn new(over: i128, under: i128) -> Self {
        let (over, under) = (over * under.signum(), under.abs());
        Self {
            whole: over.div_euclid(under),
            over: over.rem_euclid(under),
            under,
        }
    }
}

impl Ord for Fraction {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let proper = || (self.over * other.under).cmp(&(other.over * self.under));
        self.whole.cmp(&other.whole).then_with(proper)
    }
}

impl PartialOrd for Fraction {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Fraction {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Fraction {}

/// Whether a point is inside a closed ring (not on its edge).
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

/// Whether two closed rings share area.
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
