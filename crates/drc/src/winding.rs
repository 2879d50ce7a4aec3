//! Whether an outline crosses or overlaps itself: a sweep over its sides from left to right, exact in whole units.
//!
//! After Shamos and Hoey: sides that cross become neighbours in the order from below before the sweep reaches
//! the crossing. Places are ordered by x, then y, so that upright sides are steepest of all. On the way the
//! turns of the outline around every place are counted. With n sides it takes n log n steps.

use metalith_gds::Point;

use super::polygon::{cross, side};

/// No side.
const NONE: u32 = u32::MAX;

/// Whether a closed ring of corners crosses itself, goes round some place twice, or goes round one place to the
/// left and round another to the right. One that only touches itself does not: a hole drawn with a slit is a good
/// outline.
pub(super) fn crosses_itself(ring: &[Point]) -> bool {
    // Four sides with corners that are none taken out may already cross; three may not.
    ring.len() >= 5 && Sweep::new(ring).finds_a_fault()
}

/// A side from its left end to its right end.
#[derive(Clone, Copy)]
struct SweepEdge {
    left: Point,
    right: Point,
    /// What it adds to the turns when it is passed upwards: 1 if the outline runs along it to the right.
    turn: i32,
}

/// The sides that the sweep line meets, from below, as a treap with parents: each side is a node.
struct Sweep {
    sides: Vec<SweepEdge>,
    parent: Vec<u32>,
    child: Vec<[u32; 2]>,
    /// Heap order of the treap: a fixed scramble of the number of the side.
    rank: Vec<u32>,
    /// Turns of a node and all below it in the tree.
    sum: Vec<i32>,
    root: u32,
    least: i32,
    most: i32,
}

impl Sweep {
    fn new(ring: &[Point]) -> Self {
        let sides: Vec<SweepEdge> = ring
            .windows(2)
            .filter(|s| s[0] != s[1])
            .map(|s| match s[0] < s[1] {
                true => SweepEdge {
                    left: s[0],
                    right: s[1],
                    turn: 1,
                },
                false => SweepEdge {
                    left: s[1],
                    right: s[0],
                    turn: -1,
                },
            })
            .collect();
        let n = sides.len();
        Self {
            parent: vec![NONE; n],
            child: vec![[NONE; 2]; n],
            rank: (0..n as u32).map(scrambled).collect(),
            sum: vec![0; n],
            root: NONE,
            least: 0,
            most: 0,
            sides,
        }
    }

    fn finds_a_fault(mut self) -> bool {
        // Ends before beginnings at each place.
        let mut events: Vec<(Point, bool, u32)> = Vec::with_capacity(2 * self.sides.len());
        for (k, s) in self.sides.iter().enumerate() {
            events.push((s.left, true, k as u32));
            events.push((s.right, false, k as u32));
        }
        events.sort_unstable();
        for at_one_place in events.chunk_by(|a, b| a.0 == b.0) {
            for &(_, begins, k) in at_one_place {
                let fault = if begins { self.begin(k) } else { self.end(k) };
                if fault {
                    return true;
                }
            }
            let begun = at_one_place.iter().filter(|e| e.1).map(|e| e.2);
            if self.turns_twice(begun) {
                return true;
            }
        }
        false
    }

    /// A side begins; whether it crosses a neighbour.
    fn begin(&mut self, k: u32) -> bool {
        self.sum[k as usize] = self.sides[k as usize].turn;
        let (mut at, mut above) = (self.root, 0);
        let mut last = NONE;
        while at != NONE {
            last = at;
            above = usize::from(self.is_above(k, at));
            at = self.child[at as usize][above];
        }
        self.parent[k as usize] = last;
        match last {
            NONE => self.root = k,
            last => {
                self.child[last as usize][above] = k;
                self.update_up(last);
                while self.parent[k as usize] != NONE
                    && self.rank[k as usize] > self.rank[self.parent[k as usize] as usize]
                {
                    self.rotate_up(k);
                }
            }
        }
        self.cross(self.beside(k, 0), k) || self.cross(k, self.beside(k, 1))
    }

    /// A side ends; whether the sides that are now neighbours cross.
    fn end(&mut self, k: u32) -> bool {
        let (below, above) = (self.beside(k, 0), self.beside(k, 1));
        loop {
            let [a, b] = self.child[k as usize];
            let up = match (a, b) {
                (NONE, NONE) => break,
                (NONE, only) | (only, NONE) => only,
                (a, b) if self.rank[a as usize] > self.rank[b as usize] => a,
                (_, b) => b,
            };
            self.rotate_up(up);
        }
        match self.parent[k as usize] {
            NONE => self.root = NONE,
            parent => {
                let place = usize::from(self.child[parent as usize][1] == k);
                self.child[parent as usize][place] = NONE;
                self.update_up(parent);
            }
        }
        self.parent[k as usize] = NONE;
        self.cross(below, above)
    }

    fn cross(&self, a: u32, b: u32) -> bool {
        if a == NONE || b == NONE {
            return false;
        }
        let (a, b) = (&self.sides[a as usize], &self.sides[b as usize]);
        cross(a.left, a.right, b.left, b.right)
    }

    /// Whether side `k`, which begins at the sweep line, runs above side `other` there.
    fn is_above(&self, k: u32, other: u32) -> bool {
        let (new, old) = (&self.sides[k as usize], &self.sides[other as usize]);
        match side(old.left, old.right, new.left).signum() {
            // From one place, the steeper is above; of two on one line, the later: what begins at a place is then
            // above all that lies there.
            0 => side(old.left, old.right, new.right) >= 0,
            above => above > 0,
        }
    }

    /// Whether two sides lie on one line where both are.
    fn coincide(&self, a: u32, b: u32) -> bool {
        let (a, b) = (&self.sides[a as usize], &self.sides[b as usize]);
        side(a.left, a.right, b.left) == 0 && side(a.left, a.right, b.right) == 0
    }

    /// The turns around the places between the sides that begin at one place: every part of the plane that the
    /// outline bounds has its leftmost corner in such a gap, or is what lies around one.
    fn turns_twice(&mut self, begun: impl Iterator<Item = u32>) -> bool {
        for k in begun {
            for direction in [0, 1] {
                let other = self.beside(k, direction);
                if other != NONE && self.coincide(k, other) {
                    continue;
                }
                let own = if direction == 1 { self.sides[k as usize].turn } else { 0 };
                let turns = self.turns_below(k) + own;
                self.least = self.least.min(turns);
                self.most = self.most.max(turns);
            }
        }
        self.most - self.least > 1
    }

    /// Sum of the turns of all sides below one.
    fn turns_below(&self, k: u32) -> i32 {
        let sum = |k: u32| if k == NONE { 0 } else { self.sum[k as usize] };
        let mut turns = sum(self.child[k as usize][0]);
        let (mut at, mut parent) = (k, self.parent[k as usize]);
        while parent != NONE {
            if self.child[parent as usize][1] == at {
                turns += sum(self.child[parent as usize][0]) + self.sides[parent as usize].turn;
            }
            (at, parent) = (parent, self.parent[parent as usize]);
        }
        turns
    }

    /// The next side below (0) or above (1).
    fn beside(&self, k: u32, direction: usize) -> u32 {
        let mut at = self.child[k as usize][direction];
        if at != NONE {
            while self.child[at as usize][1 - direction] != NONE {
                at = self.child[at as usize][1 - direction];
            }
            return at;
        }
        let (mut at, mut parent) = (k, self.parent[k as usize]);
        while parent != NONE && self.child[parent as usize][direction] == at {
            (at, parent) = (parent, self.parent[parent as usize]);
        }
        parent
    }

    fn update(&mut self, k: u32) {
        let sum = |k: u32| if k == NONE { 0 } else { self.sum[k as usize] };
        let [a, b] = self.child[k as usize];
        self.sum[k as usize] = sum(a) + self.sides[k as usize].turn + sum(b);
    }

    fn update_up(&mut self, mut k: u32) {
        while k != NONE {
            self.update(k);
            k = self.parent[k as usize];
        }
    }

    /// Put a node in the place of its parent, the order from below unchanged.
    fn rotate_up(&mut self, k: u32) {
        let parent = self.parent[k as usize];
        let above = self.parent[parent as usize];
        let place = usize::from(self.child[parent as usize][1] == k);
        let inner = self.child[k as usize][1 - place];
        self.child[parent as usize][place] = inner;
        if inner != NONE {
            self.parent[inner as usize] = parent;
        }
        self.child[k as usize][1 - place] = parent;
        self.parent[parent as usize] = k;
        self.parent[k as usize] = above;
        match above {
            NONE => self.root = k,
            above => {
                let place = usize::from(self.child[above as usize][1] == parent);
                self.child[above as usize][place] = k;
            }
        }
        self.update(parent);
        self.update(k);
    }
}

/// A number that looks random: the finaliser of MurmurHash3, which maps no two numbers to one.
fn scrambled(k: u32) -> u32 {
    let mut h = k ^ 0x9e37_79b9;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use rand::{Rng, SeedableRng};

    use super::super::polygon::on_segment;
    use super::*;

    /// By comparing all pairs of sides, and then the turns in every level strip between vertices.
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

    /// Whether two segments share a point.
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
}
