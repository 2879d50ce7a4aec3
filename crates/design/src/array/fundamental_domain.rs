//! The part of a lens that its symmetries leave unique.

use std::cmp::Ordering;
use std::ops::Range;

use metalith_pillars::{PillarRows, RowExtent};

use super::{Symmetry, SymmetryGroup};

/// A part of a fundamental domain that the same copies cover the lens with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DomainPart {
    /// Symmetries of the group that leave the sites of this part where they are.
    stabiliser: Stabiliser,
    /// The symmetries that, applied to the part, give all its copies, each once.
    pub copies: Vec<Symmetry>,
    /// Number of pillars of the part.
    pub pillars: u64,
}

/// Bit `k` is set if member `k` of the group leaves a site where it is.
type Stabiliser = u8;

impl SymmetryGroup {
    /// The pillars that the group leaves unique, in parts of equally many copies: inside a lens with
    /// all eight symmetries an octant with eight copies and its diagonal with four. A site stands for its copies if it is
    /// the first of them in reading order.
    pub fn domain(&self, widths: &(impl PillarRows + ?Sized)) -> Vec<DomainPart> {
        let n = widths.lattice().sites();
        let mut parts: Vec<DomainPart> = Vec::new();
        let mut room = Vec::new();
        for iy in 0..n {
            let columns = self.columns(n, iy);
            // Sites between the ends of a row are left where they are by the same symmetries.
            let between = (columns.start + 1).min(columns.end)..columns.end.saturating_sub(1).max(columns.start);
            for run in [
                columns.start..between.start,
                between.clone(),
                between.end.max(between.start)..columns.end,
            ] {
                let Some(stabiliser) = run.clone().next().and_then(|ix| self.stabiliser(n, ix, iy)) else {
                    continue;
                };
                let Some(RowExtent { first, pillars, .. }) = widths.extent(iy, run.clone(), &mut room) else {
                    continue;
                };
                match parts.iter_mut().find(|part| part.stabiliser == stabiliser) {
                    Some(part) => part.pillars += pillars,
                    None => parts.push(DomainPart {
                        stabiliser,
                        copies: self.copies(n, first, iy),
                        pillars,
                    }),
                }
            }
        }
        parts
    }

    /// Columns of row `iy`, of a lattice of `n` sites an axis, that belong to the domain.
    pub fn columns(&self, n: usize, iy: usize) -> Range<usize> {
        // Twice the place from the centre: exact for any number of sites, and in steps of two.
        let last = n as i64 - 1;
        let y = 2 * iy as i64 - last;
        let (mut low, mut high) = (-last, last);
        for member in &self.members {
            // The copy of (x, y) is at (a x + b y, c x + d y); it must not come before the site.
            let ((a, c), (b, d)) = (member.point(1, 0), member.point(0, 1));
            match (c, (d * y).cmp(&y)) {
                (0, Ordering::Greater) => {}
                (0, Ordering::Less) => return 0..0,
                (0, Ordering::Equal) => high = high.min(if a < 0 { 0 } else { last }),
                (1, _) => low = low.max(if b * y >= y { y } else { y + 2 }),
                _ => high = high.min(if b * y >= -y { -y } else { -y - 2 }),
            }
        }
        if low > high {
            return 0..0;
        }
        let (from, to) = ((low + last + 1).div_euclid(2), (high + last).div_euclid(2));
        from as usize..(to + 1) as usize
    }

    /// Columns of row `iy` that belong to a part of the domain: one run of them, or one site at either end.
    pub fn runs(&self, part: &DomainPart, n: usize, iy: usize) -> [Range<usize>; 2] {
        let Range { start, end } = self.columns(n, iy);
        let own = |ix: usize| ix < end && self.holds(part, n, ix, iy);
        let [first, last] = [start, end.max(start + 1) - 1].map(own);
        if end > start + 2 && own(start + 1) {
            return [start + usize::from(!first)..end - usize::from(!last), 0..0];
        }
        let end_run = end.max(start + 2) - 1;
        [
            start..start + usize::from(first),
            end_run..end_run + usize::from(last && end > start + 1),
        ]
    }

    /// True if a site of a lattice of `n` sites an axis belongs to a part of the domain.
    #[inline]
    pub fn holds(&self, part: &DomainPart, n: usize, ix: usize, iy: usize) -> bool {
        self.stabiliser(n, ix, iy) == Some(part.stabiliser)
    }

    /// Part of the domain that a site belongs to, if any.
    #[inline]
    pub fn part_of(&self, parts: &[DomainPart], n: usize, ix: usize, iy: usize) -> Option<usize> {
        let stabiliser = self.stabiliser(n, ix, iy)?;
        parts.iter().position(|part| part.stabiliser == stabiliser)
    }

    /// Symmetries that leave a site where it is; `None` if another copy of the site, the first in reading order, stands
    /// for it.
    #[inline]
    fn stabiliser(&self, n: usize, ix: usize, iy: usize) -> Option<Stabiliser> {
        // Twice the place from the centre: exact for any number of sites.
        let last = n as i64 - 1;
        let (x, y) = (2 * ix as i64 - last, 2 * iy as i64 - last);
        // The identity, the first member, leaves every site.
        let mut stays = 1;
        for (k, member) in self.members.iter().enumerate().skip(1) {
            let (mx, my) = member.point(x, y);
            match (my, mx).cmp(&(y, x)) {
                Ordering::Less => return None,
                Ordering::Equal => stays |= 1 << k,
                Ordering::Greater => {}
            }
        }
        Some(stays)
    }

    /// One symmetry for each distinct place that the group moves a site to.
    fn copies(&self, n: usize, ix: usize, iy: usize) -> Vec<Symmetry> {
        let mut seen = Vec::new();
        let mut copies = Vec::new();
        for member in &self.members {
            let place = member.site(n, ix, iy);
            if !seen.contains(&place) {
                seen.push(place);
                copies.push(*member);
            }
        }
        copies
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::symmetry::tests::lens;
    use metalith_pillars::{Lattice, PillarMap};

    /// The domain's copies give every pillar of the lens once.
    fn unfold(map: &PillarMap, group: &SymmetryGroup) {
        let n = map.lattice.sites();
        let mut seen = PillarMap::empty(map.lattice);
        for part in group.domain(map) {
            for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
                if map.number[[iy, ix]] == 0 || !group.holds(&part, n, ix, iy) {
                    continue;
                }
                for s in &part.copies {
                    let (jx, jy) = s.site(n, ix, iy);
                    assert_eq!(seen.number[[jy, jx]], 0, "a site covered twice");
                    seen.number[[jy, jx]] = map.number[[iy, ix]];
                }
            }
        }
        assert_eq!(&seen, map);
    }

    #[test]
    fn a_round_lens_folds_to_an_octant() {
        let map = lens(|x, y| (100 + x * x + y * y) as u16);
        let group = SymmetryGroup::of(&map);
        assert_eq!(group.members().len(), 8);
        let counts = group
            .domain(&map)
            .iter()
            .map(|p| (p.pillars, p.copies.len() as u64))
            .collect::<Vec<_>>();
        assert_eq!(counts.iter().map(|(s, c)| s * c).sum::<u64>(), map.pillars());
        assert!(counts.iter().any(|c| c.1 == 8) && counts.iter().any(|c| c.1 == 4));
        unfold(&map, &group);
    }

    #[test]
    fn a_wedge_leaves_one_mirror() {
        for map in [
            lens(|x, y| (500 + x * x + y * y + 2 * x) as u16),
            lens(|x, y| (500 + x * x + y * y + 2 * (x + y)) as u16),
            lens(|x, y| (500 + x * x + y * y - 2 * y) as u16),
        ] {
            let group = SymmetryGroup::of(&map);
            assert_eq!(group.members().len(), 2);
            unfold(&map, &group);
        }
    }

    #[test]
    fn one_pillar_that_differs_breaks_the_symmetry() {
        let mut map = lens(|x, y| (100 + x * x + y * y) as u16);
        map.number[[3, 4]] += 2;
        let group = SymmetryGroup::of(&map);
        assert_eq!(group, SymmetryGroup::trivial());
        unfold(&map, &group);
    }

    /// Every group of symmetries, every size: rows of the domain and of its parts are the sites that stand for others,
    /// and those between the ends of a row are left by the same symmetries.
    #[test]
    fn rows_of_the_domain_are_its_sites() {
        for bits in 0..1u32 << 8 {
            let chosen = |s: Symmetry| {
                Symmetry::ALL
                    .iter()
                    .position(|a| *a == s)
                    .is_some_and(|k| bits >> k & 1 == 1)
            };
            let group = SymmetryGroup::of_those(chosen);
            for n in [1, 2, 3, 6, 7] {
                let full = PillarMap {
                    lattice: Lattice::new(350, n).unwrap(),
                    number: ndarray::Array2::ones((n, n)),
                };
                let parts = group.domain(&full);
                let sites: u64 = parts.iter().map(|p| p.pillars * p.copies.len() as u64).sum();
                assert_eq!(sites, (n * n) as u64);
                for iy in 0..n {
                    let by_site: Vec<_> = (0..n).map(|ix| group.part_of(&parts, n, ix, iy)).collect();
                    let columns = group.columns(n, iy);
                    for (ix, part) in by_site.iter().enumerate() {
                        assert_eq!(columns.contains(&ix), part.is_some(), "{group:?} {n} {ix} {iy}");
                        for (k, own) in parts.iter().enumerate() {
                            let held = group.runs(own, n, iy).iter().filter(|run| run.contains(&ix)).count();
                            assert_eq!(held, usize::from(*part == Some(k)), "{group:?} {n} {ix} {iy}");
                        }
                    }
                }
            }
        }
    }
}
