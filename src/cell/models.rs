//! The cell of a design, as true as asked for.

use super::{CellModel, Fidelity, PublishedCell, RigorousCell, cache_folder};
use crate::design::Design;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// The cells of a design, one for each fidelity asked for. The table of the rigorous cell is kept in the
/// user's cache and used again while its inputs are unchanged.
///
/// # Errors
/// If a fidelity cannot be had for this design, or the user stopped it.
pub fn cell_models(design: &Design, wanted: &[Fidelity], progress: &dyn Progress) -> Result<Vec<Box<dyn CellModel>>> {
    let cache = cache_folder();
    wanted
        .iter()
        .map(|fidelity| -> Result<Box<dyn CellModel>> {
            match fidelity {
                Fidelity::Published => Ok(Box::new(PublishedCell::new(design.cell.pitch_nm))),
                Fidelity::Rigorous => {
                    let (cell, _) = RigorousCell::of_design(design, cache.as_deref(), progress)?;
                    Ok(Box::new(cell))
                }
                Fidelity::Fitted => Err(Error::invalid(
                    "the `fitted` cell cannot be had yet",
                    "use --fidelity published or rigorous",
                )),
            }
        })
        .collect()
}
