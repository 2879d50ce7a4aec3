//! Pillars of elements, whatever file they are read from.

use std::ops::Range;
use std::path::Path;

use metalith_core::{LayerNumber, Progress, Result};

use crate::{Lattice, LatticeKind, PillarMap, PillarShape};

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

    /// The place nearest to `about_nm` that its pillars stand around as around a centre, and the smallest lattice about it that
    /// covers a disc of this diameter: an axis may be on a site or between sites. None beyond the element.
    pub fn about(&self, about_nm: [i64; 2], diameter_nm: u32) -> Option<Self> {
        let (ends, pitch) = (self.ends_nm(), self.lattice.pitch_nm());
        if (0..2).any(|axis| !(ends[axis][0]..=ends[axis][1]).contains(&about_nm[axis])) {
            return None;
        }
        let off = [0, 1].map(|axis| (about_nm[axis] - self.centre_nm[axis]) as f64);
        let (centre, sites) = match self.lattice.kind() {
            LatticeKind::Square => {
                // Centres of lattices with as many sites as this one, and with one more or less, are half a pitch apart.
                let nearest = |half: f64| off.map(|v| ((v / pitch.nm() - half).round() + half) * pitch.nm());
                let away = |[x, y]: [f64; 2]| (x - off[0]).hypot(y - off[1]);
                let [own, other] = [0.0, 0.5].map(nearest);
                if away(own) <= away(other) {
                    (own, self.lattice.sites())
                } else {
                    (other, self.lattice.sites() + 1)
                }
            }
            LatticeKind::Hexagonal => {
                let [ix, iy] = self.lattice.site_at(off.map(|v| v * 1e-3))?;
                ([self.lattice.place_nm(0, ix), self.lattice.place_nm(1, iy)], 1)
            }
        };
        let covering = self.lattice.covering_disc(diameter_nm).ok()?;
        // A lattice whose centre is beside that of the disc reaches a pitch farther.
        let beside = if centre == off { 0 } else { 2 };
        let sites = covering.sites() + (covering.sites() + sites) % 2 + beside;
        Some(Self {
            name: self.name.clone(),
            centre_nm: [0, 1].map(|axis| self.centre_nm[axis] + centre[axis].round() as i64),
            lattice: covering.with_sites(sites).ok()?,
            within_nm: None,
        })
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

    /// The elements that a layout has on a layer, each on the lattice that its pillars stand on.
    ///
    /// # Errors
    /// If the layout cannot be read, there is no element on this layer, or the user stopped it.
    fn elements(&self, layout: &Path, layer: LayerNumber, progress: &dyn Progress) -> Result<Vec<ElementSite>>;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice with an even number of sites has places for the axis of a lens between four sites, on a site, and on neither.
    #[test]
    fn the_axis_of_a_lens_is_between_sites_or_on_one() {
        let found = ElementSite {
            name: String::new(),
            centre_nm: [1_000, 0],
            lattice: Lattice::new(400, 100).unwrap(),
            within_nm: None,
        };
        let about = |x: i64, y: i64| {
            let site = found.about([x, y], 20_000).unwrap();
            (site.centre_nm, site.lattice.sites())
        };
        assert_eq!(about(1_000, 0), ([1_000, 0], 50));
        assert_eq!(about(1_400, -800), ([1_400, -800], 50));
        assert_eq!(about(1_200, 200), ([1_200, 200], 51));
        // Between two sites: as far from either kind of centre.
        assert_eq!(about(1_000, 200), ([1_000, 400], 52));
        assert_eq!(about(1_000, 390), ([1_000, 400], 52));
        assert!(found.about([60_000, 0], 20_000).is_none());
        let hexagonal = Lattice::of_kind_covering(LatticeKind::Hexagonal, 20_000, 400).unwrap();
        let found = ElementSite {
            lattice: hexagonal,
            ..found
        };
        let row = hexagonal.row_nm().round() as i64;
        for (off, centre) in [([0, 0], [0, 0]), ([190, row], [200, row]), ([400, 0], [400, 0])] {
            let site = found.about([1_000 + off[0], off[1]], 20_000).unwrap();
            assert_eq!(site.centre_nm, [1_000 + centre[0], centre[1]]);
            let beside = if off == centre { 0 } else { 2 };
            assert_eq!(site.lattice.sites(), hexagonal.sites() + beside);
        }
    }

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
