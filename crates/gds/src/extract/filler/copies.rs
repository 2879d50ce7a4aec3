//! Copies of a pillar that is told by its corners, onto the sites of elements.

use super::Filler;
use crate::transform::turned;
use crate::{Outline, PillarFinder, Transform};

/// The orientation of half a turn.
const HALF: u8 = 2;

impl Filler {
    /// Put a pillar that is told by its corners on its sites, in one placement of the current cell after the other: how many were put
    /// before one that is another shape, has other corners than those of its number, or has no free site.
    ///
    /// Millions of pillars come here, one for each reference: nothing is worked out for one of them that another has told.
    pub fn put_copies(&mut self, finder: &mut PillarFinder, outline: Outline<'_>, placements: &[Transform]) -> usize {
        let half_turn = self.half_turn.filter(|_| placements.first() == Some(&self.first));
        let mut put = 0;
        while put < placements.len() {
            let pillar = finder.placed(outline, &placements[put]).filter(|pillar| pillar.exact);
            let Some((pillar, number)) = pillar.and_then(|pillar| Some((pillar, pillar.number?))) else {
                break;
            };
            let Ok((element, row, column)) = self.site_of_drawn(&pillar, put) else {
                break;
            };
            if self.fill(element, row, column, number).is_err() {
                break;
            }
            put += 1;
            // Half a turn leaves the corners of a pillar as they are, and takes its site to the opposite one.
            if put == 1 && half_turn == Some(element) {
                let last = self.elements[element as usize].site.lattice.sites() - 1;
                put += usize::from(self.fill(element, last - row, last - column, number).is_ok());
                break;
            }
        }
        put
    }

    /// The element about whose middle half a turn takes the first of two placements to the second, if there is one, and to places
    /// that are its own too.
    pub(super) fn half_turn_of(&self, placements: &[Transform]) -> Option<u32> {
        let [
            Transform::Square { orientation, dx, dy },
            Transform::Square {
                orientation: other,
                dx: x,
                dy: y,
            },
        ] = *placements
        else {
            return None;
        };
        let sums = [dx + x, dy + y].map(|sum| sum.checked_mul(self.scale.num));
        let is_middle = |centre_nm: [i64; 2]| centre_nm.map(|c| Some(2 * c * self.scale.den)) == sums;
        let element = self.elements.iter().position(|e| is_middle(e.site.centre_nm))?;
        let site = &self.elements[element].site;
        let symmetric = |reach: std::ops::Range<usize>| reach.start + reach.end == site.lattice.sites();
        (other == turned(HALF, orientation) && site.reach().into_iter().all(symmetric)).then_some(element as u32)
    }
}
