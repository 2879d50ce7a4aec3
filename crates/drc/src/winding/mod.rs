//! Test whether an outline crosses or overlaps itself: a sweep over its sides from left to right, exact in whole units.
//!
//! After Shamos and Hoey: sides that cross become neighbours in the order from below before the sweep reaches
//! the crossing. Places are ordered by x, then y, so that upright sides are steepest of all. On the way the
//! turns of the outline around every place are counted. With n sides it takes n log n steps.

mod treap;

use metalith_gds::Point;

use super::polygon::{cross, side};
use treap::scrambled;

/// No side.
const NONE: u32 = u32::MAX;

/// True if a closed ring of corners crosses itself, goes round some place twice, or goes round one place to the left
/// and round another to the right. One that only touches itself does not: a hole drawn with a slit is a good outline.
pub(super) fn crosses_itself(ring: &[Point]) -> bool {
    // Four sides with corners that are none taken out may already cross; three may not.
    ring.len() >= 5 && Sweep::new(ring).finds_a_fault()
}

/// A side from its left end to its right end.
#[derive(Clone, Copy)]
struct SweepEdge {
    left: Point,
    right: Point,
    /// Number that it adds to the turns when it is passed upwards: 1 if the outline runs along it to the right.
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
            .map(|s| {
                if s[0] < s[1] {
                    SweepEdge {
                        left: s[0],
                        right: s[1],
                        turn: 1,
                    }
                } else {
                    SweepEdge {
                        left: s[1],
                        right: s[0],
                        turn: -1,
                    }
                }
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

    /// True if side `k`, which begins at the sweep line, runs above side `other` there.
    fn is_above(&self, k: u32, other: u32) -> bool {
        let (new, old) = (&self.sides[k as usize], &self.sides[other as usize]);
        match side(old.left, old.right, new.left).signum() {
            // From one place, the steeper is above; of two on one line, the later: what begins at a place is then
            // above all that lies there.
            0 => side(old.left, old.right, new.right) >= 0,
            above => above > 0,
        }
    }

    /// True if two sides lie on one line where both are.
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
}

#[cfg(test)]
mod tests;
