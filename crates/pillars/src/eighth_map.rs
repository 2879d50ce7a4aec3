//! Widths of an element that all eight symmetries of the square leave as it is.

use std::ops::Range;

use crate::packed_numbers::PackedNumbers;
use crate::{Lattice, PillarRows};

/// Sites along the side of a tile of 1 or 2 kB: whoever goes along a row meets each memory page of it once, not one at every
/// site beyond the diagonal.
const TILE: usize = 32;

/// Pillars of one element, one for each set of sites that mirrors and quarter turns take into one another: a sixteenth of the
/// memory of a [`PillarMap`](crate::PillarMap) where no more than 255 numbers differ, else an eighth.
#[derive(Clone, Debug)]
pub struct EighthMap {
    lattice: Lattice,
    /// The triangle 0 <= b <= a, where a and b are the larger and the smaller distance of a site from the axes, in sites:
    /// row after row of tiles, each of them row by row.
    numbers: PackedNumbers,
}

impl PartialEq for EighthMap {
    fn eq(&self, other: &Self) -> bool {
        self.lattice == other.lattice && self.numbers.iter().eq(other.numbers.iter())
    }
}

impl Eq for EighthMap {}

impl EighthMap {
    /// Widths that are held for a lattice.
    pub fn sites(lattice: Lattice) -> u64 {
        let tiles = lattice.sites().div_ceil(2 * TILE) as u64;
        tiles * (tiles + 1) / 2 * (TILE * TILE) as u64
    }

    /// Index of the width of the site (a, b) of the triangle.
    #[inline]
    fn index(a: usize, b: usize) -> usize {
        let (row, column) = (a / TILE, b / TILE);
        (row * (row + 1) / 2 + column) * TILE * TILE + a % TILE * TILE + b % TILE
    }

    /// A lattice without pillars.
    pub fn empty(lattice: Lattice) -> Self {
        Self {
            lattice,
            numbers: PackedNumbers::zero(Self::sites(lattice) as usize),
        }
    }

    /// A lattice without pillars, for some that are mostly as those of this map on the same lattice, or follow from them width by
    /// width: these take an eighth of a byte a site, and keep the memory of this map.
    #[must_use]
    pub fn empty_like(&mut self) -> Self {
        Self {
            lattice: self.lattice,
            numbers: self.numbers.zero_like(),
        }
    }

    /// Memory of the sites (bytes): one a site, or two where more than 255 numbers differ.
    pub fn bytes(&self) -> u64 {
        self.numbers.bytes()
    }

    /// The pillars of an element that all eight symmetries leave as it is.
    pub fn of(rows: &(impl PillarRows + ?Sized)) -> Self {
        let mut map = Self::empty(rows.lattice());
        let (n, mut room) = (map.lattice.sites(), Vec::new());
        for iy in n / 2..n {
            // Up to the diagonal, which is at the same column as row.
            for (ix, &width) in ((n / 2)..=iy).zip(rows.row(iy, n / 2..iy + 1, &mut room)) {
                map.set(ix, iy, width);
            }
        }
        map
    }

    /// Distance of a site of an axis from the middle, in sites, from zero on either side.
    #[inline]
    pub fn distance(&self, i: usize) -> usize {
        let n = self.lattice.sites();
        let half = n.div_ceil(2);
        if i < n / 2 { half - 1 - i } else { i - n / 2 }
    }

    #[inline]
    fn place(&self, ix: usize, iy: usize) -> usize {
        let (x, y) = (self.distance(ix), self.distance(iy));
        Self::index(x.max(y), x.min(y))
    }

    /// Put a number on a site and all its copies.
    #[inline]
    pub fn set(&mut self, ix: usize, iy: usize, number: u16) {
        let place = self.place(ix, iy);
        self.numbers.set(place, number);
    }

    /// Number of sites that symmetry takes a site to, itself included: [`Lattice::copies`].
    #[inline]
    pub fn copies(&self, ix: usize, iy: usize) -> usize {
        self.lattice.copies(ix, iy)
    }
}

impl EighthMap {
    /// Widths of row `iy` from the first column at or right of the middle to the diagonal (nm), for a row at or above the
    /// middle: with all rows, each set of copies once.
    pub fn to_diagonal<'r>(&self, iy: usize, room: &'r mut Vec<u16>) -> &'r [u16] {
        let y = self.distance(iy);
        room.clear();
        room.resize(y + 1, 0);
        self.along(y, room);
        room
    }

    /// The row `y` of the triangle.
    #[inline]
    fn along(&self, y: usize, row: &mut [u16]) {
        for (k, part) in row.chunks_mut(TILE).enumerate() {
            self.numbers.copy(Self::index(y, k * TILE), 1, part);
        }
    }
}

impl PillarRows for EighthMap {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn number(&self, ix: usize, iy: usize) -> u16 {
        self.numbers.get(self.place(ix, iy))
    }

    fn row<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        let n = self.lattice.sites();
        room.clear();
        room.resize(n, 0);
        let y = self.distance(iy);
        // From the middle to the right: along a row of the triangle up to the diagonal, down its columns beyond.
        let right = &mut room[n / 2..];
        let (along, beyond) = right.split_at_mut(y + 1);
        self.along(y, along);
        let (mut x, mut beyond) = (y + 1, beyond);
        while !beyond.is_empty() {
            let rows = (TILE - x % TILE).min(beyond.len());
            let (part, rest) = beyond.split_at_mut(rows);
            self.numbers.copy(Self::index(x, y), TILE, part);
            (x, beyond) = (x + rows, rest);
        }
        let (left, right) = room.split_at_mut(n / 2);
        let mirrored = right.iter().skip(n % 2);
        left.iter_mut().rev().zip(mirrored).for_each(|(to, from)| *to = *from);
        &room[columns]
    }

    fn pillars(&self) -> u64 {
        self.histogram().iter().skip(1).sum()
    }

    fn histogram(&self) -> Vec<u64> {
        let odd = !self.lattice.sites().is_multiple_of(2);
        let mut counts: Vec<u64> = Vec::new();
        let half = self.lattice.sites().div_ceil(2);
        for a in 0..half {
            for b in 0..=a {
                let w = usize::from(self.numbers.get(Self::index(a, b)));
                if w >= counts.len() {
                    counts.resize(w + 1, 0);
                }
                counts[w] += match (a == b, odd && b == 0) {
                    (true, true) => 1,
                    (false, false) => 8,
                    _ => 4,
                };
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PillarMap;

    /// Even and odd lattices: rows, single sites, counts and the whole agree with a map that is held in full.
    #[test]
    fn an_eighth_stands_for_the_whole() {
        for n in [1, 2, 3, 8, 13, 130, 197] {
            let lattice = Lattice::new(350, n).unwrap();
            let mut eighth = EighthMap::empty(lattice);
            let mut whole = PillarMap::empty(lattice);
            for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
                let radius = lattice.half_radius2(ix, iy) as u16;
                let width = if radius.is_multiple_of(5) { 0 } else { radius };
                eighth.set(ix, iy, width);
                whole.number[[iy, ix]] = width;
                let copies = (0..n * n)
                    .map(|k| [lattice.half_index(k % n).abs(), lattice.half_index(k / n).abs()])
                    .filter(|[x, y]| {
                        let own = [lattice.half_index(ix).abs(), lattice.half_index(iy).abs()];
                        own == [*x, *y] || own == [*y, *x]
                    });
                assert!(n > 20 || eighth.copies(ix, iy) == copies.count(), "{n} {ix} {iy}");
            }
            assert_eq!(eighth.whole(), whole);
            assert_eq!(EighthMap::of(&whole), eighth);
            assert_eq!(eighth.histogram(), whole.histogram());
            assert_eq!(PillarRows::pillars(&eighth), whole.pillars());
            let mut room = Vec::new();
            for iy in 0..n {
                assert_eq!(
                    eighth.row(iy, n / 3..n, &mut room),
                    &whole.number.row(iy).to_vec()[n / 3..]
                );
                assert!((0..n).all(|ix| eighth.number(ix, iy) == whole.number[[iy, ix]]));
            }
        }
    }
}
