//! Pillars of elements, whatever file they are read from.

use std::ops::Range;
use std::path::Path;

use metalith_core::{LayerNumber, Progress, Result};

use crate::{Lattice, PillarMap, PillarShape};

/// Place of an element, and the lattice that its pillars should stand on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ElementSite {
    /// Name for messages and reports.
    pub name: String,
    /// Centre of the lattice in the layout (nm).
    pub centre_nm: [i64; 2],
    pub lattice: Lattice,
    /// Least and greatest place of its pillars from the centre, along x and along y (nm), where elements stand nearer to one
    /// another than their lattices are wide; none where all of the lattice is its own.
    pub within_nm: Option<[[i64; 2]; 2]>,
}

impl ElementSite {
    /// Columns and rows of the lattice that its pillars may stand in.
    pub fn reach(&self) -> [Range<usize>; 2] {
        self.within_nm
            .map_or_else(|| self.lattice.reach(), |ends| self.lattice.within(ends))
    }

    /// The outermost columns and rows of these in the layout, along x and along y (nm).
    pub fn ends_nm(&self) -> [[i64; 2]; 2] {
        self.in_layout(&self.reach())
    }

    /// The outermost of these columns and rows in the layout, along x and along y (nm).
    fn in_layout(&self, reach: &[Range<usize>; 2]) -> [[i64; 2]; 2] {
        let ends = self.lattice.ends_nm(reach);
        [0, 1].map(|axis| ends[axis].map(|nm| self.centre_nm[axis] + nm))
    }

    /// Leave `within_nm` to those elements alone whose lattices, all of each, are less than a pitch from that of another: for
    /// the others it tells nothing that the lattice does not.
    pub fn widen(sites: &mut [Self]) {
        let whole: Vec<_> = sites.iter().map(|s| s.in_layout(&s.lattice.reach())).collect();
        for (k, site) in sites.iter_mut().enumerate() {
            let pitch = site.lattice.pitch_nm().at_least_nm();
            let near = |other: &[[i64; 2]; 2]| {
                let own = &whole[k];
                (0..2).all(|x| own[x][0] < other[x][1] + pitch && other[x][0] < own[x][1] + pitch)
            };
            if site.within_nm.is_some() && !whole[..k].iter().chain(&whole[k + 1..]).any(near) {
                site.within_nm = None;
            }
        }
    }
}

/// Reader of pillars out of a layout: crates that only need the widths take it from their caller, and know no format.
pub trait PillarReader: Sync {
    /// Widths of the pillars of each element, all of this shape, in the order given.
    ///
    /// # Errors
    /// If the layout cannot be read, an element is out of all proportion, or the user stopped it.
    fn pillars(
        &self,
        layout: &Path,
        layer: LayerNumber,
        shape: PillarShape,
        elements: &[ElementSite],
        progress: &dyn Progress,
    ) -> Result<Vec<PillarMap>>;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strips that are 101 columns wide and 21 rows high, each on a square lattice as wide as itself.
    #[test]
    fn lattices_that_come_near_others_keep_their_ends() {
        let strip = |x: i64, y: i64| ElementSite {
            name: String::new(),
            centre_nm: [x, y],
            lattice: Lattice::new(400, 101).unwrap(),
            within_nm: Some([[-20_000, 20_000], [-4_000, 4_000]]),
        };
        // A pitch between the lattices of the first and the last, less between those of the first two.
        let mut sites = vec![strip(0, 0), strip(0, 40_399), strip(40_400, 0)];
        assert_eq!(sites[0].reach(), [0..101, 40..61]);
        assert_eq!(sites[1].ends_nm()[1], [36_399, 44_399]);
        ElementSite::widen(&mut sites);
        let kept: Vec<bool> = sites.iter().map(|s| s.within_nm.is_some()).collect();
        assert_eq!(kept, [true, true, false]);
        assert_eq!(sites[2].reach(), [0..101, 0..101]);
    }
}
