//! Places of a lattice: from the centre, on the grid of a file, and their distances as whole numbers.

use super::{Lattice, LatticeKind, Rows};
use crate::Pitch;

/// Units of distances on a hexagonal lattice whose rows are no whole number of database units, in a nanometre.
const UNITS_PER_NM: i64 = 40;
/// Steps of places in such a unit.
const PLACES_PER_UNIT: i64 = Pitch::HALVES_PER_NM / UNITS_PER_NM;

impl Lattice {
    /// Place of column (axis 0) or row (axis 1) number `i` from the centre in [`Pitch::HALVES_PER_NM`]: exact.
    #[inline]
    fn place(&self, axis: usize, i: usize) -> i64 {
        match (self.kind, axis) {
            (LatticeKind::Square, _) => self.half_index(i) * self.pitch.half(),
            // An odd number of places: twice the place is even.
            (LatticeKind::Hexagonal, 0) => self.half_index(i) / 2 * self.pitch.half(),
            (LatticeKind::Hexagonal, _) if self.rows == Rows::Exact => {
                let rows = (self.half_index(i) / 2) as f64;
                (rows * self.row_nm() * UNITS_PER_NM as f64).round() as i64 * PLACES_PER_UNIT
            }
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
        if self.rows == Rows::Exact {
            return 0.5 * self.unit.nm();
        }
        let off = |axis, i| (self.drawn_nm(axis, i) - self.place_nm(axis, i)).abs();
        if !self.pitch.is_of_designs() {
            return 0.5 * self.unit.nm();
        }
        // Remainders repeat after so many places at most.
        let places = self.sites.min(2 * UNITS_PER_NM as usize);
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
            LatticeKind::Hexagonal if self.rows == Rows::Exact => {
                let [x, y] = [self.place(0, ix), self.place(1, iy)].map(whole_units);
                x * x + y * y
            }
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
            LatticeKind::Hexagonal => {
                let per_radius = match self.rows {
                    Rows::Whole => self.unit.per_nm(),
                    Rows::Exact => UNITS_PER_NM / 2,
                };
                (d * i128::from(per_radius)).pow(2).min(i64::MAX.into()) as i64
            }
        }
    }

    /// A pitch in the units of which [`Lattice::units2`] has squares.
    pub fn units_of_pitch(&self) -> i64 {
        match self.kind {
            LatticeKind::Square => 2,
            LatticeKind::Hexagonal if self.rows == Rows::Exact => whole_units(2 * self.pitch.half()),
            LatticeKind::Hexagonal => 2 * self.unit.of(self.pitch),
        }
    }

    /// A length of which distances along both axes are whole numbers: half a pitch, or on a hexagonal lattice half a database
    /// unit, or 0.025 nm where rows are no whole number of units (nm).
    #[inline]
    pub fn unit_nm(&self) -> f64 {
        match self.kind {
            LatticeKind::Square => 0.5 * self.pitch.nm(),
            LatticeKind::Hexagonal if self.rows == Rows::Exact => 1.0 / UNITS_PER_NM as f64,
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

    /// Number of sites that the symmetries of the square take a site to, itself included: 8, 4 on an axis or a diagonal, 1 in the
    /// middle.
    #[inline]
    pub fn copies(&self, ix: usize, iy: usize) -> usize {
        let [x, y] = [ix, iy].map(|i| self.half_index(i).abs());
        match (x == y, x == 0 || y == 0) {
            (true, true) => 1,
            (false, false) => 8,
            _ => 4,
        }
    }
}

/// Steps of places as units of distances, rounded.
fn whole_units(places: i64) -> i64 {
    (places + places.signum() * (PLACES_PER_UNIT / 2)) / PLACES_PER_UNIT
}
