//! The lattice that pillars stand on: square or hexagonal.

use std::fmt;

use serde::Serialize;

use crate::PillarShape;
use metalith_core::{Error, Result};

/// Kind of a lattice: the arrangement of its sites.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LatticeKind {
    /// One pitch apart along x and along y.
    #[default]
    Square,
    /// Rows along x, one pitch apart in a row, each row shifted by half a pitch against the next: six neighbours one pitch
    /// away.
    Hexagonal,
}

impl LatticeKind {
    /// Name and value of each, as design files and measured sets have them.
    pub const CHOICES: [(&'static str, Self); 2] = [("square", Self::Square), ("hexagonal", Self::Hexagonal)];

    /// True if it is square.
    pub fn is_square(&self) -> bool {
        *self == Self::Square
    }

    /// Reason why pillars of a shape cannot stand on it; `None` if they can.
    pub fn refusal(self, shape: PillarShape) -> Option<&'static str> {
        let stands = self.is_square() || shape == PillarShape::Circle;
        (!stands).then_some("a hexagonal lattice of pillars that are no circles")
    }

    /// Distance of two rows (nm). On a hexagonal lattice half the root of three of the pitch, rounded to whole nanometres:
    /// neighbours in the next row are up to 0.43 nm nearer or farther than those in a row.
    pub fn row_nm(self, pitch_nm: u32) -> u32 {
        match self {
            Self::Square => pitch_nm,
            Self::Hexagonal => (0.75 * f64::from(pitch_nm).powi(2)).sqrt().round() as u32,
        }
    }

    /// The widest pillar (nm): the distance of the nearest two, to an even number below. Rows of a hexagonal lattice are
    /// rounded.
    pub fn widest_nm(self, pitch_nm: u32) -> u32 {
        match self {
            Self::Square => pitch_nm,
            Self::Hexagonal => {
                let row_nm = f64::from(self.row_nm(pitch_nm));
                let across_nm = (0.5 * f64::from(pitch_nm)).hypot(row_nm);
                (across_nm.min(f64::from(pitch_nm)) as u32) & !1
            }
        }
    }
}

impl fmt::Display for LatticeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let own = Self::CHOICES.iter().find(|(_, kind)| kind == self);
        f.pad(own.map_or("", |(name, _)| name))
    }
}

/// A lattice about the centre of an element, in a grid of `sites` x `sites` places.
///
/// On a square lattice every place is a site: number `i` of an axis is at `(2 i - (sites - 1)) * pitch / 2`. With an even
/// number of sites the centre of the element is a corner between four sites, and a lens has all eight symmetries of the
/// square.
///
/// The grid of a hexagonal lattice has places half a pitch apart along x and a row apart along y, an odd number of them along
/// an axis. A place is a site if the sum of column and row is even ([`Lattice::has`]), so that one is in the centre, and a lens
/// has the four symmetries of a rectangle. The grid is as many places high as wide, more than the sites reach
/// ([`Lattice::reach`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Lattice {
    kind: LatticeKind,
    pitch_nm: u32,
    sites: usize,
}

impl Lattice {
    /// A square lattice of `sites` places an axis, `pitch_nm` apart.
    ///
    /// # Errors
    /// If the pitch is zero or odd (half of it must be whole nanometres), or there are no sites.
    pub fn new(pitch_nm: u32, sites: usize) -> Result<Self> {
        Self::of_kind(LatticeKind::Square, pitch_nm, sites)
    }

    /// A lattice of a kind in a grid of `sites` places an axis.
    ///
    /// # Errors
    /// As [`Lattice::new`]; also if the places of a hexagonal lattice are an even number.
    pub fn of_kind(kind: LatticeKind, pitch_nm: u32, sites: usize) -> Result<Self> {
        if pitch_nm == 0 || !pitch_nm.is_multiple_of(2) {
            return Err(Error::refused(
                "lattice/off-grid",
                format!("a pitch of {pitch_nm} nm puts pillar centres off the 1 nm grid"),
                "use an even, positive number of nanometres",
            ));
        }
        if sites == 0 || sites > 1 << 20 {
            return Err(Error::refused(
                "lattice/site-count-out-of-range",
                format!("the lattice has {sites} sites along an axis"),
                "use 1 to 1,048,576 sites along an axis",
            ));
        }
        if kind == LatticeKind::Hexagonal && sites.is_multiple_of(2) {
            return Err(Error::refused(
                "lattice/even-site-count",
                format!("the hexagonal lattice has {sites} places along an axis, an even number"),
                "use an odd number: one place is in the centre",
            ));
        }
        Ok(Self { kind, pitch_nm, sites })
    }

    /// The smallest square lattice with an even number of sites that covers a disc of this diameter.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn covering(diameter_nm: u32, pitch_nm: u32) -> Result<Self> {
        Self::of_kind_covering(LatticeKind::Square, diameter_nm, pitch_nm)
    }

    /// The smallest lattice of a kind that covers a disc of this diameter: a square one with an even number of sites.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn of_kind_covering(kind: LatticeKind, diameter_nm: u32, pitch_nm: u32) -> Result<Self> {
        if pitch_nm == 0 {
            return Self::new(0, 1);
        }
        let across = diameter_nm.div_ceil(pitch_nm) as usize;
        let sites = match kind {
            LatticeKind::Square => across + across % 2,
            LatticeKind::Hexagonal if across == 0 => 0,
            // Half a pitch apart, and the middle.
            LatticeKind::Hexagonal => 2 * across + 1,
        };
        Self::of_kind(kind, pitch_nm, sites)
    }

    /// Arrangement of the sites.
    pub fn kind(&self) -> LatticeKind {
        self.kind
    }

    /// True if it is square.
    pub fn is_square(&self) -> bool {
        self.kind.is_square()
    }

    /// Distance of neighbouring sites (nm).
    pub fn pitch_nm(&self) -> u32 {
        self.pitch_nm
    }

    /// Distance of neighbouring sites (um).
    pub fn pitch_um(&self) -> f64 {
        f64::from(self.pitch_nm) * 1e-3
    }

    /// Number of places of the grid along an axis; on a square lattice each is a site.
    pub fn sites(&self) -> usize {
        self.sites
    }

    /// Distance of the places of the grid along x and along y (nm).
    #[inline]
    pub fn steps_nm(&self) -> [u32; 2] {
        match self.kind {
            LatticeKind::Square => [self.pitch_nm; 2],
            LatticeKind::Hexagonal => [self.pitch_nm / 2, self.kind.row_nm(self.pitch_nm)],
        }
    }

    /// Distance of the places of the grid along x and along y (um).
    pub fn steps_um(&self) -> [f64; 2] {
        self.steps_nm().map(|step| f64::from(step) * 1e-3)
    }

    /// Edges of a rectangle of the chip for each site: the pitch, and the distance of two rows (um).
    pub fn cell_um(&self) -> [f64; 2] {
        [self.pitch_nm, self.kind.row_nm(self.pitch_nm)].map(|edge| f64::from(edge) * 1e-3)
    }

    /// Area of the chip for each site (um^2).
    pub fn cell_um2(&self) -> f64 {
        let [x, y] = self.cell_um();
        x * y
    }

    /// True if a place of the grid is a site.
    pub fn has(&self, ix: usize, iy: usize) -> bool {
        self.is_square() || (ix + iy).is_multiple_of(2)
    }

    /// The site nearest to a place from the centre (um), column and row; none beyond the grid.
    pub fn site_at(&self, at_um: [f64; 2]) -> Option<[usize; 2]> {
        let steps = self.steps_um();
        let [u, v] = [0, 1].map(|axis| at_um[axis] / steps[axis] + 0.5 * (self.sites as f64 - 1.0));
        let nearest = match self.kind {
            LatticeKind::Square => [u.round(), v.round()],
            LatticeKind::Hexagonal => {
                // Every other column of the row below, or of that above.
                let of_row = |row: f64| {
                    let odd = row.rem_euclid(2.0);
                    [2.0 * (0.5 * (u - odd)).round() + odd, row]
                };
                let away = |[column, row]: [f64; 2]| ((u - column) * steps[0]).hypot((v - row) * steps[1]);
                let [below, above] = [v.floor(), v.floor() + 1.0].map(of_row);
                if away(above) < away(below) { above } else { below }
            }
        };
        let inside = 0.0..self.sites as f64;
        let is_inside = nearest.iter().all(|i| inside.contains(i));
        is_inside.then(|| nearest.map(|i| i as usize))
    }

    /// Columns and rows of the grid that a lens may reach: all, but on a hexagonal lattice only as many rows as are in a square.
    pub fn reach(&self) -> [std::ops::Range<usize>; 2] {
        let all = 0..self.sites;
        let [x, y] = self.steps_nm();
        if x >= y {
            return [all.clone(), all];
        }
        let middle = self.sites / 2;
        let rows = (middle as u64 * u64::from(x) / u64::from(y)) as usize;
        [all, middle - rows..middle + rows + 1]
    }

    /// Columns and rows whose places from the centre are within two ends along x and along y, both included (nm).
    pub fn within(&self, ends_nm: [[i64; 2]; 2]) -> [std::ops::Range<usize>; 2] {
        let (reach, steps) = (self.reach(), self.steps_nm());
        [0, 1].map(|axis| {
            let std::ops::Range { start, end } = reach[axis];
            let (first, step) = (self.place_nm(axis, start), i64::from(steps[axis]));
            // The first place at or beyond a length: so many steps, rounded up.
            let from = |nm: i64| start + (-(first - nm).div_euclid(step)).clamp(0, (end - start) as i64) as usize;
            let [least, greatest] = ends_nm[axis];
            let low = from(least);
            low..from(greatest + 1).max(low)
        })
    }

    /// The outermost places of these columns and rows from the centre, along x and along y (nm).
    pub fn ends_nm(&self, reach: &[std::ops::Range<usize>; 2]) -> [[i64; 2]; 2] {
        [0, 1].map(|axis| {
            let std::ops::Range { start, end } = reach[axis];
            [start, end.max(start + 1) - 1].map(|i| self.place_nm(axis, i))
        })
    }

    /// Sides of a lens that takes all of it, along x and along y (nm): from its first place to its last, and a pitch,
    /// so that pillars of two such lenses side by side are a pitch apart.
    pub fn sides_nm(&self) -> [i64; 2] {
        self.ends_nm(&self.reach())
            .map(|[first, last]| last - first + i64::from(self.pitch_nm))
    }

    /// Steps along columns and rows from a site to half of its neighbours; the others are on the opposite sides.
    pub fn neighbours(&self) -> &'static [[i64; 2]] {
        match self.kind {
            LatticeKind::Square => &[[1, 0], [0, 1]],
            LatticeKind::Hexagonal => &[[2, 0], [1, 1], [-1, 1]],
        }
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre (nm).
    #[inline]
    pub fn place_nm(&self, axis: usize, i: usize) -> i64 {
        let step = i64::from(self.steps_nm()[axis]);
        match self.kind {
            LatticeKind::Square => self.half_index(i) * (step / 2),
            // An odd number of places: twice the place is even.
            LatticeKind::Hexagonal => self.half_index(i) / 2 * step,
        }
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre (um).
    #[inline]
    pub fn place_um(&self, axis: usize, i: usize) -> f64 {
        self.place_nm(axis, i) as f64 * 1e-3
    }

    /// Square of the distance of a place from the centre (nm^2), exact.
    pub fn radius2_nm2(&self, ix: usize, iy: usize) -> i64 {
        self.place_nm(0, ix).pow(2) + self.place_nm(1, iy).pow(2)
    }

    /// Square of the distance of a place from the centre in units of [`Lattice::unit_um`]: exact, so that sites related by
    /// symmetry agree to the last bit in everything computed from it.
    #[inline]
    pub fn units2(&self, ix: usize, iy: usize) -> i64 {
        match self.kind {
            LatticeKind::Square => self.half_radius2(ix, iy),
            LatticeKind::Hexagonal => 4 * self.radius2_nm2(ix, iy),
        }
    }

    /// Largest square of a distance from the centre within a circle of this diameter, in the units of [`Lattice::units2`]: exact.
    pub fn most_units2(&self, diameter_nm: u32) -> i64 {
        let (d, p) = (i128::from(diameter_nm), i128::from(self.pitch_nm));
        match self.kind {
            LatticeKind::Square => (d * d / (p * p)) as i64,
            LatticeKind::Hexagonal => (d * d) as i64,
        }
    }

    /// A pitch in the units of which [`Lattice::units2`] has squares.
    pub fn units_of_pitch(&self) -> i64 {
        match self.kind {
            LatticeKind::Square => 2,
            LatticeKind::Hexagonal => 2 * i64::from(self.pitch_nm),
        }
    }

    /// A length of which distances along both axes are whole numbers: half a pitch, or half a nanometre on a hexagonal
    /// lattice (nm).
    #[inline]
    pub fn unit_nm(&self) -> f64 {
        match self.kind {
            LatticeKind::Square => 0.5 * f64::from(self.pitch_nm),
            LatticeKind::Hexagonal => 0.5,
        }
    }

    /// [`Lattice::unit_nm`] (um).
    #[inline]
    pub fn unit_um(&self) -> f64 {
        self.unit_nm() * 1e-3
    }

    /// Place number `i` of an axis in half steps from the centre: odd for an even number of places.
    #[inline]
    pub fn half_index(&self, i: usize) -> i64 {
        2 * i as i64 - (self.sites as i64 - 1)
    }

    /// Place of site `i` of an axis of a square lattice from the centre (nm); see [`Lattice::place_nm`].
    pub fn coordinate_nm(&self, i: usize) -> i64 {
        debug_assert!(self.is_square(), "both axes are asked for as one");
        self.half_index(i) * i64::from(self.pitch_nm / 2)
    }

    /// Place of site `i` of an axis of a square lattice from the centre (um).
    pub fn coordinate_um(&self, i: usize) -> f64 {
        self.coordinate_nm(i) as f64 * 1e-3
    }

    /// Square of a site's distance from the centre of a square lattice, in half pitches: exact, so that sites related by
    /// symmetry agree to the last bit in everything computed from it.
    #[inline]
    pub fn half_radius2(&self, ix: usize, iy: usize) -> i64 {
        let (x, y) = (self.half_index(ix), self.half_index(iy));
        x * x + y * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hexagonal_lattice_has_six_neighbours() {
        // Rows are rounded to whole nanometres.
        const ROUNDED_NM: f64 = 0.44;
        for pitch in [350, 480, 650, 1000] {
            let lattice = Lattice::of_kind_covering(LatticeKind::Hexagonal, 10_000, pitch).unwrap();
            let n = lattice.sites();
            let middle = n / 2;
            assert!(lattice.has(middle, middle) && lattice.radius2_nm2(middle, middle) == 0);
            assert!(lattice.place_nm(0, n - 1) * 2 >= 10_000 - i64::from(pitch));
            let distances: Vec<f64> = (0..n * n)
                .map(|k| (k % n, k / n))
                .filter(|&(ix, iy)| lattice.has(ix, iy) && (ix, iy) != (middle, middle))
                .map(|(ix, iy)| (lattice.radius2_nm2(ix, iy) as f64).sqrt())
                .filter(|r| *r < 1.4 * f64::from(pitch))
                .collect();
            assert_eq!(distances.len(), 6);
            assert!(
                distances.iter().all(|r| (r - f64::from(pitch)).abs() < ROUNDED_NM),
                "{distances:?}"
            );
            for [dx, dy] in lattice.neighbours() {
                let [ix, iy] = [dx, dy].map(|d| (middle as i64 + d) as usize);
                assert!(lattice.has(ix, iy));
                let r = (lattice.radius2_nm2(ix, iy) as f64).sqrt();
                assert!((r - f64::from(pitch)).abs() < ROUNDED_NM);
            }
            // As many sites as there are cells in the square.
            let [columns, rows] = lattice.reach();
            assert_eq!(columns, 0..n);
            let sites = rows
                .clone()
                .flat_map(|iy| (0..n).map(move |ix| (ix, iy)))
                .filter(|&(x, y)| lattice.has(x, y));
            let [x, y] = lattice.steps_nm();
            let area = 1e-6 * f64::from(x) * n as f64 * f64::from(y) * rows.len() as f64;
            let share = sites.count() as f64 * lattice.cell_um2() / area;
            assert!((share - 1.0).abs() < 1.0 / n as f64, "{share}");
        }
        assert!(Lattice::of_kind(LatticeKind::Hexagonal, 350, 4).is_err());
        assert!(Lattice::of_kind_covering(LatticeKind::Hexagonal, 0, 350).is_err());
    }

    #[test]
    fn the_nearest_site_is_that_of_all() {
        // Places that are as far from two sites as rounding tells.
        const TIE_UM: f64 = 1e-9;
        for lattice in [
            Lattice::new(350, 6).unwrap(),
            Lattice::of_kind(LatticeKind::Square, 350, 7).unwrap(),
            Lattice::of_kind(LatticeKind::Hexagonal, 700, 9).unwrap(),
        ] {
            let n = lattice.sites();
            let away = |[ix, iy]: [usize; 2], [x, y]: [f64; 2]| {
                (lattice.place_um(0, ix) - x).hypot(lattice.place_um(1, iy) - y)
            };
            for k in 0..400 {
                // Within the outermost sites.
                let [x, y] = [(k * 37) % 401, (k * 113) % 401].map(|i| (f64::from(i) / 200.0 - 1.0) * 0.8);
                let at = [x, y];
                let all = (0..n * n)
                    .map(|i| [i % n, i / n])
                    .filter(|[ix, iy]| lattice.has(*ix, *iy));
                let least = all.map(|site| away(site, at)).fold(f64::INFINITY, f64::min);
                let found = lattice.site_at(at).unwrap();
                assert!(lattice.has(found[0], found[1]));
                assert!(away(found, at) < least + TIE_UM, "{lattice:?} {at:?}: {found:?}");
            }
            assert_eq!(lattice.site_at([0.0, 50.0]), None);
            assert_eq!(lattice.site_at([-50.0, 0.0]), None);
        }
    }

    #[test]
    fn columns_and_rows_within_two_ends() {
        let lattice = Lattice::new(350, 6).unwrap();
        // Places at 175, 525 and 875 nm to either side.
        assert_eq!(lattice.within([[-525, 525], [-174, 2000]]), [1..5, 3..6]);
        assert_eq!(lattice.within([[-100, 100], [900, 1000]]), [3..3, 6..6]);
        assert_eq!(lattice.sides_nm(), [2100, 2100]);
        let hexagonal = Lattice::of_kind_covering(LatticeKind::Hexagonal, 10_000, 1000).unwrap();
        // Columns are 500 nm apart, rows 866 nm, five of them to either side.
        assert_eq!(hexagonal.within([[-500, 1499], [-866, 1000]]), [9..13, 9..12]);
        assert_eq!(hexagonal.sides_nm(), [11_000, 9660]);
    }

    #[test]
    fn places_of_a_square_lattice_are_alike_along_both_axes() {
        for sites in [4, 5] {
            let lattice = Lattice::new(350, sites).unwrap();
            for i in 0..sites {
                assert!(
                    [0, 1]
                        .iter()
                        .all(|&axis| lattice.place_nm(axis, i) == lattice.coordinate_nm(i))
                );
            }
            assert_eq!(lattice.reach(), [0..sites, 0..sites]);
            assert_eq!(4 * lattice.radius2_nm2(1, 2), lattice.half_radius2(1, 2) * 350 * 350);
        }
    }
}
