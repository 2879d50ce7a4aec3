//! The eight symmetries of the square, and the part of a lens that they leave unique.

use crate::lattice::WidthMap;

/// One of the eight symmetries of the square, as GDSII writes it: mirrored about the x axis first
/// (y to -y), then turned counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
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

    /// Where a point goes.
    pub fn point(self, x: i64, y: i64) -> (i64, i64) {
        let y = if self.mirrored { -y } else { y };
        match self.quarter_turns {
            0 => (x, y),
            1 => (-y, x),
            2 => (-x, -y),
            _ => (y, -x),
        }
    }

    /// Where a site of a lattice of `n` sites an axis goes.
    fn site(self, n: usize, ix: usize, iy: usize) -> (usize, usize) {
        let last = n as i64 - 1;
        let (x, y) = self.point(2 * ix as i64 - last, 2 * iy as i64 - last);
        (((x + last) / 2) as usize, ((y + last) / 2) as usize)
    }

    /// The pillars after this symmetry.
    pub fn apply(self, widths: &WidthMap) -> WidthMap {
        let n = widths.lattice.sites();
        let mut moved = WidthMap::empty(widths.lattice);
        for ((iy, ix), &w) in widths.width_nm.indexed_iter() {
            let (jx, jy) = self.site(n, ix, iy);
            moved.width_nm[[jy, jx]] = w;
        }
        moved
    }

    /// Whether this symmetry turns the pillars `from` into `to`, every site compared.
    pub fn maps(self, from: &WidthMap, to: &WidthMap) -> bool {
        let n = from.lattice.sites();
        // From the middle outwards: sites that differ are found at once there, the rim is mostly empty.
        let rows = (0..n).map(|k| if k % 2 == 0 { n / 2 + k / 2 } else { n / 2 - 1 - k / 2 });
        from.lattice == to.lattice
            && rows.filter(|&iy| iy < n).all(|iy| {
                (0..n).all(|ix| {
                    let (jx, jy) = self.site(n, ix, iy);
                    from.width_nm[[iy, ix]] == to.width_nm[[jy, jx]]
                })
            })
    }
}

/// The symmetries that leave a lens as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    members: Vec<Symmetry>,
}

/// Sites of a fundamental domain that the same number of copies covers the lens with.
#[derive(Clone, Debug)]
pub struct DomainPart {
    /// `(ix, iy)`, row by row.
    pub sites: Vec<(u32, u32)>,
    /// The symmetries that, applied to the sites, give all their copies, each once.
    pub copies: Vec<Symmetry>,
}

impl Group {
    /// The group of a lens: each symmetry is tried on every site.
    pub fn of(widths: &WidthMap) -> Self {
        Self {
            members: Symmetry::ALL.into_iter().filter(|s| s.maps(widths, widths)).collect(),
        }
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

    /// The pillars that the group leaves unique, in parts of equally many copies: inside a lens with
    /// all eight symmetries an octant with eight copies and its diagonal with four.
    pub fn domain(&self, widths: &WidthMap) -> impl Iterator<Item = DomainPart> + use<> {
        let n = widths.lattice.sites();
        let mut parts: Vec<(Vec<bool>, DomainPart)> = Vec::new();
        for ((iy, ix), _) in widths.width_nm.indexed_iter().filter(|(_, w)| **w != 0) {
            let place = |s: &Symmetry| s.site(n, ix, iy);
            // The first of the copies stands for all.
            if self.members.iter().any(|s| {
                let (jx, jy) = place(s);
                (jy, jx) < (iy, ix)
            }) {
                continue;
            }
            let stays = self.members.iter().map(|s| place(s) == (ix, iy)).collect::<Vec<_>>();
            let site = (ix as u32, iy as u32);
            match parts.iter_mut().find(|(known, _)| *known == stays) {
                Some((_, part)) => part.sites.push(site),
                None => {
                    let copies = self.copies(|s| place(s));
                    parts.push((
                        stays,
                        DomainPart {
                            sites: vec![site],
                            copies,
                        },
                    ));
                }
            }
        }
        parts.into_iter().map(|(_, part)| part)
    }

    /// One symmetry for each distinct place that the group moves a site to.
    fn copies(&self, place: impl Fn(&Symmetry) -> (usize, usize)) -> Vec<Symmetry> {
        let mut seen = Vec::new();
        self.members
            .iter()
            .filter(|s| {
                let to = place(s);
                !seen.contains(&to) && {
                    seen.push(to);
                    true
                }
            })
            .copied()
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::Lattice;

    fn lens(f: impl Fn(i64, i64) -> u16) -> WidthMap {
        let lattice = Lattice::new(350, 12).unwrap();
        let mut map = WidthMap::empty(lattice);
        for iy in 0..12 {
            for ix in 0..12 {
                let (x, y) = (lattice.half_index(ix), lattice.half_index(iy));
                if x * x + y * y <= 121 {
                    map.width_nm[[iy, ix]] = f(x, y);
                }
            }
        }
        map
    }

    /// The domain's copies give every pillar of the lens once.
    fn unfold(map: &WidthMap, group: &Group) {
        let n = map.lattice.sites();
        let mut seen = WidthMap::empty(map.lattice);
        for part in group.domain(map) {
            for &(ix, iy) in &part.sites {
                for s in &part.copies {
                    let (jx, jy) = s.site(n, ix as usize, iy as usize);
                    assert_eq!(seen.width_nm[[jy, jx]], 0, "a site covered twice");
                    seen.width_nm[[jy, jx]] = map.width_nm[[iy as usize, ix as usize]];
                }
            }
        }
        assert_eq!(&seen, map);
    }

    #[test]
    fn a_round_lens_folds_to_an_octant() {
        let map = lens(|x, y| (100 + x * x + y * y) as u16);
        let group = Group::of(&map);
        assert_eq!(group.members().len(), 8);
        let counts = group
            .domain(&map)
            .map(|p| (p.sites.len(), p.copies.len()))
            .collect::<Vec<_>>();
        assert_eq!(counts.iter().map(|(s, c)| s * c).sum::<usize>() as u64, map.pillars());
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
            let group = Group::of(&map);
            assert_eq!(group.members().len(), 2);
            unfold(&map, &group);
        }
    }

    #[test]
    fn one_pillar_that_differs_breaks_the_symmetry() {
        let mut map = lens(|x, y| (100 + x * x + y * y) as u16);
        map.width_nm[[3, 4]] += 2;
        let group = Group::of(&map);
        assert_eq!(group, Group::trivial());
        unfold(&map, &group);
    }

    #[test]
    fn symmetries_move_points_as_gdsii_says() {
        let mirror_then_turn = Symmetry {
            mirrored: true,
            quarter_turns: 1,
        };
        assert_eq!(mirror_then_turn.point(3, 1), (1, 3));
        for s in Symmetry::ALL {
            let map = lens(|x, y| (400 + 7 * x + 3 * y) as u16);
            assert!(s.maps(&map, &s.apply(&map)));
        }
    }
}
