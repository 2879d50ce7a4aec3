use std::time::Instant;

use rand::{RngExt, SeedableRng};

use super::super::polygon::on_segment;
use super::*;

/// Slow test that compares all pairs of sides, and then the turns in every level strip between vertices.
fn crosses_itself_slowly(ring: &[Point]) -> bool {
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

/// True if a closed ring whose sides meet at vertices alone goes round some place twice, or round one place to the left
/// and round another to the right. Between two neighbouring heights of vertices its sides keep their order, and the
/// turns about each place are counted from the left.
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

/// True if two segments share a point.
fn meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    cross(a, b, c, d) || on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)
}

/// Rings on small grids touch, overlap and run along themselves in every way; no special case is left out.
#[test]
fn the_sweep_finds_what_comparing_all_sides_finds() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(12);
    let (mut good, mut bad) = (0, 0);
    for trial in 0..60_000 {
        let grid = [2, 3, 4, 6, 40][trial % 5];
        let corners = rng.random_range(3..=[8, 12][trial % 2]);
        let manhattan = trial % 3 == 0;
        let mut ring: Vec<Point> = vec![Point::new(0, 0)];
        for k in 0..corners {
            let last = ring[ring.len() - 1];
            let p = Point::new(rng.random_range(0..=grid), rng.random_range(0..=grid));
            ring.push(match (manhattan, k % 2) {
                (false, _) => p,
                (true, 0) => Point::new(p.x, last.y),
                (true, _) => Point::new(last.x, p.y),
            });
        }
        let ring = metalith_gds::simplified(&ring);
        if ring.len() < 4 {
            continue;
        }
        let expected = crosses_itself_slowly(&ring);
        assert_eq!(crosses_itself(&ring), expected, "{ring:?}");
        *(if expected { &mut bad } else { &mut good }) += 1;
    }
    assert!(good > 5_000 && bad > 5_000, "{good} {bad}");
}

/// A zigzag of long strokes, upright, level and slanting, and a comb: strokes are near one another everywhere.
#[test]
fn outlines_with_many_vertices_take_time_in_proportion() {
    const STROKES: i64 = 100_000;
    const REACH: i64 = 1_000_000;
    let zigzag = |place: &dyn Fn(i64, i64) -> Point| {
        // There, and back again above the way there.
        let along = |k: i64, above: i64| place(k * 10, above + if k % 2 == 0 { 0 } else { REACH });
        let there = (0..STROKES).map(|k| along(k, 0));
        let back = (0..STROKES).rev().map(|k| along(k, 4));
        let mut ring: Vec<Point> = there.chain(back).collect();
        ring.push(ring[0]);
        ring
    };
    let start = Instant::now();
    let mut wrong = 0;
    for place in [
        &(|u, v| Point::new(u, v)) as &dyn Fn(i64, i64) -> Point,
        &|u, v| Point::new(v, u),
        &|u, v| Point::new(u + v, v - u),
    ] {
        let mut ring = zigzag(place);
        assert!(!crosses_itself(&ring));
        // One vertex pulled over its neighbours.
        let middle = STROKES as usize / 2;
        ring[middle] = place(middle as i64 * 10 + 25, REACH / 2);
        wrong += u32::from(crosses_itself(&ring));
    }
    assert_eq!(wrong, 3);
    // Comparing all pairs would take 4e10 steps for each outline, minutes on any machine.
    assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
}
