//! Widths of an element as they are read: nothing, an eighth that symmetry makes whole, or all.

use std::ops::Range;

use super::WHOLE_SITE_BYTES;
use metalith_pillars::{EighthMap, Lattice, PillarMap, PillarRows};

/// Pillars that were read of one element.
#[derive(Clone, Debug)]
pub enum StoredPillars {
    /// No pillar yet: no memory.
    Empty(Lattice),
    /// All pillars came with all copies of them by the symmetries of the square.
    Eighth(EighthMap),
    Whole(PillarMap),
}

impl StoredPillars {
    /// Memory of the sites that are held (bytes).
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Empty(_) => 0,
            Self::Eighth(map) => map.bytes(),
            Self::Whole(map) => WHOLE_SITE_BYTES * map.number.len() as u64,
        }
    }

    /// True if no pillar is without its copies.
    pub fn is_folded(&self) -> bool {
        !matches!(self, Self::Whole(_))
    }

    /// The pillars as a map.
    pub fn into_map(self) -> PillarMap {
        match self {
            Self::Whole(map) => map,
            other => other.whole(),
        }
    }

    fn rows(&self) -> Option<&dyn PillarRows> {
        match self {
            Self::Empty(_) => None,
            Self::Eighth(map) => Some(map),
            Self::Whole(map) => Some(map),
        }
    }
}

impl PillarRows for StoredPillars {
    fn lattice(&self) -> Lattice {
        match self {
            Self::Empty(lattice) => *lattice,
            Self::Eighth(map) => map.lattice(),
            Self::Whole(map) => map.lattice,
        }
    }

    #[inline]
    fn number(&self, ix: usize, iy: usize) -> u16 {
        match self {
            Self::Empty(_) => 0,
            Self::Eighth(map) => map.number(ix, iy),
            Self::Whole(map) => map.number[[iy, ix]],
        }
    }

    fn held(&self) -> Option<&PillarMap> {
        match self {
            Self::Whole(map) => Some(map),
            Self::Empty(_) | Self::Eighth(_) => None,
        }
    }

    fn row<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        match self {
            Self::Empty(_) => {
                room.clear();
                room.resize(columns.len(), 0);
                room
            }
            Self::Eighth(map) => map.row(iy, columns, room),
            Self::Whole(map) => map.row(iy, columns, room),
        }
    }

    fn pillars(&self) -> u64 {
        self.rows().map_or(0, PillarRows::pillars)
    }

    fn histogram(&self) -> Vec<u64> {
        let nothing = || vec![(self.lattice().sites() as u64).pow(2)];
        self.rows().map_or_else(nothing, PillarRows::histogram)
    }
}
