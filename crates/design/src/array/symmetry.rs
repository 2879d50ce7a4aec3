//! The eight symmetries of the square, and those of them that leave a lens as it is.

use metalith_pillars::{Lattice, PillarMap, PillarShape};
use ndarray::{Array2, ArrayView2, Axis};
use serde::Serialize;

/// Symmetry of the square, one of eight, as GDSII writes it: mirrored about the x axis first (y to -y), then turned
/// counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Symmetry {
    pub mirrored: bool,
    /// Quarter turns counter-clockwise, 0 to 3.
    pub quarter_turns: u8,
}

impl Symmetry {
    pub const IDENTITY: Self = Self {
        mirrored: false,
        quarter_turns: 0,
    };

    /// All eight, the identity first.
    pub const ALL: [Self; 8] = {
        let mut all = [Self::IDENTITY; 8];
        let mut k = 0;
        while k < 8 {
            all[k] = Self {
                mirrored: k >= 4,
                quarter_turns: k as u8 % 4,
            };
            k += 1;
        }
        all
    };

    /// Place to which the symmetry takes a point.
    #[inline]
    pub fn point(self, x: i64, y: i64) -> (i64, i64) {
        // Cosine and sine of the turn; no branches, since sites by the million come here.
        const TURNS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
        let (cos, sin) = TURNS[usize::from(self.quarter_turns % 4)];
        let y = y * (1 - 2 * i64::from(self.mirrored));
        (cos * x - sin * y, sin * x + cos * y)
    }

    /// Site to which it takes a site of a lattice of `n` sites an axis.
    pub(super) fn site(self, n: usize, ix: usize, iy: usize) -> (usize, usize) {
        let last = n as i64 - 1;
        let (x, y) = self.point(2 * ix as i64 - last, 2 * iy as i64 - last);
        (((x + last) / 2) as usize, ((y + last) / 2) as usize)
    }

    /// The pillars after this symmetry.
    pub fn apply(self, widths: &PillarMap) -> PillarMap {
        PillarMap {
            lattice: widths.lattice,
            number: self.seen(&widths.number).as_standard_layout().into_owned(),
        }
    }

    /// A square of sites, `[row along +y, column along +x]`, after this symmetry.
    fn seen(self, sites: &Array2<u16>) -> ArrayView2<'_, u16> {
        let mut seen = sites.view();
        if self.mirrored {
            seen.invert_axis(Axis(0));
        }
        // A quarter turn exchanges the axes and mirrors one of them, half a turn mirrors both.
        let turned: &[usize] = match self.quarter_turns {
            0 => &[],
            1 => &[1],
            2 => &[0, 1],
            _ => &[0],
        };
        if self.quarter_turns % 2 == 1 {
            seen = seen.reversed_axes();
        }
        for &axis in turned {
            seen.invert_axis(Axis(axis));
        }
        seen
    }

    /// True if it leaves every pillar of a kind unchanged about its own middle.
    pub fn keeps(self, shape: PillarShape) -> bool {
        shape.keeps(self.mirrored, self.quarter_turns)
    }

    /// True if it maps a lattice onto itself: a hexagonal one has the symmetries of a rectangle.
    pub fn keeps_lattice(self, lattice: Lattice) -> bool {
        lattice.is_square() || self.quarter_turns.is_multiple_of(2)
    }

    /// Image of a vector of any real components.
    pub fn vector(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ((ax, ay), (bx, by)) = (self.point(1, 0), self.point(0, 1));
        [ax as f64 * x + bx as f64 * y, ay as f64 * x + by as f64 * y]
    }

    /// Inverse of this symmetry: a mirror undoes itself, however it is turned.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self {
            quarter_turns: if self.mirrored {
                self.quarter_turns
            } else {
                (4 - self.quarter_turns) % 4
            },
            ..self
        }
    }

    /// This symmetry after another one.
    #[must_use]
    pub fn after(self, first: Self) -> Self {
        let turns = if self.mirrored {
            4 - first.quarter_turns
        } else {
            first.quarter_turns
        };
        Self {
            mirrored: self.mirrored != first.mirrored,
            quarter_turns: (self.quarter_turns + turns) % 4,
        }
    }

    /// True if this symmetry turns the pillars `from` into `to`, every site compared.
    pub fn maps(self, from: &PillarMap, to: &PillarMap) -> bool {
        let n = from.lattice.sites();
        let seen = self.seen(&from.number);
        // From the middle outwards: sites that differ are found at once there, the rim is mostly empty.
        let mut rows = (0..n).map(|k| if k % 2 == 0 { n / 2 + k / 2 } else { n / 2 - 1 - k / 2 });
        from.lattice == to.lattice
            && self.keeps_lattice(from.lattice)
            && rows.all(|iy| iy >= n || seen.row(iy) == to.number.row(iy))
    }
}

/// The symmetries that leave a lens as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SymmetryGroup {
    pub(super) members: Vec<Symmetry>,
}

/// A symmetry that two of these make together and that is not among them.
fn composed(members: &[Symmetry]) -> Option<Symmetry> {
    let pairs = members.iter().flat_map(|a| members.iter().map(move |b| a.after(*b)));
    pairs.into_iter().find(|c| !members.contains(c))
}

impl SymmetryGroup {
    /// The group of a lens: each symmetry is tried on every site, or follows from two that hold.
    pub fn of(widths: &PillarMap) -> Self {
        Self::of_those(|s| s.maps(widths, widths))
    }

    /// Variant of [`SymmetryGroup::of`] for the symmetries that leave each pillar of this shape unchanged.
    pub fn of_shape(widths: &PillarMap, shape: PillarShape) -> Self {
        Self::of_those(|s| s.keeps(shape) && s.maps(widths, widths))
    }

    /// The group of what these symmetries, and those that follow from them, leave as it is.
    pub(super) fn of_those(holds: impl Fn(Symmetry) -> bool) -> Self {
        let mut members = vec![Symmetry::IDENTITY];
        for tried in Symmetry::ALL {
            if members.contains(&tried) || !holds(tried) {
                continue;
            }
            members.push(tried);
            // What is held is closed under composition.
            while let Some(next) = composed(&members) {
                members.push(next);
            }
        }
        members.sort_unstable();
        Self { members }
    }

    /// No symmetry but the identity: nothing is folded.
    pub fn trivial() -> Self {
        Self {
            members: vec![Symmetry::IDENTITY],
        }
    }

    /// The symmetries, the identity first.
    pub fn members(&self) -> &[Symmetry] {
        &self.members
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A lens of 12 sites across, whose widths follow from twice the place from the middle.
    pub(crate) fn lens(f: impl Fn(i64, i64) -> u16) -> PillarMap {
        let lattice = Lattice::new(350, 12).unwrap();
        let mut map = PillarMap::empty(lattice);
        for iy in 0..12 {
            for ix in 0..12 {
                let (x, y) = (lattice.half_index(ix), lattice.half_index(iy));
                if x * x + y * y <= 121 {
                    map.number[[iy, ix]] = f(x, y);
                }
            }
        }
        map
    }

    #[test]
    fn symmetries_move_points_as_gdsii_says() {
        let mirror_then_turn = Symmetry {
            mirrored: true,
            quarter_turns: 1,
        };
        assert_eq!(mirror_then_turn.point(3, 1), (1, 3));
        let map = lens(|x, y| (400 + 7 * x + 3 * y) as u16);
        for s in Symmetry::ALL {
            let moved = s.apply(&map);
            assert!(s.maps(&map, &moved));
            for ((iy, ix), w) in map.number.indexed_iter() {
                let (jx, jy) = s.site(12, ix, iy);
                assert_eq!(moved.number[[jy, jx]], *w, "{s:?}");
            }
            assert_eq!(s.after(s.inverse()), Symmetry::IDENTITY);
            assert_eq!(s.inverse().after(s), Symmetry::IDENTITY);
            let (x, y) = s.point(3, 5);
            assert_eq!(s.vector([3.0, 5.0]), [x as f64, y as f64]);
            for t in Symmetry::ALL {
                assert_eq!(t.apply(&moved), t.after(s).apply(&map), "{t:?} after {s:?}");
                assert_eq!(t.after(s).point(3, 5), t.point(x, y));
            }
        }
    }
}
