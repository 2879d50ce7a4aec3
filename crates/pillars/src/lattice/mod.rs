//! The lattice that pillars stand on: square or hexagonal.

mod kind;
mod places;
#[cfg(test)]
mod tests;

pub use kind::LatticeKind;

use crate::{DatabaseUnit, Pitch};
use metalith_core::{Error, Result};

/// Largest distance of which the square and the sum of two squares are held.
const MOST_UNITS: u64 = 1 << 31;
/// Width of a lattice, at most (nm): ten times as much in steps of places are held with their sign.
const MOST_NM: f64 = 1e11;

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
    rows: Rows,
    sites: usize,
}

/// Distance of the rows of a hexagonal lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Rows {
    /// A whole number of database units, as in designs.
    #[default]
    Whole,
    /// Half the root of three of the pitch, each place rounded for itself: as loops of other programs draw it.
    Exact,
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
        Self::with_rows(kind, pitch, unit, Rows::Whole, sites)
    }

    /// A hexagonal lattice of any pitch in a grid of `sites` places an axis whose rows are half the root of three of the pitch
    /// apart: places in a file of this database unit are rounded one by one.
    ///
    /// # Errors
    /// As [`Lattice::of_kind`].
    pub fn hexagonal_by_place(pitch: Pitch, unit: DatabaseUnit, sites: usize) -> Result<Self> {
        Self::with_rows(LatticeKind::Hexagonal, pitch, unit, Rows::Exact, sites)
    }

    fn with_rows(kind: LatticeKind, pitch: Pitch, unit: DatabaseUnit, rows: Rows, sites: usize) -> Result<Self> {
        let is_hexagonal = kind == LatticeKind::Hexagonal;
        let is_off_grid = is_hexagonal && rows == Rows::Whole && !unit.divides(pitch);
        if pitch == Pitch::whole(0) || is_off_grid {
            return Err(Error::refused(
                "lattice/off-grid",
                format!("a {kind} lattice with a pitch of {pitch} nm on a grid of {unit} nm"),
                "use a positive multiple of the grid",
            ));
        }
        // Places are whole numbers of small steps, and of database units, to either side.
        let is_too_wide = pitch.nm() * sites as f64 > MOST_NM;
        if sites == 0 || sites > 1 << 20 || is_too_wide {
            return Err(Error::refused(
                "lattice/site-count-out-of-range",
                format!("the lattice has {sites} sites along an axis, {pitch} nm apart"),
                "use 1 to 1,048,576 sites along an axis, over 100 m at most",
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
            rows,
            sites,
        };
        // Squares of distances are held in units of half the grid, or of the places.
        if is_hexagonal && lattice.half_index(0).unsigned_abs() * lattice.units_of_pitch() as u64 / 2 > MOST_UNITS {
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
        let across = Self::across(diameter_nm, pitch);
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
        Self::with_rows(self.kind, self.pitch, self.unit, self.rows, sites)
    }

    /// The smallest lattice like this one that covers a disc of this diameter: see [`Lattice::covering_on_grid`].
    ///
    /// # Errors
    /// As [`Lattice::on_grid`].
    pub fn covering_disc(&self, diameter_nm: u32) -> Result<Self> {
        match self.rows {
            Rows::Whole => Self::covering_on_grid(self.kind, diameter_nm, self.pitch, self.unit),
            Rows::Exact => self.with_sites(2 * Self::across(diameter_nm, self.pitch) + 1),
        }
    }

    /// Pitches in a length, rounded up.
    fn across(diameter_nm: u32, pitch: Pitch) -> usize {
        let halves = 2 * pitch.half();
        ((i64::from(diameter_nm) * Pitch::HALVES_PER_NM + halves - 1) / halves) as usize
    }

    /// True if the rows of a hexagonal lattice are as far apart as six equal neighbours have them, not a whole number of
    /// database units.
    pub fn has_exact_rows(&self) -> bool {
        self.rows == Rows::Exact
    }

    /// True if the distances of places along both axes are multiples of half the step of pitches of designs (0.025 nm).
    pub fn has_whole_steps(&self) -> bool {
        self.rows == Rows::Whole && self.pitch.is_of_designs()
    }

    /// True if pillars of one cell may stand on it and on another one: of one kind, with pitches that no design distinguishes.
    pub fn is_like(&self, other: &Self) -> bool {
        self.kind == other.kind && self.pitch.is_near(other.pitch)
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
        match self.rows {
            Rows::Whole => self.kind.row_nm(self.pitch, self.unit),
            Rows::Exact => 0.75f64.sqrt() * self.pitch.nm(),
        }
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
}
