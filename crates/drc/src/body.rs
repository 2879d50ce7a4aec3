//! One shape as rules about distances see it.

use super::polygon::{distance, inside, overlap, ring_of, twice_area};
use metalith_gds::{Point, Rect, simplified};
use metalith_pillars::{CHORD_ERROR, Circle, circle_corners};

/// Steps of work of one pair of sides of polygons: four distances of a point from a side.
const SIDES: u64 = 8;

/// One shape of a pair.
#[derive(Clone, Copy)]
pub(super) enum Body<'a> {
    Rect(Rect),
    /// A circle in a square.
    Disc(Rect),
    /// A rotated rectangle, closed.
    Tilted([Point; 5]),
    Ring(&'a [Point]),
}

/// The polygon of a circle in a square, closed.
pub(super) fn disc_ring(r: &Rect) -> Vec<Point> {
    let diameter = u32::try_from(r.width()).unwrap_or(u32::MAX);
    let (x, y) = (r.x0 + r.width() / 2, r.y0 + r.height() / 2);
    let corners = circle_corners(diameter, CHORD_ERROR);
    let ring = corners.iter().chain(corners.first());
    ring.map(|&(dx, dy)| Point::new(x + dx, y + dy)).collect()
}

impl Body<'_> {
    pub(crate) fn bounds(&self) -> Rect {
        match self {
            Self::Rect(r) | Self::Disc(r) => *r,
            Self::Tilted(p) => Rect::around(p),
            Self::Ring(p) => Rect::around(p),
        }
    }

    /// Steps of work that comparing two shapes takes.
    pub(crate) fn effort(&self, other: &Self) -> u64 {
        match (self, other) {
            (Self::Rect(_), Self::Rect(_)) => 1,
            _ => SIDES.saturating_mul(self.sides()).saturating_mul(other.sides()),
        }
    }

    /// Corners, closed.
    pub(crate) fn ring(&self) -> Vec<Point> {
        match self {
            Self::Rect(r) => ring_of(r).to_vec(),
            Self::Disc(r) => disc_ring(r),
            Self::Tilted(p) => p.to_vec(),
            Self::Ring(p) => p.to_vec(),
        }
    }

    /// Euclidean distance; zero if they touch or overlap.
    pub(crate) fn gap(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::Rect(a), Self::Rect(b)) => {
                let (dx, dy) = between(a, b);
                (dx as f64).hypot(dy as f64)
            }
            (Self::Disc(a), Self::Disc(b)) => {
                let apart = |a0: i64, a1: i64, b0: i64, b1: i64| (a0 + a1 - b0 - b1) as f64 / 2.0;
                let between = [apart(a.x0, a.x1, b.x0, b.x1), apart(a.y0, a.y1, b.y0, b.y1)];
                let widths = [a.width() as f64, b.width() as f64];
                Circle::gap_of_widths(widths, between).max(0.0)
            }
            _ => distance(&self.ring(), &other.ring()),
        }
    }

    /// True if a place is inside, not on the edge.
    pub(crate) fn holds(&self, p: Point) -> bool {
        let r = self.bounds();
        let within = p.x > r.x0 && p.x < r.x1 && p.y > r.y0 && p.y < r.y1;
        match self {
            Self::Rect(_) => within,
            Self::Disc(r) => {
                let from_middle = |v: i64, low: i64, high: i64| (2 * v - low - high) as f64;
                from_middle(p.x, r.x0, r.x1).hypot(from_middle(p.y, r.y0, r.y1)) < r.width() as f64
            }
            Self::Tilted(ring) => within && inside(ring, p),
            Self::Ring(ring) => within && inside(ring, p),
        }
    }

    /// Corners, the first not counted twice.
    pub(crate) fn sides(&self) -> u64 {
        match self {
            Self::Rect(_) | Self::Tilted(_) => 4,
            Self::Disc(r) => disc_ring(r).len() as u64 - 1,
            Self::Ring(p) => p.len() as u64 - 1,
        }
    }

    /// True if they share area.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        let (a, b) = (self.bounds(), other.bounds());
        let boxes = a.x0 < b.x1 && b.x0 < a.x1 && a.y0 < b.y1 && b.y0 < a.y1;
        match (self, other) {
            (Self::Rect(_), Self::Rect(_)) => boxes,
            _ => boxes && overlap(&self.ring(), &other.ring()),
        }
    }

    /// True if they are the same area drawn twice.
    pub(crate) fn equals(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Rect(a), Self::Rect(b)) | (Self::Disc(a), Self::Disc(b)) => a == b,
            (Self::Ring(a), Self::Ring(b)) => same_ring(a, b),
            (Self::Tilted(a), Self::Tilted(b)) => same_ring(a, b),
            (Self::Tilted(a), Self::Ring(b)) | (Self::Ring(b), Self::Tilted(a)) => same_ring(a, b),
            (Self::Tilted(a), Self::Rect(b)) | (Self::Rect(b), Self::Tilted(a)) => same_ring(a, &ring_of(b)),
            // A second circle on a site is held as its polygon.
            (Self::Disc(r), Self::Ring(ring)) | (Self::Ring(ring), Self::Disc(r)) => same_ring(&disc_ring(r), ring),
            _ => false,
        }
    }
}

fn same_ring(a: &[Point], b: &[Point]) -> bool {
    let normal = |ring: &[Point]| {
        let mut ring = simplified(ring);
        ring.pop();
        if twice_area(&ring) < 0 {
            ring.reverse();
        }
        let start = (0..ring.len()).min_by_key(|&k| ring[k]).unwrap_or(0);
        ring.rotate_left(start);
        ring
    };
    Rect::around(a) == Rect::around(b) && normal(a) == normal(b)
}

/// Distances of two rectangles along x and y, zero where they overlap.
pub(super) fn between(a: &Rect, b: &Rect) -> (i64, i64) {
    let along = |a0: i64, a1: i64, b0: i64, b1: i64| (b0 - a1).max(a0 - b1).max(0);
    (along(a.x0, a.x1, b.x0, b.x1), along(a.y0, a.y1, b.y0, b.y1))
}
