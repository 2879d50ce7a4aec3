//! A layout as drawn, or the chip as made.

use metalith_cell::{CellModel, Fidelity};
use metalith_core::Result;

use super::AsBuiltChip;

/// Simulation case of the pillars of a layout.
#[derive(Clone, Copy)]
pub enum SimulationCase<'a> {
    /// Pillars as drawn, by a cell; chip, light and sensor are where the design has them.
    Cell(&'a dyn CellModel),
    /// Pillars as fabricated on a measured line and bench.
    Made(&'a AsBuiltChip),
}

impl<'a> From<&'a dyn CellModel> for SimulationCase<'a> {
    fn from(cell: &'a dyn CellModel) -> Self {
        Self::Cell(cell)
    }
}

impl<'a> From<&'a AsBuiltChip> for SimulationCase<'a> {
    fn from(chip: &'a AsBuiltChip) -> Self {
        Self::Made(chip)
    }
}

impl SimulationCase<'_> {
    /// Fidelity of the description of the cell.
    pub fn fidelity(&self) -> Fidelity {
        match self {
            Self::Cell(cell) => cell.fidelity(),
            Self::Made(_) => Fidelity::Calibrated,
        }
    }

    /// True if images of elements that are equal by a symmetry are equal by it.
    pub fn keeps_symmetry(&self) -> bool {
        match self {
            Self::Cell(_) => true,
            Self::Made(chip) => chip.perturbation().keeps_symmetry(),
        }
    }

    /// |t| of a cell that passes all its power in the zero order.
    ///
    /// # Errors
    /// If the wavelength is outside what the cell covers.
    pub fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        match self {
            Self::Cell(cell) => cell.full_transmission(wavelength_um),
            Self::Made(chip) => chip.full_transmission(wavelength_um),
        }
    }
}
