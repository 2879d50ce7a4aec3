//! The array that a layout must hold: of the design, or of the design with what a process makes of it taken into account.

use std::path::PathBuf;

use clap::Args;
use metalith::compensate::{compensate, compensated_name};
use metalith::{CalibratedModel, Design, PillarArray, Result};

use super::Terminal;

/// What a layout is compared with.
#[derive(Args)]
pub struct CompensatedFor {
    /// The layout was made by `metalith layout --compensate MODEL`: its pillars are compared with those of the
    /// compensated design.
    #[arg(id = "compensated", long, value_name = "MODEL", requires = "design")]
    pub model: Option<PathBuf>,
}

impl CompensatedFor {
    /// The array of a design. With a model it is the compensated one, and the design has the name that its layout has.
    ///
    /// # Errors
    /// If the model cannot be read, a cell cannot be solved, or the user stopped it.
    pub fn array(&self, design: &mut Design, terminal: &Terminal) -> Result<PillarArray> {
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
