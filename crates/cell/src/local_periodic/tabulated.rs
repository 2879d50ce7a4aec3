//! Local periodic approximation from a table.

use std::path::Path;

use num_complex::Complex64;

use super::table::{CellTable, Origin, TableSpec};
use crate::{CellModel, CellResponse, Fidelity, Illumination};
use metalith_core::{Progress, Result};

/// Complex transmission of the zero order from a table of rigorous coupled-wave analysis.
#[derive(Clone, Debug)]
pub struct RigorousCell {
    table: CellTable,
}

impl RigorousCell {
    /// The cell of a table: from the folder `cache` if it is there, else computed and kept.
    ///
    /// # Errors
    /// If a material is not known over the band, or the user interrupts.
    pub fn obtain(spec: &TableSpec, cache: Option<&Path>, progress: &dyn Progress) -> Result<(Self, Origin)> {
        let (table, origin) = CellTable::obtain(spec, cache, progress)?;
        Ok((Self { table }, origin))
    }

    /// The cell of a table.
    pub fn new(table: CellTable) -> Self {
        Self { table }
    }

    /// Table that it looks values up in.
    pub fn table(&self) -> &CellTable {
        &self.table
    }
}

impl CellModel for RigorousCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, light: &Illumination<'_>, widest_nm: u16, _progress: &dyn Progress) -> Result<CellResponse> {
        let mut t = self.table.transmissions(light.wavelength_um, widest_nm)?;
        t[0] = Complex64::ZERO;
        Ok(CellResponse::Scalar(t))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.table.spec().stack.full_transmission(wavelength_um)
    }
}
