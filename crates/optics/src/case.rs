//! A layout as drawn, or the chip as made.

use metalith_cell::{CellModel, Fidelity};
use metalith_core::Result;

use super::AsBuiltChip;

/// What the pillars of a layout are simulated as.
#[derive(Clone, Copy)]
pub enum SimulationCase<'a> {
    /// As drawn, by a cell; chip, light and sensor are where the design has them.
    Cell(&'a dyn CellModel),
    /// As made on a measured line and bench.
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
    /// How truly the cell is described.
    pub fn fidelity(&self) -> Fidelity {
        match self {
            Self::Cell(cell) => cell.fidelity(),
            Self::Made(_) => Fidelity::Calibrated,
        }
    }

    /// Whether what is seen of elements that are alike by a symmetry is alike by it.
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
