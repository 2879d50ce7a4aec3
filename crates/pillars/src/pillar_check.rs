//! Pillars as they were read back against pillars as they were meant.

use serde::Serialize;

use crate::{EighthMap, PillarRows, PillarShape};

/// Differences of the pillars of one element from the intended ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PillarCheck {
    /// Pillars that were read back.
    pub pillars: u64,
    /// Sites with a pillar of another width.
    pub wrong: u64,
    /// Sites without their pillar.
    pub missing: u64,
    /// Sites with a pillar that should have none.
    pub extra: u64,
    /// Largest difference of widths where both have a pillar (nm); none of rectangles, whose numbers are no widths.
    pub largest_nm: Option<u16>,
}

impl PillarCheck {
    /// Compare every site.
    ///
    /// # Panics
    /// If the two are on different lattices.
    pub fn compare(intended: &impl PillarRows, found: &impl PillarRows) -> Self {
        let lattice = intended.lattice();
        assert_eq!(lattice, found.lattice(), "an element is read back on its own lattice");
        let mut check = Self::alike();
        let (n, mut room, mut other_room) = (lattice.sites(), Vec::new(), Vec::new());
        for iy in 0..n {
            let meant = intended.row(iy, 0..n, &mut room);
            let got = found.row(iy, 0..n, &mut other_room);
            meant.iter().zip(got).for_each(|(&meant, &got)| check.site(meant, got));
        }
        check
    }

    /// Compare pillars that all eight symmetries leave as they are: each set of copies once.
    ///
    /// # Panics
    /// If the two are on different lattices.
    pub fn compare_eighth(intended: &impl PillarRows, found: &EighthMap) -> Self {
        let lattice = intended.lattice();
        assert_eq!(lattice, found.lattice(), "an element is read back on its own lattice");
        let mut check = Self::alike();
        let (n, mut room, mut other_room) = (lattice.sites(), Vec::new(), Vec::new());
        for iy in n / 2..n {
            let meant = intended.row(iy, n / 2..iy + 1, &mut room);
            let got = found.to_diagonal(iy, &mut other_room);
            for (ix, (&meant, &got)) in (n / 2..).zip(meant.iter().zip(got)) {
                check.sites(meant, got, found.copies(ix, iy) as u64);
            }
        }
        check
    }

    #[inline]
    fn site(&mut self, meant: u16, got: u16) {
        self.sites(meant, got, 1);
    }

    /// Counts so many equal sites.
    #[inline]
    fn sites(&mut self, meant: u16, got: u16, sites: u64) {
        self.pillars += sites * u64::from(got != 0);
        if meant != got {
            match (meant, got) {
                (_, 0) => self.missing += sites,
                (0, _) => self.extra += sites,
                _ => {
                    self.wrong += sites;
                    self.largest_nm = self.largest_nm.max(Some(meant.abs_diff(got)));
                }
            }
        }
    }

    /// Check that has compared nothing so far.
    fn alike() -> Self {
        Self {
            largest_nm: Some(0),
            ..Self::default()
        }
    }

    /// This check for pillars of this shape.
    #[must_use]
    pub fn of_shape(self, shape: PillarShape) -> Self {
        Self {
            largest_nm: self.largest_nm.filter(|_| shape.has_width()),
            ..self
        }
    }

    /// Sites that are not as intended, for whatever reason.
    pub fn faults(&self) -> u64 {
        self.wrong + self.missing + self.extra
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Lattice, PillarMap, UprightRectangles};

    #[test]
    fn every_kind_of_difference_is_counted_once() {
        let mut intended = PillarMap::empty(Lattice::new(350, 4).unwrap());
        intended.number.fill(200);
        intended.number[[0, 0]] = 0;
        let mut found = intended.clone();
        found.number[[0, 0]] = 120;
        found.number[[1, 2]] = 0;
        found.number[[3, 3]] = 194;
        found.number[[3, 2]] = 202;
        let check = PillarCheck::compare(&intended, &found);
        let expected = PillarCheck {
            pillars: 15,
            wrong: 2,
            missing: 1,
            extra: 1,
            largest_nm: Some(6),
        };
        assert_eq!(check, expected);
        assert_eq!(check.faults(), 4);
        assert_eq!(check.of_shape(PillarShape::Circle), expected);
        let upright = PillarShape::Rectangle(UprightRectangles::of_lengths([100, 120].into_iter()).unwrap().into());
        assert_eq!(check.of_shape(upright).largest_nm, None);
        assert_eq!(PillarCheck::compare(&intended, &intended).faults(), 0);
    }

    /// An eighth against the whole, on even and odd lattices, with every kind of difference.
    #[test]
    fn an_eighth_is_compared_as_the_whole() {
        for n in [1, 2, 7, 40, 71] {
            let lattice = Lattice::new(350, n).unwrap();
            let (mut intended, mut found) = (EighthMap::empty(lattice), EighthMap::empty(lattice));
            for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
                let radius2 = lattice.half_radius2(ix, iy) as u16;
                intended.set(ix, iy, if radius2 % 7 == 1 { 0 } else { 100 + radius2 % 50 });
                found.set(ix, iy, if radius2 % 5 == 1 { 0 } else { 100 + radius2 % 48 });
            }
            let whole = PillarCheck::compare(&intended.whole(), &found.whole());
            assert_eq!(PillarCheck::compare_eighth(&intended, &found), whole);
            assert!(n < 20 || (whole.wrong > 0 && whole.missing > 0 && whole.extra > 0));
        }
    }
}
