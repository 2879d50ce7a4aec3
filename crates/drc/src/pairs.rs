//! Pairs of shapes that are near one another: a sweep over bounding boxes from below.

use std::collections::BTreeSet;

use super::polygon::{distance, overlap, ring_of};
use super::scene::{Loose, Scene};
use metalith_gds::{LayerNumber, Point, Rect, simplified};

/// Pairs of sides that are looked at before giving up, two rectangles counting as one: a clean layer has few,
/// and ten for each pillar of an array without a lattice are fewer.
const MOST_PAIRS: u64 = 1_000_000_000;

/// One shape of a pair.
#[derive(Clone, Copy)]
pub(super) enum Body<'a> {
    Rect(Rect),
    Ring(&'a [Point]),
}

impl Body<'_> {
    pub fn bounds(&self) -> Rect {
        match self {
            Self::Rect(r) => *r,
            Self::Ring(p) => Rect::around(p),
        }
    }

    /// Pairs of sides that comparing two shapes takes.
    fn effort(&self, other: &Self) -> u64 {
        let sides = |body: &Self| match body {
            Self::Rect(_) => 4,
            Self::Ring(p) => p.len() as u64,
        };
        match (self, other) {
            (Self::Rect(_), Self::Rect(_)) => 1,
            _ => sides(self) * sides(other),
        }
    }

    /// Its corners, closed.
    pub fn ring(&self) -> Vec<Point> {
        match self {
            Self::Rect(r) => ring_of(r).to_vec(),
            Self::Ring(p) => p.to_vec(),
        }
    }

    /// Euclidean distance; zero if they touch or overlap.
    pub fn gap(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::Rect(a), Self::Rect(b)) => {
                let (dx, dy) = between(a, b);
                (dx as f64).hypot(dy as f64)
            }
            _ => distance(&self.ring(), &other.ring()),
        }
    }

    /// Whether they share area.
    pub fn overlaps(&self, other: &Self) -> bool {
        let (a, b) = (self.bounds(), other.bounds());
        let boxes = a.x0 < b.x1 && b.x0 < a.x1 && a.y0 < b.y1 && b.y0 < a.y1;
        match (self, other) {
            (Self::Rect(_), Self::Rect(_)) => boxes,
            _ => boxes && overlap(&self.ring(), &other.ring()),
        }
    }

    /// Whether they are the same area drawn twice.
    pub fn equals(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Rect(a), Self::Rect(b)) => a == b,
            (Self::Ring(a), Self::Ring(b)) => same_ring(a, b),
            _ => false,
        }
    }
}

fn same_ring(a: &[Point], b: &[Point]) -> bool {
    let normal = |ring: &[Point]| {
        let mut ring = simplified(ring);
        ring.pop();
        if super::polygon::twice_area(&ring) < 0 {
            ring.reverse();
        }
        let start = (0..ring.len()).min_by_key(|&k| ring[k]).unwrap_or(0);
        ring.rotate_left(start);
        ring
    };
    a.len() == b.len() && Rect::around(a) == Rect::around(b) && normal(a) == normal(b)
}

/// Distances of two rectangles along x and y, zero where they overlap.
fn between(a: &Rect, b: &Rect) -> (i64, i64) {
    let along = |a0: i64, a1: i64, b0: i64, b1: i64| (b0 - a1).max(a0 - b1).max(0);
    (along(a.x0, a.x1, b.x0, b.x1), along(a.y0, a.y1, b.y0, b.y1))
}

/// The rectangle between two shapes, or where they overlap: where to look.
pub(super) fn place(a: &Rect, b: &Rect) -> Rect {
    let along = |a0: i64, a1: i64, b0: i64, b1: i64| {
        let (low, high) = (a0.max(b0), a1.min(b1));
        (low.min(high), low.max(high))
    };
    let (x0, x1) = along(a.x0, a.x1, b.x0, b.x1);
    let (y0, y1) = along(a.y0, a.y1, b.y0, b.y1);
    Rect { x0, y0, x1, y1 }
}

/// Hand every pair on a layer whose bounding boxes are at most `reach` apart to `f`: pairs of loose shapes,
/// and of loose shapes with pillars on lattices. Pairs of pillars on one lattice are not among them.
///
/// # Errors
/// In words, if there are too many.
pub(super) fn near<'s>(
    scene: &'s Scene<'_>,
    layer: LayerNumber,
    reach: i64,
    mut f: impl FnMut(Body<'s>, Body<'s>),
) -> Result<(), String> {
    let Some(loose) = scene.loose(layer) else { return Ok(()) };
    let body = |k: usize| body(loose, k);
    let mut left = MOST_PAIRS;
    let bounds: Vec<[i32; 4]> = if loose.polygons.is_empty() {
        Vec::new()
    } else {
        // Places of polygons were checked when they were kept: a bounding box has the range of its vertices.
        loose
            .bounds()
            .map(|r| [r.x0, r.y0, r.x1, r.y1].map(|v| v as i32))
            .collect()
    };
    let boxes = if bounds.is_empty() { &loose.rects } else { &bounds };
    let effort = |a: usize, b: usize| body(a).effort(&body(b));
    sweep(boxes, reach, effort, &mut left, |a, b| f(body(a), body(b)))?;
    if layer != scene.pillars {
        return Ok(());
    }
    for (k, b) in boxes.iter().enumerate() {
        let [x0, y0, x1, y1] = b.map(i64::from);
        let grown = Rect {
            x0: x0 - reach,
            y0: y0 - reach,
            x1: x1 + reach,
            y1: y1 + reach,
        };
        for element in 0..scene.elements.len() {
            for pillar in pillars_in(scene, element, &grown) {
                let pillar = Body::Rect(pillar);
                left = left.checked_sub(body(k).effort(&pillar)).ok_or_else(too_many)?;
                f(body(k), pillar);
            }
        }
    }
    Ok(())
}

fn body(loose: &Loose, k: usize) -> Body<'_> {
    match loose.rects.len() {
        n if k < n => Body::Rect(loose.rect(k)),
        n => Body::Ring(&loose.polygons[k - n]),
    }
}

fn too_many() -> String {
    format!("more than {MOST_PAIRS} pairs of sides are near one another")
}

/// Pillars on the lattice of an element that touch a rectangle.
fn pillars_in<'s>(scene: &'s Scene<'_>, element: usize, r: &Rect) -> impl Iterator<Item = Rect> + 's {
    let site = &scene.elements[element].site;
    let (sites, pitch) = (site.lattice.sites() as i64, f64::from(site.lattice.pitch_nm()));
    let range = |low: i64, high: i64, centre: i64| {
        // Widths are at most a pitch: sites within half a pitch of the rectangle.
        let first = site.lattice.coordinate_nm(0) as f64 + centre as f64;
        let index = |v: i64, half: f64| (v as f64 * scene.unit_nm + half - first) / pitch;
        let from = index(low, -pitch / 2.0).floor().max(0.0) as i64;
        let to = index(high, pitch / 2.0).ceil().min((sites - 1) as f64) as i64;
        from..to + 1
    };
    let columns = range(r.x0, r.x1, site.centre_nm[0]);
    let rows = range(r.y0, r.y1, site.centre_nm[1]);
    let r = *r;
    rows.flat_map(move |row| columns.clone().map(move |column| (row as usize, column as usize)))
        .filter(move |&(row, column)| scene.elements[element].widths.width_nm[[row, column]] != 0)
        .map(move |(row, column)| scene.pillar(element, row, column))
        .filter(move |p| p.x0 <= r.x1 && r.x0 <= p.x1 && p.y0 <= r.y1 && r.y0 <= p.y1)
}

/// Pairs of boxes at most `reach` apart along x and along y. Boxes are taken from the lowest; those that
/// still reach up are kept by their left edge in classes of size, so that a search spans little more than
/// the box itself.
fn sweep(
    boxes: &[[i32; 4]],
    reach: i64,
    effort: impl Fn(usize, usize) -> u64,
    left: &mut u64,
    mut f: impl FnMut(usize, usize),
) -> Result<(), String> {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.sort_unstable_by_key(|&k| (boxes[k as usize][1], k));
    let mut classes: Vec<BTreeSet<(i32, u32)>> = vec![BTreeSet::new(); 33];
    let mut gone: Vec<(i32, u32)> = Vec::new();
    for &k in &order {
        let [x0, y0, x1, y1] = boxes[k as usize].map(i64::from);
        for (class, open) in classes.iter_mut().enumerate().filter(|(_, open)| !open.is_empty()) {
            let limit = |v: i64| v.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
            let from = limit(x0 - reach - (1 << class));
            let to = limit(x1 + reach);
            for &(other_x0, other) in open.range((from, 0)..=(to, u32::MAX)) {
                let [_, _, other_x1, other_y1] = boxes[other as usize].map(i64::from);
                if other_y1 + reach < y0 {
                    gone.push((other_x0, other));
                } else if other_x1 + reach >= x0 {
                    *left = left
                        .checked_sub(effort(other as usize, k as usize))
                        .ok_or_else(too_many)?;
                    f(other as usize, k as usize);
                }
            }
            for entry in gone.drain(..) {
                open.remove(&entry);
            }
        }
        let size = (x1 - x0).max(y1 - y0).max(1) as u64;
        let class = size.next_power_of_two().trailing_zeros() as usize;
        classes[class].insert((x0 as i32, k));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};

    use super::*;

    /// Against all pairs, for boxes of many sizes.
    #[test]
    fn sweep_finds_what_comparing_all_finds() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for reach in [0, 5, 60] {
            let boxes: Vec<[i32; 4]> = (0..400)
                .map(|_| {
                    let (x, y) = (rng.random_range(-900..900), rng.random_range(-900..900));
                    let size = 1 << rng.random_range(0..10);
                    [x, y, x + rng.random_range(1..=size), y + rng.random_range(1..=size)]
                })
                .collect();
            let mut found = Vec::new();
            let mut left = u64::MAX;
            sweep(
                &boxes,
                reach,
                |_, _| 1,
                &mut left,
                |a, b| found.push((a.min(b), a.max(b))),
            )
            .unwrap();
            found.sort_unstable();
            let near = |a: [i32; 4], b: [i32; 4]| {
                let rect = |r: [i32; 4]| {
                    let [x0, y0, x1, y1] = r.map(i64::from);
                    Rect { x0, y0, x1, y1 }
                };
                let (dx, dy) = between(&rect(a), &rect(b));
                dx <= reach && dy <= reach
            };
            let mut expected = Vec::new();
            for a in 0..boxes.len() {
                expected.extend(
                    (a + 1..boxes.len())
                        .filter(|&b| near(boxes[a], boxes[b]))
                        .map(|b| (a, b)),
                );
            }
            assert_eq!(found, expected);
            assert!(expected.len() > 50);
        }
    }
}
