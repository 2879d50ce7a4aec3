//! The cell of a design, as true as asked for.

use std::path::Path;

use metalith_cell::{
    CellModel, CellStack, Fidelity, FittedCell, PointwiseCell, PublishedCell, TableSpec, cache_folder,
};
use metalith_core::{Error, Result};
use metalith_grating::{Mapping, NeighbourCell};
use metalith_rcwa::Material;

use crate::{Design, WidthRule};

/// The band that every design's table spans (um).
const VISIBLE_UM: (f64, f64) = (0.4, 0.7);

impl Design {
    /// The folder that paths in the design count from.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The cell that the design asks for: upright walls, sharp corners, no mask.
    ///
    /// # Errors
    /// If a material is not known or its table cannot be read.
    pub fn cell_stack(&self) -> Result<CellStack> {
        let folder = self.folder();
        Ok(CellStack {
            pitch_nm: f64::from(self.cell.pitch_nm),
            height_nm: self.cell.pillar_height_nm,
            film: Material::resolve(&self.cell.pillar_material, folder)?,
            substrate: Material::resolve(&self.cell.substrate_material, folder)?,
            ambient: Material::constant(self.cell.ambient_index, 0.0)?,
            taper: 0.0,
            corner_radius_nm: 0.0,
            mask_height_nm: 0.0,
            mask: Material::named("alumina_zhukovsky_2015")?,
        })
    }

    /// The table of the cell that the design needs, over the visible and all wavelengths that it names.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn table_spec(&self) -> Result<TableSpec> {
        Ok(TableSpec::new(
            self.cell_stack()?,
            self.band_um(),
            self.cell.width_range_nm,
        ))
    }

    /// The visible and all wavelengths that the design names (um).
    fn band_um(&self) -> (f64, f64) {
        let named = self.verify.wavelengths_um.iter().chain([&self.mapping.wavelength_um]);
        named.fold(VISIBLE_UM, |(short, long), &l| (short.min(l), long.max(l)))
    }
}

/// The cells of a design for a few wavelengths, one for each fidelity asked for.
///
/// # Errors
/// If a fidelity cannot be had for this design.
pub fn cell_models(design: &Design, wanted: &[Fidelity]) -> Result<Vec<Box<dyn CellModel>>> {
    wanted
        .iter()
        .map(|fidelity| -> Result<Box<dyn CellModel>> {
            match fidelity {
                Fidelity::Published => Ok(Box::new(PublishedCell::new(design.cell.pitch_nm))),
                Fidelity::Rigorous => {
                    let stack = design.cell_stack()?;
                    Ok(Box::new(PointwiseCell::new(stack, design.cell.widths_nm())))
                }
                Fidelity::Neighbours => Ok(Box::new(NeighbourCell::new(
                    design.cell_stack()?,
                    mappings(design),
                    cache_folder(),
                ))),
                Fidelity::Calibrated => Err(Error::invalid(
                    "a calibrated cell without the model it is calibrated by",
                    "read the model that `metalith calibrate` wrote and make a `MadeChip` of it",
                )),
                Fidelity::Fitted => {
                    let stack = design.cell_stack()?;
                    Ok(Box::new(FittedCell::of_stack(
                        &stack,
                        design.band_um(),
                        design.cell.width_range_nm,
                    )?))
                }
            }
        })
        .collect()
}

/// How often the elements of a design draw each width beside which others: one mapping for each rule.
pub fn mappings(design: &Design) -> Vec<Mapping> {
    let rules = WidthRule::all(design);
    rules.iter().map(|rule| Mapping::new(|u| rule.width_nm(u))).collect()
}
