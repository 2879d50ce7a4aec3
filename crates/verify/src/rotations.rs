//! Effect of a lattice of equally rotated rectangles on the phase that is asked of them.

use serde::Serialize;

use metalith_cell::{MappingError, RotatedCell, RotationCurve, RotationMapping, Truncation};
use metalith_core::Result;
use metalith_design::Design;
use metalith_optics::SimulationCase;

/// Lattices of equal rotations, at the wavelength of the mapping.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EqualRotations {
    /// Phase errors of the mapping of the design, for pillars as drawn.
    pub own: MappingError,
    /// Error of a rotation by half of the phase.
    pub half: MappingError,
    /// Diffraction orders that the cell is solved with, and how sure they are; not said of a cell for bands alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truncation: Option<Truncation>,
}

impl EqualRotations {
    /// Rotations by the simulation model, if that is a cell of rotated rectangles.
    ///
    /// # Errors
    /// As [`RotatedCell::response`].
    pub(super) fn of(design: &Design, judge: SimulationCase<'_>) -> Result<Option<Self>> {
        match judge {
            SimulationCase::Cell(cell) => cell.rotated().map(|cell| Self::by(design, cell)).transpose(),
            SimulationCase::Made(_) => Ok(None),
        }
    }

    fn by(design: &Design, cell: &RotatedCell) -> Result<Self> {
        let (wavelength_um, pillars) = (design.mapping.wavelength_um, cell.pillars());
        let curve = RotationCurve::new(cell, wavelength_um)?;
        Ok(Self {
            own: curve.error(&design.mapping.rotation, pillars)?,
            half: curve.error(&RotationMapping::default(), pillars)?,
            truncation: cell.truncation(wavelength_um)?,
        })
    }
}
