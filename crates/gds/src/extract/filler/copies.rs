//! Copies of a pillar that is identified by its corners, onto the sites of elements.

use super::Filler;
use crate::transform::turned;
use crate::{PillarFinder, Shape, Transform};

/// Orientations that leave an upright box as it is, and whether x and y change their signs by them: half a turn, which leaves
/// every rectangle, and mirrors about the axes.
const KEPT: [(u8, [bool; 2]); 3] = [(2, [true, true]), (4, [false, true]), (6, [true, false])];

/// Placements of a cell that are images of the first one in the middle of an element, or in the axes through it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Images {
    element: u32,
    /// Entry of [`KEPT`] that each placement after the first is by.
    by: [usize; KEPT.len()],
    count: usize,
}

impl Images {
    fn kept(&self) -> impl Iterator<Item = (u8, [bool; 2])> {
        self.by[..self.count].iter().map(|k| KEPT[*k])
    }
}

impl Filler {
    /// Put a pillar that is identified by its corners on its sites, in one placement of the current cell after the
    /// other: how many were put before one that is another shape, has other corners than those of its number, or has no
    /// free site.
    ///
    /// Millions of pillars come here, one for each reference: nothing is worked out for one of them that another has told.
    pub fn put_copies(&mut self, finder: &mut PillarFinder, shape: &Shape<'_>, placements: &[Transform]) -> usize {
        let images = self.images.filter(|images| {
            placements.first() == Some(&self.first) && images.kept().all(|(orientation, _)| finder.keeps(orientation))
        });
        let mut put = 0;
        while put < placements.len() {
            let pillar = finder.placed(shape, &placements[put]).filter(|pillar| pillar.exact);
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
            if put == 1
                && let Some(images) = images.filter(|images| images.element == element)
            {
                return put + self.put_images(&images, row, column, number);
            }
        }
        put
    }

    /// Put a pillar on the images of its site, whose corners are those that it has: how many were free before one that was not.
    fn put_images(&mut self, images: &Images, row: usize, column: usize, number: u16) -> usize {
        let last = self.elements[images.element as usize].site.lattice.sites() - 1;
        let across = |at, is_across| if is_across { last - at } else { at };
        let mut sites = images.kept().map(|(_, [x, y])| (across(row, y), across(column, x)));
        let taken = sites.position(|(row, column)| self.fill(images.element, row, column, number).is_err());
        taken.unwrap_or(images.count)
    }

    /// The element that all placements after the first are images of the first one in, if there is one, and in places that are its
    /// own too.
    pub(super) fn images_of(&self, placements: &[Transform]) -> Option<Images> {
        let [Transform::Square { orientation, dx, dy }, others @ ..] = placements else {
            return None;
        };
        if others.is_empty() || others.len() > KEPT.len() {
            return None;
        }
        let mut by = [0; KEPT.len()];
        // Twice the middle of the element along the axes that something is mirrored along (database units).
        let mut sums = [None; 2];
        for (k, other) in others.iter().enumerate() {
            let Transform::Square {
                orientation: to,
                dx: x,
                dy: y,
            } = other
            else {
                return None;
            };
            by[k] = KEPT.iter().position(|(kept, _)| turned(*kept, *orientation) == *to)?;
            for (axis, (from, to)) in [(dx, x), (dy, y)].into_iter().enumerate() {
                if !KEPT[by[k]].1[axis] {
                    (from == to).then_some(())?;
                    continue;
                }
                let sum = from.checked_add(*to)?;
                (*sums[axis].get_or_insert(sum) == sum).then_some(())?;
            }
        }
        let twice_middle = sums.map(|sum| sum.map(|sum| sum.checked_mul(self.scale.num)));
        let first = [dx, dy];
        let is_about = |e: &super::ExtractedElement<super::StoredPillars>| {
            (0..2).all(|axis| {
                let twice = 2 * e.site.centre_nm[axis] * self.scale.den;
                let symmetric = |reach: &std::ops::Range<usize>| reach.start + reach.end == e.site.lattice.sites();
                match twice_middle[axis] {
                    Some(sum) => sum == Some(twice) && symmetric(&e.site.reach()[axis]),
                    // Of elements side by side, that which the first is in.
                    None => first[axis].checked_mul(2 * self.scale.num).is_some_and(|place| {
                        let across = e.site.lattice.sites() as f64 * e.site.lattice.steps_nm()[axis];
                        place.abs_diff(twice) <= (across * self.scale.den as f64) as u64
                    }),
                }
            })
        };
        Some(Images {
            element: self.elements.iter().position(is_about)? as u32,
            by,
            count: others.len(),
        })
    }
}
