//! Effect of a lattice of equally rotated rectangles on the phase that is asked of them.

use serde::Serialize;

use metalith_cell::{
    CellResponse, Illumination, MappingError, PolarisedTables, RotationCurve, RotationMapping, Truncation,
};
use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_optics::CaseOptics;

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
    /// If the cell has no answer.
    pub(super) fn of(design: &Design, judge: &CaseOptics<'_>, progress: &dyn Progress) -> Result<Option<Self>> {
        if design.cell.shape.rotated().is_none() {
            return Ok(None);
        }
        let response = judge.response(&Illumination::normal(design.mapping.wavelength_um), progress)?;
        let Some(PolarisedTables::Hands(hands)) = response.as_deref().and_then(CellResponse::polarised) else {
            return Ok(None);
        };
        Ok(hands.rotation.as_ref().map(|response| {
            let curve = RotationCurve::new(response.clone());
            Self {
                own: curve.error(&design.mapping.rotation),
                half: curve.error(&RotationMapping::default()),
                truncation: response.truncation(),
            }
        }))
    }
}
