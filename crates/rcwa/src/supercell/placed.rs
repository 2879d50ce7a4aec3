//! Places of the sites of a supercell, and directions of its plane waves.

use super::Supercell;
use super::sites::SiteLattice;
use crate::CellLattice;

/// The sites of a supercell in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    pub lattice: SiteLattice,
    /// Distance of staggered rows (pitches); none on a square lattice.
    pub staggered: Option<f64>,
}

impl Placed {
    pub(crate) fn of(cell: &Supercell) -> Self {
        Self {
            lattice: cell.lattice,
            staggered: match cell.sites {
                CellLattice::Square => None,
                CellLattice::Staggered { row_nm } => Some(row_nm / cell.pitch_nm),
            },
        }
    }

    /// The plane waves that are kept: see [`SiteLattice::waves`] and [`SiteLattice::staggered_waves`].
    pub(crate) fn waves(&self, highest: usize) -> Vec<[i32; 2]> {
        match self.staggered {
            None => self.lattice.waves(highest),
            Some(_) => self.lattice.staggered_waves(highest),
        }
    }

    /// Wave vector of a wave over that in vacuum, where `k` is that of the incident one and `step` the wavelength over the pitch.
    pub(crate) fn sines(&self, wave: [i32; 2], k: [f64; 2], step: f64) -> [f64; 2] {
        if self.staggered.is_some() {
            let vector = self.vector(wave);
            return [0, 1].map(|axis| k[axis] + vector[axis] * step);
        }
        let part = step / self.lattice.len() as f64;
        [0, 1].map(|axis| k[axis] + f64::from(wave[axis]) * part)
    }

    /// Wave vector of a wave less that of the incident one, times the pitch, over one turn.
    pub(crate) fn vector(&self, wave: [i32; 2]) -> [f64; 2] {
        let [x, y] = wave.map(|turns| f64::from(turns) / self.lattice.len() as f64);
        match self.staggered {
            None => [x, y],
            Some(row) => [x, (y - 0.5 * x) / row],
        }
    }

    /// True if the x axis mirrors it by mirroring each of its sites.
    pub(crate) fn is_mirrored_row(&self) -> bool {
        self.staggered.is_none() && self.lattice.is_row()
    }
}
