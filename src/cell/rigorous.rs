//! The cell by rigorous theory, as the rest of the program sees it.

use std::path::Path;

use num_complex::Complex64;

use super::table::{CellTable, Origin, TableSpec};
use super::{CellModel, CellStack, Fidelity};
use crate::design::Design;
use crate::error::Result;
use crate::progress::Progress;

/// Complex transmission of the zero order from a table of rigorous coupled-wave analysis.
#[derive(Clone, Debug)]
pub struct RigorousCell {
    table: CellTable,
}

/// The band that every design's library spans [um].
const VISIBLE_UM: (f64, f64) = (0.4, 0.7);

impl RigorousCell {
    /// The cell of a design over the visible and all wavelengths that the design names: from the library
    /// in `cache` if it is there, else computed and kept.
    ///
    /// # Errors
    /// If a material is not known or not over that band, or the user interrupts.
    pub fn of_design(design: &Design, cache: Option<&Path>, progress: &dyn Progress) -> Result<(Self, Origin)> {
        let spec = Self::table_spec(design)?;
        let (table, origin) = CellTable::obtain(&spec, cache, progress)?;
        Ok((Self { table }, origin))
    }

    /// The library that a design needs.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn table_spec(design: &Design) -> Result<TableSpec> {
        let folder = design.path.parent().unwrap_or(Path::new(""));
        let stack = CellStack::of_spec(&design.cell, folder)?;
        Ok(TableSpec::new(stack, Self::band_um(design), design.cell.width_range_nm))
    }

    /// The visible and all wavelengths that a design names [um].
    pub(super) fn band_um(design: &Design) -> (f64, f64) {
        let named = design
            .verify
            .wavelengths_um
            .iter()
            .chain([&design.mapping.wavelength_um]);
        named.fold(VISIBLE_UM, |(short, long), &l| (short.min(l), long.max(l)))
    }

    /// The cell of a table.
    pub fn new(table: CellTable) -> Self {
        Self { table }
    }

    /// What it looks up.
    pub fn table(&self) -> &CellTable {
        &self.table
    }
}

impl CellModel for RigorousCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        let mut t = self.table.transmissions(wavelength_um, max_width_nm)?;
        t[0] = Complex64::ZERO;
        Ok(t)
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.table.spec().stack.full_transmission(wavelength_um)
    }
}
