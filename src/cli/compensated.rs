//! The array that a layout must hold: of the design, or of the design with what a process makes of it taken into account.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::compensate::{compensate, compensated_name};
use metalith::{CalibratedModel, Design, Error, PillarArray, Result};

use super::Terminal;
use super::verify::FidelityArg;

/// Design that a layout is compared with.
#[derive(Args)]
pub(crate) struct CompensatedFor {
    /// Model that the layout was compensated with by `metalith layout --compensate MODEL`: pillars are compared with the
    /// compensated design.
    #[arg(id = "compensated", long, value_name = "MODEL", requires = "design")]
    pub model: Option<PathBuf>,
}

impl CompensatedFor {
    /// The array of a design. With a model it is the compensated one, and the design has the name that its layout has.
    ///
    /// # Errors
    /// If the model cannot be read, a cell cannot be solved, or the user stopped it.
    pub(crate) fn array(&self, design: &mut Design, terminal: &Terminal) -> Result<PillarArray> {
        let model = self.model.as_deref().map(CalibratedModel::read).transpose()?;
        let array = PillarArray::build(design, terminal)?;
        match model {
            None => Ok(array),
            Some(model) => {
                let compensated = compensate(design, &array, &model, terminal)?;
                design.name = compensated_name(&design.name);
                Ok(compensated.array)
            }
        }
    }
}

/// Refuse a cell of the pillars as drawn for a compensated layout, which is right when it is made, not as it is drawn.
///
/// # Errors
/// If both a model, named by `option`, and a cell are given.
pub(crate) fn judged_as_made(option: &str, model: Option<&Path>, fidelity: Option<FidelityArg>) -> Result<()> {
    if model.is_none() || fidelity.is_none() {
        return Ok(());
    }
    Err(Error::refused(
        "option/fidelity-with-compensated",
        "`--fidelity` simulates pillars as drawn, and a compensated layout is simulated as fabricated",
        format!("leave out `--fidelity`, or `{option}` for the layout as designed"),
    ))
}
