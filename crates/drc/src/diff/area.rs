//! Comparison of the areas of two sets of outlines: whether both expose every place equally often, however they are cut
//! up.
//!
//! How often a set covers a place decides the sides of its outlines, added up along each line, and is decided by
//! them: where two outlines meet, their sides run in opposite directions and cancel. So two sets are equal if, on
//! every line of the plane, the sides of one less those of the other add up to nothing everywhere. Exact, for
//! sides in any direction, in n log n steps for n sides.

use metalith_gds::Point;

/// Sides that are compared: 160 bytes each.
pub(super) const MOST_SIDES: usize = 1 << 21;

/// One end of a side on its line.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct End {
    /// Direction of the line, without common factor, to the right or straight up.
    direction: (i64, i64),
    /// Distance from the origin times the length of the direction.
    offset: i128,
    /// Place on the line.
    at: Point,
    /// Number of sides that begin here in the direction of the line, less the number that end.
    begins: i32,
}

/// The sides of two sets of outlines, those of the second counted against those of the first.
#[derive(Default)]
pub(super) struct Sides(Vec<End>);

impl Sides {
    /// Add a ring, counter-clockwise and not closed: with sign 1 of the first set, with -1 of the second.
    pub(crate) fn add(&mut self, ring: &[Point], sign: i32) {
        for (k, &p) in ring.iter().enumerate() {
            let q = ring[(k + 1) % ring.len()];
            if p == q {
                continue;
            }
            let (from, to, begins) = if p < q { (p, q, sign) } else { (q, p, -sign) };
            let (dx, dy) = (to.x - from.x, to.y - from.y);
            let common = common_factor(dx.unsigned_abs(), dy.unsigned_abs()) as i64;
            let direction = (dx / common, dy / common);
            let offset = i128::from(direction.0) * i128::from(from.y) - i128::from(direction.1) * i128::from(from.x);
            for (at, begins) in [(from, begins), (to, -begins)] {
                self.0.push(End {
                    direction,
                    offset,
                    at,
                    begins,
                });
            }
        }
    }

    /// True if both sets cover every place equally often: all that begins at a place of a line ends there.
    pub(crate) fn cancel(mut self) -> bool {
        self.0.sort_unstable();
        let place = |e: &End| (e.direction, e.offset, e.at);
        self.0
            .chunk_by(|p, q| place(p) == place(q))
            .all(|at_one_place| at_one_place.iter().map(|e| e.begins).sum::<i32>() == 0)
    }
}

fn common_factor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { common_factor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(points: &[(i64, i64)]) -> Vec<Point> {
        points.iter().map(|&(x, y)| Point::new(x, y)).collect()
    }

    fn rect(x0: i64, y0: i64, x1: i64, y1: i64) -> Vec<Point> {
        ring(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    }

    fn same(a: &[Vec<Point>], b: &[Vec<Point>]) -> bool {
        let mut sides = Sides::default();
        a.iter().for_each(|ring| sides.add(ring, 1));
        b.iter().for_each(|ring| sides.add(ring, -1));
        sides.cancel()
    }

    #[test]
    fn cut_up_differently() {
        let whole = [rect(0, 0, 10, 10)];
        assert!(same(&whole, &[rect(0, 0, 4, 10), rect(4, 0, 10, 10)]));
        assert!(!same(&whole, &[rect(0, 0, 4, 10), rect(5, 0, 10, 10)]));
        let l = ring(&[(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)]);
        assert!(same(std::slice::from_ref(&l), &[rect(0, 0, 10, 5), rect(0, 5, 5, 10)]));
        // What overlaps is exposed twice.
        assert!(!same(std::slice::from_ref(&l), &[rect(0, 0, 10, 5), rect(0, 3, 5, 10)]));
        assert!(!same(&[l], &whole));
        // A slanting cut, and sides that are cut at other places.
        let halves = [ring(&[(0, 0), (10, 0), (10, 10)]), ring(&[(0, 0), (10, 10), (0, 10)])];
        assert!(same(&whole, &halves));
        assert!(!same(&whole, &halves[..1]));
        // Equal area, equal outline of the union, but doubled at another place.
        let left = [rect(0, 0, 20, 10), rect(0, 0, 5, 10)];
        let right = [rect(0, 0, 20, 10), rect(15, 0, 20, 10)];
        assert!(!same(&left, &right));
    }

    /// Stairs of 100,000 boxes as one outline against the same with one step moved: sorting, not comparing all.
    #[test]
    fn many_steps_take_time_in_proportion() {
        const STEPS: i64 = 100_000;
        let stairs = |moved: i64| {
            let right = (0..STEPS).flat_map(|k| {
                let x = 1_000 + k % 7 + if k == STEPS / 2 { moved } else { 0 };
                [(x, 10 * k), (x, 10 * k + 10)]
            });
            let mut points: Vec<(i64, i64)> = vec![(0, 0)];
            points.extend(right);
            points.push((0, 10 * STEPS));
            vec![ring(&points)]
        };
        let boxes: Vec<Vec<Point>> = (0..STEPS)
            .map(|k| rect(0, 10 * k, 1_000 + k % 7, 10 * k + 10))
            .collect();
        let start = std::time::Instant::now();
        assert!(same(&stairs(0), &boxes));
        assert!(!same(&stairs(1), &boxes));
        // Level by level this would be 2e10 steps and more.
        assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
    }
}
