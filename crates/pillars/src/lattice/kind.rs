//! Kinds of lattices: square and hexagonal.

use std::fmt;

use serde::Serialize;

use crate::{DatabaseUnit, PillarShape, Pitch};

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
    pub(super) fn row_units(pitch: Pitch, unit: DatabaseUnit) -> i64 {
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
