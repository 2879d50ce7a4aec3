//! What a layout is judged by, and the light that its cells see.

use std::collections::HashMap;

use num_complex::Complex64;

use metalith_cell::{CellModel, Fidelity};
use metalith_core::Progress;
use metalith_core::{Error, Result};
use metalith_wave::PlaneWave;

/// A cell, and how chip and sensor stand to one another.
#[derive(Clone, Copy)]
pub struct Premise<'a> {
    pub cell: &'a dyn CellModel,
    /// Added to the distance of the sensor [um].
    pub gap_um: f64,
    /// Added to the angle of incidence in the x-z and the y-z plane [rad].
    pub tilt_rad: [f64; 2],
}

impl<'a> From<&'a dyn CellModel> for Premise<'a> {
    /// The cell, with chip and sensor where the design has them.
    fn from(cell: &'a dyn CellModel) -> Self {
        Self {
            cell,
            gap_um: 0.0,
            tilt_rad: [0.0; 2],
        }
    }
}

impl Premise<'_> {
    /// Whether chip and sensor stand where the design has them.
    pub(super) fn in_place(&self) -> bool {
        self.gap_um == 0.0 && self.tilt_rad == [0.0; 2]
    }

    /// The wave as a tilted chip sees it.
    pub(super) fn tilted(&self, wave: &PlaneWave) -> PlaneWave {
        let turn = |sine: f64, by: f64| if by == 0.0 { sine } else { (sine.asin() + by).sin() };
        PlaneWave {
            wavelength_um: wave.wavelength_um,
            sin_x: turn(wave.sin_x, self.tilt_rad[0]),
            sin_y: turn(wave.sin_y, self.tilt_rad[1]),
        }
    }
}

/// Transmissions by width of one premise at one wavelength.
pub(super) struct Cells {
    pub fidelity: Fidelity,
    /// |t| of a cell that passes everything.
    pub full: f64,
    /// Along the normal.
    pub normal: Vec<Complex64>,
    /// By direction, for s and p; empty where the design asks for normal incidence, or the cell knows no angles.
    oblique: HashMap<[u64; 2], [Vec<Complex64>; 2]>,
}

impl Cells {
    /// Solve a cell along the normal.
    ///
    /// # Errors
    /// If it has no answer at this wavelength.
    pub fn new(cell: &dyn CellModel, wavelength_um: f64, widest_nm: u16) -> Result<Self> {
        Ok(Self {
            fidelity: cell.fidelity(),
            full: cell.full_transmission(wavelength_um)?,
            normal: cell.transmissions(wavelength_um, widest_nm)?,
            oblique: HashMap::new(),
        })
    }

    /// Solve it for more directions, those that are alike by symmetry once.
    ///
    /// # Errors
    /// As [`Cells::new`]; also if the user stopped it.
    pub fn look_along(
        &mut self,
        cell: &dyn CellModel,
        waves: &[PlaneWave],
        widest_nm: u16,
        progress: &dyn Progress,
    ) -> Result<()> {
        for wave in waves {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let sines = folded(wave);
            if sines != [0.0; 2]
                && !self.oblique.contains_key(&key(sines))
                && let Some(tables) = cell.oblique(wave.wavelength_um, sines, widest_nm)?
            {
                self.oblique.insert(key(sines), tables);
            }
            progress.advance(1);
        }
        Ok(())
    }

    /// The tables whose PSFs are to be averaged: one along the normal, one for each polarisation else.
    pub fn tables(&self, wave: &PlaneWave) -> &[Vec<Complex64>] {
        match self.oblique.get(&key(folded(wave))) {
            Some(both) => both,
            None => std::slice::from_ref(&self.normal),
        }
    }
}

/// Directions closer than this see the same cell [sine]: a thousandth of the angle over which a resonance passes.
const SAME_DIRECTION: f64 = 1e-5;

/// The direction that a square cell cannot tell from this one: both sines positive, the larger along x.
fn folded(wave: &PlaneWave) -> [f64; 2] {
    let [x, y] = [wave.sin_x, wave.sin_y].map(|s| (s.abs() / SAME_DIRECTION).round() * SAME_DIRECTION);
    [x.max(y), x.min(y)]
}

fn key(sines: [f64; 2]) -> [u64; 2] {
    sines.map(f64::to_bits)
}
