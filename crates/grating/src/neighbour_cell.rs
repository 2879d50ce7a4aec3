//! The cell of a design whose pillars have the neighbours that they have.

use std::path::PathBuf;

use num_complex::Complex64;

use metalith_cell::{CellModel, CellStack, Fidelity, NeighbourResponse, ObliqueTables, PointwiseCell};
use metalith_core::{Progress, Result};

use crate::{Mapping, NeighbourTable, NeighbourTableSpec};

/// Pillars among unlike neighbours, by [`NeighbourTable`]. Where it is asked for the transmission of a width alone, it
/// answers as [`PointwiseCell`]: that of a lattice of equal pillars.
#[derive(Clone, Debug)]
pub struct NeighbourCell {
    equal: PointwiseCell,
    stack: CellStack,
    mappings: Vec<Mapping>,
    cache: Option<PathBuf>,
}

impl NeighbourCell {
    /// `mappings`, at least one, say how often each width is drawn beside which others; tables are kept in the folder
    /// `cache`.
    pub fn new(stack: CellStack, mappings: Vec<Mapping>, cache: Option<PathBuf>) -> Self {
        let widths_nm = mappings.iter().flat_map(|m| m.samples_nm().iter().copied());
        Self {
            equal: PointwiseCell::new(stack.clone(), widths_nm),
            stack,
            mappings,
            cache,
        }
    }
}

impl CellModel for NeighbourCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Neighbours
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.equal.transmissions(wavelength_um, max_width_nm)
    }

    fn transmissions_in_band(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.equal.transmissions_in_band(wavelength_um, max_width_nm)
    }

    fn oblique(&self, wavelength_um: f64, sines: [f64; 2], max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        self.equal.oblique(wavelength_um, sines, max_width_nm)
    }

    fn oblique_in_band(&self, wavelength_um: f64, sines: [f64; 2], max_width_nm: u16) -> Result<Option<ObliqueTables>> {
        self.equal.oblique_in_band(wavelength_um, sines, max_width_nm)
    }

    fn among_neighbours(
        &self,
        wavelength_um: f64,
        sines: [f64; 2],
        progress: &dyn Progress,
    ) -> Result<Option<[NeighbourResponse; 2]>> {
        let spec = NeighbourTableSpec { wavelength_um, sines };
        let table = NeighbourTable::obtain(&spec, &self.stack, &self.mappings, self.cache.as_deref(), progress)?;
        Ok(Some(table.responses(self.full_transmission(wavelength_um)?)))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.equal.full_transmission(wavelength_um)
    }
}
