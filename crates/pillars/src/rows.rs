//! The pillars of an element, row by row: held, or made when they are asked for.

use std::ops::Range;

use crate::{Lattice, PillarMap};

/// Pillars among some columns of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowExtent {
    /// First and last column with a pillar.
    pub first: usize,
    pub last: usize,
    /// Number of pillars.
    pub pillars: u64,
}

impl RowExtent {
    /// Extent of consecutive sites of a row from a column on, zero where no pillar is; none without pillars.
    pub fn of(column: usize, sites: &[u16]) -> Option<Self> {
        let first = sites.iter().position(|&w| w != 0)?;
        let last = sites.iter().rposition(|&w| w != 0)?;
        Some(Self {
            first: column + first,
            last: column + last,
            pillars: sites[first..=last].iter().filter(|&&w| w != 0).count() as u64,
        })
    }
}

/// The pillars of one element, each told by a number: the width of a square or a circle (nm), the number of a rectangle. An element of 10 mm has 800 million sites: who reads it row by row needs none but a row
/// of them in memory.
pub trait PillarRows: Sync {
    /// Lattice of the sites.
    fn lattice(&self) -> Lattice;

    /// The pillar in column `ix` of row `iy`, zero where there is none.
    fn number(&self, ix: usize, iy: usize) -> u16;

    /// The pillars of some columns of row `iy`. What is not held anyway is made in `room`.
    fn row<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16];

    /// Variant of [`PillarRows::row`] for a caller that asks only where pillars are: any number but zero stands for
    /// one.
    fn occupied<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        self.row(iy, columns, room)
    }

    /// Extent and number of the pillars among some columns of row `iy`; none where there is no pillar.
    fn extent(&self, iy: usize, columns: Range<usize>, room: &mut Vec<u16>) -> Option<RowExtent> {
        RowExtent::of(columns.start, self.occupied(iy, columns, room))
    }

    /// Call `with` with row, column and number of every pillar, rows from below.
    fn each_pillar(&self, mut with: impl FnMut(usize, usize, u16))
    where
        Self: Sized,
    {
        let n = self.lattice().sites();
        let mut room = Vec::new();
        for iy in 0..n {
            let row = self.row(iy, 0..n, &mut room).iter().enumerate();
            row.filter(|(_, w)| **w != 0).for_each(|(ix, &w)| with(iy, ix, w));
        }
    }

    /// Number of sites with a pillar.
    fn pillars(&self) -> u64 {
        let n = self.lattice().sites();
        let mut room = Vec::new();
        let rows = (0..n).filter_map(|iy| self.extent(iy, 0..n, &mut room));
        rows.map(|row| row.pillars).sum()
    }

    /// The largest number of a pillar: the width of the widest square or circle (nm); zero without pillars.
    fn largest_number(&self) -> u16 {
        let n = self.lattice().sites();
        let mut room = Vec::new();
        // A fold of the larger of two is compiled to vectors, `max` is not.
        let in_row = |largest: u16, iy| self.row(iy, 0..n, &mut room).iter().fold(largest, |a, &w| a.max(w));
        (0..n).fold(0, in_row)
    }

    /// Radius of the circle about the element's centre that holds the centres of all of its pillars (um); zero without
    /// pillars.
    fn circle_um(&self) -> f64 {
        let lattice = self.lattice();
        let (n, mut radius2, mut room) = (lattice.sites(), 0, Vec::new());
        for iy in 0..n {
            if let Some(row) = self.extent(iy, 0..n, &mut room) {
                let [first, last] = [row.first, row.last].map(|ix| lattice.units2(ix, iy));
                radius2 = radius2.max(first).max(last);
            }
        }
        (radius2 as f64).sqrt() * lattice.unit_um()
    }

    /// All of them as a map, if that is how they are held.
    fn held(&self) -> Option<&PillarMap> {
        None
    }

    /// Number of pillars of each number, which is the index; the first entry counts empty sites.
    fn histogram(&self) -> Vec<u64> {
        let n = self.lattice().sites();
        let (mut counts, mut room) = (Vec::new(), Vec::new());
        for iy in 0..n {
            for &w in self.row(iy, 0..n, &mut room) {
                let w = usize::from(w);
                if w >= counts.len() {
                    counts.resize(w + 1, 0);
                }
                counts[w] += 1;
            }
        }
        counts
    }

    /// All of them, held.
    fn whole(&self) -> PillarMap {
        let mut map = PillarMap::empty(self.lattice());
        let mut room = Vec::new();
        let n = map.lattice.sites();
        for (iy, mut to) in map.number.outer_iter_mut().enumerate() {
            let row = self.row(iy, 0..n, &mut room);
            to.iter_mut().zip(row).for_each(|(to, from)| *to = *from);
        }
        map
    }
}

impl PillarRows for PillarMap {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn number(&self, ix: usize, iy: usize) -> u16 {
        self.number[[iy, ix]]
    }

    fn held(&self) -> Option<&PillarMap> {
        Some(self)
    }

    fn row<'r>(&'r self, iy: usize, columns: Range<usize>, _room: &'r mut Vec<u16>) -> &'r [u16] {
        let n = self.lattice.sites();
        let all = self.number.as_slice().expect("rows are contiguous");
        &all[iy * n..(iy + 1) * n][columns]
    }
}
