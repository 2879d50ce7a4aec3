//! The cells that a design is optimised and judged with.

use std::path::Path;

use metalith_cell::{CellModel, Fidelity, RigorousCell};
use metalith_core::{Error, Progress, Result};
use metalith_design::{Design, cell_models};

use crate::robust::cells_off_height;

/// Cells that a design is optimised and judged with.
pub struct TaskCells {
    own: Box<dyn CellModel>,
    /// If there is a report, and the own one is another.
    judge: Option<Box<dyn CellModel>>,
    off_height: Vec<RigorousCell>,
}

impl TaskCells {
    /// Those that a design names; tables are taken from the folder `cache`, or made and kept there. `report`: also what a
    /// report judges with.
    ///
    /// # Errors
    /// If a material is not known over the band, unlike neighbours have one table alone, or the user stopped it.
    pub fn of(design: &Design, report: bool, cache: Option<&Path>, progress: &dyn Progress) -> Result<Self> {
        let rigorous = || -> Result<Box<dyn CellModel>> {
            Ok(Box::new(
                RigorousCell::obtain(&design.table_spec()?, cache, progress)?.0,
            ))
        };
        let fidelity = design.optimise.fidelity;
        let own = match fidelity {
            Fidelity::Rigorous => rigorous()?,
            _ => cell_models(design, &[fidelity])?.remove(0),
        };
        if fidelity == Fidelity::Neighbours {
            if design.verify.wavelengths_um.len() < 2 {
                let band = [design.optimise.band_um.0, design.optimise.band_um.1].map(|um| um * 1e3);
                return Err(Error::invalid(
                    format!(
                        "a table of unlike neighbours at one wavelength alone, for a band from {:.0} to {:.0} nm",
                        band[0], band[1]
                    ),
                    "name more in [verify] wavelengths_nm: the others of the band are taken from these",
                ));
            }
            // What has no table yet is solved here, once.
            own.among_neighbours_in_band(design.optimise.band_um.0, &|_| [0.0; 2], progress)?;
        }
        let judge = (report && fidelity != Fidelity::Rigorous).then(rigorous).transpose()?;
        let off_height = match &design.optimise.robust {
            Some(robust) if fidelity == Fidelity::Rigorous && robust.height > 0.0 => {
                cells_off_height(&design.table_spec()?, robust, cache, progress)?
            }
            _ => Vec::new(),
        };
        Ok(Self { own, judge, off_height })
    }

    /// What is optimised with.
    pub fn own(&self) -> &dyn CellModel {
        self.own.as_ref()
    }

    /// The cell of equal neighbours that figures are by too.
    pub fn rigorous(&self) -> &dyn CellModel {
        self.judge.as_deref().unwrap_or(self.own())
    }

    /// What layouts are judged with: the truest of these.
    pub fn judge(&self) -> &dyn CellModel {
        match self.own.fidelity() {
            Fidelity::Neighbours => self.own(),
            _ => self.rigorous(),
        }
    }

    /// The own one, then those at other film heights that a robust design counts.
    pub fn all(&self) -> Vec<&dyn CellModel> {
        let off_height = self.off_height.iter().map(|c| c as &dyn CellModel);
        std::iter::once(self.own()).chain(off_height).collect()
    }
}
