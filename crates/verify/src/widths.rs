//! Pillars as they were read back against pillars as they were meant.

use serde::Serialize;

use metalith_core::WidthRows;

/// How the pillars of one element differ from the intended ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct WidthCheck {
    /// Pillars that were read back.
    pub pillars: u64,
    /// Sites with a pillar of another width.
    pub wrong: u64,
    /// Sites without their pillar.
    pub missing: u64,
    /// Sites with a pillar that should have none.
    pub extra: u64,
    /// Largest difference of widths where both have a pillar (nm).
    pub largest_nm: u16,
}

impl WidthCheck {
    /// Compare every site.
    ///
    /// # Panics
    /// If the two are on different lattices.
    pub fn compare(intended: &impl WidthRows, found: &impl WidthRows) -> Self {
        let lattice = intended.lattice();
        assert_eq!(lattice, found.lattice(), "an element is read back on its own lattice");
        let mut check = Self::default();
        let (n, mut room, mut other_room) = (lattice.sites(), Vec::new(), Vec::new());
        for iy in 0..n {
            let meant = intended.row(iy, 0..n, &mut room);
            let got = found.row(iy, 0..n, &mut other_room);
            meant.iter().zip(got).for_each(|(&meant, &got)| check.site(meant, got));
        }
        check
    }

    #[inline]
    fn site(&mut self, meant: u16, got: u16) {
        self.pillars += u64::from(got != 0);
        if meant != got {
            match (meant, got) {
                (_, 0) => self.missing += 1,
                (0, _) => self.extra += 1,
                _ => {
                    self.wrong += 1;
                    self.largest_nm = self.largest_nm.max(meant.abs_diff(got));
                }
            }
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
    use metalith_core::{Lattice, WidthMap};

    #[test]
    fn every_kind_of_difference_is_counted_once() {
        let mut intended = WidthMap::empty(Lattice::new(350, 4).unwrap());
        intended.width_nm.fill(200);
        intended.width_nm[[0, 0]] = 0;
        let mut found = intended.clone();
        found.width_nm[[0, 0]] = 120;
        found.width_nm[[1, 2]] = 0;
        found.width_nm[[3, 3]] = 194;
        found.width_nm[[3, 2]] = 202;
        let check = WidthCheck::compare(&intended, &found);
        let expected = WidthCheck {
            pillars: 15,
            wrong: 2,
            missing: 1,
            extra: 1,
            largest_nm: 6,
        };
        assert_eq!(check, expected);
        assert_eq!(check.faults(), 4);
        assert_eq!(WidthCheck::compare(&intended, &intended).faults(), 0);
    }
}
