//! The order of the sides that the sweep line meets: a treap with parents.

use super::{NONE, Sweep};

impl Sweep {
    /// Sum of the turns of all sides below one.
    pub(super) fn turns_below(&self, k: u32) -> i32 {
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
    pub(super) fn beside(&self, k: u32, direction: usize) -> u32 {
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

    pub(super) fn update(&mut self, k: u32) {
        let sum = |k: u32| if k == NONE { 0 } else { self.sum[k as usize] };
        let [a, b] = self.child[k as usize];
        self.sum[k as usize] = sum(a) + self.sides[k as usize].turn + sum(b);
    }

    pub(super) fn update_up(&mut self, mut k: u32) {
        while k != NONE {
            self.update(k);
            k = self.parent[k as usize];
        }
    }

    /// Put a node in the place of its parent, the order from below unchanged.
    pub(super) fn rotate_up(&mut self, k: u32) {
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
pub(super) fn scrambled(k: u32) -> u32 {
    let mut h = k ^ 0x9e37_79b9;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}
