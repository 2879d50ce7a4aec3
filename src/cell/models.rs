//! The cell of a design, as true as asked for.

use std::path::Path;

use super::{CellModel, CellStack, Fidelity, FittedCell, PointwiseCell, PublishedCell, RigorousCell};
use crate::design::Design;
use crate::error::{Error, Result};

/// The cells of a design for a few wavelengths, one for each fidelity asked for.
///
/// # Errors
/// If a fidelity cannot be had for this design.
pub fn cell_models(design: &Design, wanted: &[Fidelity]) -> Result<Vec<Box<dyn CellModel>>> {
    let folder = design.path.parent().unwrap_or(Path::new(""));
    wanted
        .iter()
        .map(|fidelity| -> Result<Box<dyn CellModel>> {
            match fidelity {
                Fidelity::Published => Ok(Box::new(PublishedCell::new(design.cell.pitch_nm))),
                Fidelity::Rigorous => {
                    let stack = CellStack::of_spec(&design.cell, folder)?;
                    Ok(Box::new(PointwiseCell::new(stack, design.cell.widths_nm())))
                }
                Fidelity::Calibrated => Err(Error::invalid(
                    "a calibrated cell without the model it is calibrated by",
                    "read the model that `metalith calibrate` wrote and take its cell",
                )),
                Fidelity::Fitted => {
                    let stack = CellStack::of_spec(&design.cell, folder)?;
                    let band_um = RigorousCell::band_um(design);
                    Ok(Box::new(FittedCell::of_stack(
                        &stack,
                        band_um,
                        design.cell.width_range_nm,
                    )?))
                }
            }
        })
        .collect()
}
