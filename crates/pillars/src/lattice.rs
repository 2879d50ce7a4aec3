//! The lattice that pillars stand on: square or hexagonal.

use std::fmt;

use serde::Serialize;

use crate::{DatabaseUnit, PillarShape, Pitch};
use metalith_core::{Error, Result};

/// Largest distance of which the square and the sum of two squares are held.
const MOST_UNITS: u64 = 1 << 31;

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

    /// Distance of two rows (nm). On a hexagonal lattice half the root of three of the pitch, rounded to the database unit:
    /// neighbours in the next row are up to 0.43 units nearer or farther than those in a row.
    pub fn row_nm(self, pitch: Pitch, unit: DatabaseUnit) -> f64 {
        match self {
            Self::Square => pitch.nm(),
            Self::Hexagonal => Self::row_units(pitch, unit) as f64 / unit.per_nm() as f64,
        }
    }

    /// Distance of two rows of a hexagonal lattice (database units).
    fn row_units(pitch: Pitch, unit: DatabaseUnit) -> i64 {
        let pitch = pitch.nm() * unit.per_nm() as f64;
        (0.75 * pitch.powi(2)).sqrt().round() as i64
    }

    /// The widest pillar (nm): the distance of the nearest two, to a whole number below; an even one where the database unit is
    /// 1 nm. Rows of a hexagonal lattice are rounded.
    pub fn widest_nm(self, pitch: Pitch, unit: DatabaseUnit) -> u32 {
        let nearest_nm = match self {
            Self::Square => pitch.nm(),
            Self::Hexagonal => (0.5 * pitch.nm()).hypot(self.row_nm(pitch, unit)).min(pitch.nm()),
        };
        let whole = nearest_nm as u32;
        if unit.is_nanometre() { whole & !1 } else { whole }
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
/// number of sites the centre of the element is a corner between four sites, with an odd number it is a site; a lens has all
/// eight symmetries of the square.
///
/// The grid of a hexagonal lattice has places half a pitch apart along x and a row apart along y, an odd number of them along
/// an axis. A place is a site if the sum of column and row is even ([`Lattice::has`]), so that one is in the centre, and a lens
/// has the four symmetries of a rectangle. The grid is as many places high as wide, more than the sites reach
/// ([`Lattice::reach`]).
///
/// In a file a place is a whole number of database units ([`Lattice::place_units`]): the nearest, of two the farther from the
/// centre, so that sites related by a symmetry stay so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Lattice {
    kind: LatticeKind,
    pitch: Pitch,
    unit: DatabaseUnit,
    sites: usize,
}

impl Lattice {
    /// A square lattice of `sites` places an axis, `pitch_nm` apart, on the grid of 1 nm.
    ///
    /// # Errors
    /// If the pitch is zero, or there are no sites.
    pub fn new(pitch_nm: u32, sites: usize) -> Result<Self> {
        Self::of_kind(LatticeKind::Square, pitch_nm, sites)
    }

    /// A lattice of a kind in a grid of `sites` places an axis, on the grid of 1 nm.
    ///
    /// # Errors
    /// As [`Lattice::new`]; also if the places of a hexagonal lattice are an even number.
    pub fn of_kind(kind: LatticeKind, pitch_nm: u32, sites: usize) -> Result<Self> {
        Self::on_grid(kind, pitch_nm.into(), DatabaseUnit::Nanometre, sites)
    }

    /// A lattice of a kind in a grid of `sites` places an axis, in a file of this database unit.
    ///
    /// # Errors
    /// As [`Lattice::of_kind`]; also if the pitch of a hexagonal lattice is no multiple of the unit.
    pub fn on_grid(kind: LatticeKind, pitch: Pitch, unit: DatabaseUnit, sites: usize) -> Result<Self> {
        let is_hexagonal = kind == LatticeKind::Hexagonal;
        if pitch == Pitch::whole(0) || (is_hexagonal && !unit.divides(pitch)) {
            return Err(Error::refused(
                "lattice/off-grid",
                format!("a {kind} lattice with a pitch of {pitch} nm on a grid of {unit} nm"),
                "use a positive multiple of the grid",
            ));
        }
        if sites == 0 || sites > 1 << 20 {
            return Err(Error::refused(
                "lattice/site-count-out-of-range",
                format!("the lattice has {sites} sites along an axis"),
                "use 1 to 1,048,576 sites along an axis",
            ));
        }
        if is_hexagonal && sites.is_multiple_of(2) {
            return Err(Error::refused(
                "lattice/even-site-count",
                format!("the hexagonal lattice has {sites} places along an axis, an even number"),
                "use an odd number: one place is in the centre",
            ));
        }
        let lattice = Self {
            kind,
            pitch,
            unit,
            sites,
        };
        // Squares of distances are held in units of half the grid.
        if is_hexagonal && lattice.half_index(0).unsigned_abs() * unit.of(pitch) as u64 > MOST_UNITS {
            return Err(Error::refused(
                "lattice/sites",
                format!("a hexagonal lattice of {sites} places an axis on a grid of {unit} nm"),
                "use a larger database unit or a smaller lens",
            ));
        }
        Ok(lattice)
    }

    /// The smallest square lattice with an even number of sites that covers a disc of this diameter, on the grid of 1 nm.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn covering(diameter_nm: u32, pitch_nm: u32) -> Result<Self> {
        Self::of_kind_covering(LatticeKind::Square, diameter_nm, pitch_nm)
    }

    /// The smallest lattice of a kind that covers a disc of this diameter, on the grid of 1 nm.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn of_kind_covering(kind: LatticeKind, diameter_nm: u32, pitch_nm: u32) -> Result<Self> {
        Self::covering_on_grid(kind, diameter_nm, pitch_nm.into(), DatabaseUnit::Nanometre)
    }

    /// The smallest lattice of a kind that covers a disc of this diameter, in a file of this database unit. The sites of a square
    /// one are an even number; an odd one, with a site in the centre, where the pitch is a multiple of the unit and half of it
    /// is none: so all places are on the grid.
    ///
    /// # Errors
    /// As [`Lattice::on_grid`].
    pub fn covering_on_grid(kind: LatticeKind, diameter_nm: u32, pitch: Pitch, unit: DatabaseUnit) -> Result<Self> {
        if pitch == Pitch::whole(0) {
            return Self::on_grid(kind, pitch, unit, 1);
        }
        let halves = 2 * pitch.half();
        let across = (i64::from(diameter_nm) * Pitch::HALVES_PER_NM + halves - 1) / halves;
        let across = across as usize;
        let sites = match kind {
            _ if across == 0 => 0,
            LatticeKind::Square if unit.divides(pitch) && !unit.divides_half(pitch) => across + (across + 1) % 2,
            LatticeKind::Square => across + across % 2,
            // Half a pitch apart, and the middle.
            LatticeKind::Hexagonal => 2 * across + 1,
        };
        Self::on_grid(kind, pitch, unit, sites)
    }

    /// This lattice with another number of places an axis.
    ///
    /// # Errors
    /// As [`Lattice::on_grid`].
    pub fn with_sites(&self, sites: usize) -> Result<Self> {
        Self::on_grid(self.kind, self.pitch, self.unit, sites)
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
    pub fn pitch_nm(&self) -> Pitch {
        self.pitch
    }

    /// Database unit of the file that it is written in.
    pub fn unit(&self) -> DatabaseUnit {
        self.unit
    }

    /// Distance of neighbouring sites (um).
    pub fn pitch_um(&self) -> f64 {
        self.pitch.nm() * 1e-3
    }

    /// Distance of two rows (nm).
    pub fn row_nm(&self) -> f64 {
        self.kind.row_nm(self.pitch, self.unit)
    }

    /// Number of places of the grid along an axis; on a square lattice each is a site.
    pub fn sites(&self) -> usize {
        self.sites
    }

    /// Distance of the places of the grid along x and along y (nm).
    #[inline]
    pub fn steps_nm(&self) -> [f64; 2] {
        match self.kind {
            LatticeKind::Square => [self.pitch.nm(); 2],
            LatticeKind::Hexagonal => [self.pitch.nm() / 2.0, self.row_nm()],
        }
    }

    /// Distance of the places of the grid along x and along y (um).
    pub fn steps_um(&self) -> [f64; 2] {
        self.steps_nm().map(|step| step * 1e-3)
    }

    /// Edges of a rectangle of the chip for each site: the pitch, and the distance of two rows (um).
    pub fn cell_um(&self) -> [f64; 2] {
        [self.pitch.nm(), self.row_nm()].map(|edge| edge * 1e-3)
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
        let rows = (middle as f64 * x / y) as usize;
        [all, middle - rows..middle + rows + 1]
    }

    /// Columns and rows whose places from the centre are within two ends along x and along y, both included (nm).
    pub fn within(&self, ends_nm: [[i64; 2]; 2]) -> [std::ops::Range<usize>; 2] {
        let (reach, steps) = (self.reach(), self.steps_nm());
        [0, 1].map(|axis| {
            let std::ops::Range { start, end } = reach[axis];
            let (first, step) = (self.place_nm(axis, start), steps[axis]);
            // The first place at or beyond a length: so many steps, rounded up.
            let from = |nm: i64| start + ((nm as f64 - first) / step).ceil().clamp(0.0, (end - start) as f64) as usize;
            let [least, greatest] = ends_nm[axis];
            let low = from(least);
            low..from(greatest + 1).max(low)
        })
    }

    /// The outermost places of these columns and rows from the centre, along x and along y, outwards to whole nanometres (nm).
    pub fn ends_nm(&self, reach: &[std::ops::Range<usize>; 2]) -> [[i64; 2]; 2] {
        [0, 1].map(|axis| {
            let std::ops::Range { start, end } = reach[axis];
            let [first, last] = [start, end.max(start + 1) - 1].map(|i| self.place_nm(axis, i));
            [first.floor() as i64, last.ceil() as i64]
        })
    }

    /// Sides of a lens that takes all of it, along x and along y (nm): from its first place to its last, and a pitch,
    /// so that pillars of two such lenses side by side are a pitch apart.
    pub fn sides_nm(&self) -> [i64; 2] {
        self.ends_nm(&self.reach())
            .map(|[first, last]| last - first + self.pitch.at_least_nm())
    }

    /// Steps along columns and rows from a site to half of its neighbours; the others are on the opposite sides.
    pub fn neighbours(&self) -> &'static [[i64; 2]] {
        match self.kind {
            LatticeKind::Square => &[[1, 0], [0, 1]],
            LatticeKind::Hexagonal => &[[2, 0], [1, 1], [-1, 1]],
        }
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre in [`Pitch::HALVES_PER_NM`]: exact.
    #[inline]
    fn place(&self, axis: usize, i: usize) -> i64 {
        match (self.kind, axis) {
            (LatticeKind::Square, _) => self.half_index(i) * self.pitch.half(),
            // An odd number of places: twice the place is even.
            (LatticeKind::Hexagonal, 0) => self.half_index(i) / 2 * self.pitch.half(),
            (LatticeKind::Hexagonal, _) => {
                let row = LatticeKind::row_units(self.pitch, self.unit);
                self.half_index(i) / 2 * row * (Pitch::HALVES_PER_NM / self.unit.per_nm())
            }
        }
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre (nm).
    #[inline]
    pub fn place_nm(&self, axis: usize, i: usize) -> f64 {
        self.place(axis, i) as f64 / Pitch::HALVES_PER_NM as f64
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre, to the nearest whole nanometre (nm).
    pub fn whole_nm(&self, axis: usize, i: usize) -> i64 {
        self.place_nm(axis, i).round() as i64
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre in a file (database units): mirror images of one
    /// another for `i` and the same number from the other end.
    #[inline]
    pub fn place_units(&self, axis: usize, i: usize) -> i64 {
        self.unit.rounded(self.place(axis, i))
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre in a file (nm).
    pub fn drawn_nm(&self, axis: usize, i: usize) -> f64 {
        self.place_units(axis, i) as f64 / self.unit.per_nm() as f64
    }

    /// Distance of neighbouring places in a file along both axes (database units), if it is one number.
    pub fn grid_step(&self) -> Option<i64> {
        let is_exact = self.is_square() && (self.unit.divides_half(self.pitch) || self.rounding_nm() == 0.0);
        is_exact.then(|| self.unit.of(self.pitch))
    }

    /// Largest distance along an axis of a place in a file from the place on the lattice (nm); zero where all are on the grid.
    pub fn rounding_nm(&self) -> f64 {
        let off = |axis, i| (self.drawn_nm(axis, i) - self.place_nm(axis, i)).abs();
        // Remainders repeat after so many places at most.
        let places = self.sites.min(2 * Pitch::HALVES_PER_NM as usize);
        let all = (0..2).flat_map(|axis| (0..places).map(move |i| off(axis, i)));
        all.fold(0.0, f64::max)
    }

    /// Place of column (axis 0) or row (axis 1) number `i` from the centre (um).
    #[inline]
    pub fn place_um(&self, axis: usize, i: usize) -> f64 {
        self.place_nm(axis, i) * 1e-3
    }

    /// Square of the distance of a place from the centre (nm^2); the same for places related by symmetry.
    pub fn radius2_nm2(&self, ix: usize, iy: usize) -> f64 {
        self.place_nm(0, ix).powi(2) + self.place_nm(1, iy).powi(2)
    }

    /// Square of the distance of a place from the centre in units of [`Lattice::unit_um`]: exact, so that sites related by
    /// symmetry agree to the last bit in everything computed from it.
    #[inline]
    pub fn units2(&self, ix: usize, iy: usize) -> i64 {
        match self.kind {
            LatticeKind::Square => self.half_radius2(ix, iy),
            LatticeKind::Hexagonal => {
                let steps = [
                    self.unit.of(self.pitch),
                    2 * LatticeKind::row_units(self.pitch, self.unit),
                ];
                let [x, y] = [self.half_index(ix) / 2 * steps[0], self.half_index(iy) / 2 * steps[1]];
                x * x + y * y
            }
        }
    }

    /// Largest square of a distance from the centre within a circle of this diameter, in the units of [`Lattice::units2`]: exact.
    pub fn most_units2(&self, diameter_nm: u32) -> i64 {
        let d = i128::from(diameter_nm);
        match self.kind {
            LatticeKind::Square => {
                let (d, p) = (d * i128::from(Pitch::HALVES_PER_NM), 2 * i128::from(self.pitch.half()));
                (d * d / (p * p)) as i64
            }
            LatticeKind::Hexagonal => (d * i128::from(self.unit.per_nm())).pow(2).min(i64::MAX.into()) as i64,
        }
    }

    /// A pitch in the units of which [`Lattice::units2`] has squares.
    pub fn units_of_pitch(&self) -> i64 {
        match self.kind {
            LatticeKind::Square => 2,
            LatticeKind::Hexagonal => 2 * self.unit.of(self.pitch),
        }
    }

    /// A length of which distances along both axes are whole numbers: half a pitch, or half a database unit on a hexagonal
    /// lattice (nm).
    #[inline]
    pub fn unit_nm(&self) -> f64 {
        match self.kind {
            LatticeKind::Square => 0.5 * self.pitch.nm(),
            LatticeKind::Hexagonal => 0.5 * self.unit.nm(),
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

    /// Place of site `i` of an axis of a square lattice from the centre (um).
    pub fn coordinate_um(&self, i: usize) -> f64 {
        debug_assert!(self.is_square(), "both axes are asked for as one");
        self.place_um(0, i)
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
            assert!(lattice.has(middle, middle) && lattice.radius2_nm2(middle, middle) == 0.0);
            assert!(lattice.place_nm(0, n - 1) * 2.0 >= 10_000.0 - f64::from(pitch));
            let distances: Vec<f64> = (0..n * n)
                .map(|k| (k % n, k / n))
                .filter(|&(ix, iy)| lattice.has(ix, iy) && (ix, iy) != (middle, middle))
                .map(|(ix, iy)| lattice.radius2_nm2(ix, iy).sqrt())
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
                let r = lattice.radius2_nm2(ix, iy).sqrt();
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
            let area = 1e-6 * x * n as f64 * y * rows.len() as f64;
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
                assert_eq!(lattice.place_nm(0, i), lattice.place_nm(1, i));
                assert_eq!(lattice.place_units(0, i) as f64, lattice.place_nm(0, i));
            }
            assert_eq!(lattice.reach(), [0..sites, 0..sites]);
            let r2 = lattice.half_radius2(1, 2) * 350 * 350;
            assert_eq!(4.0 * lattice.radius2_nm2(1, 2), r2 as f64);
        }
    }

    /// Pitches of published lenses: exact on a grid that divides them, else off by half a unit at most; mirror images always.
    #[test]
    fn places_are_the_nearest_of_the_grid_and_mirror_images() {
        use DatabaseUnit::{Half, Nanometre, Tenth};
        for (kind, pitch, unit, sites, rounding) in [
            (LatticeKind::Square, 350.0, Nanometre, 30, 0.0),
            (LatticeKind::Square, 325.0, Nanometre, 31, 0.0),
            (LatticeKind::Square, 351.0, Half, 30, 0.0),
            (LatticeKind::Square, 433.3, Tenth, 25, 0.0),
            (LatticeKind::Square, 433.3, Nanometre, 24, 0.45),
            (LatticeKind::Hexagonal, 325.0, Nanometre, 63, 0.5),
            (LatticeKind::Hexagonal, 325.0, Half, 63, 0.0),
        ] {
            let pitch = Pitch::of_nm(pitch).unwrap();
            let lattice = Lattice::covering_on_grid(kind, 10_001, pitch, unit).unwrap();
            assert_eq!(lattice.sites(), sites, "{pitch}");
            assert!(
                (lattice.rounding_nm() - rounding).abs() < 1e-9,
                "{pitch}: {}",
                lattice.rounding_nm()
            );
            for (axis, i) in (0..2).flat_map(|axis| (0..sites).map(move |i| (axis, i))) {
                assert_eq!(lattice.place_units(axis, i), -lattice.place_units(axis, sites - 1 - i));
                let off = lattice.drawn_nm(axis, i) - lattice.place_nm(axis, i);
                assert!(off.abs() <= lattice.rounding_nm() + 1e-9);
            }
            let (ix, iy) = (sites - 1, sites / 3);
            let um = lattice.unit_um() * (lattice.units2(ix, iy) as f64).sqrt();
            assert!((um - lattice.radius2_nm2(ix, iy).sqrt() * 1e-3).abs() < 1e-9, "{pitch}");
        }
        let odd = Pitch::of_nm(433.3).unwrap();
        assert!(Lattice::covering_on_grid(LatticeKind::Hexagonal, 10_000, odd, Nanometre).is_err());
    }
}
