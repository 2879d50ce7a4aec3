//! `[mapping]`: from phase to width.

use std::path::PathBuf;

use serde::Serialize;

use super::CellSpec;
use super::lens::WAVELENGTH;
use metalith_cell::{Basis, InversePolynomial, MappingTable};
use metalith_core::Result;
use metalith_core::document::{Limits, Section};

/// How phase becomes width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MappingSpec {
    /// Wavelength lambda_0 that the mapping is made for (um).
    pub wavelength_um: f64,
    /// Duty cycle over phase.
    pub polynomial: InversePolynomial,
    /// File of a table that stands in its place, such as `metalith cells` writes.
    #[serde(skip)]
    pub table_file: Option<PathBuf>,
    /// What that file holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<MappingTable>,
}

impl MappingSpec {
    pub(crate) fn read(s: &Section<'_, '_>, cell: &CellSpec) -> Self {
        let published = InversePolynomial::published();
        let wavelength_um = s
            .optional_float("wavelength_nm", WAVELENGTH)
            .map_or(published.wavelength_um, |nm| nm * 1e-3);
        let basis = s.choice(
            "basis",
            &[("all_powers", Basis::AllPowers), ("even_powers", Basis::EvenPowers)],
            Some(published.basis),
        );
        let coefficients = if s.has("coefficients") {
            s.floats("coefficients", Limits::new(-100.0..=100.0, "(duty cycle over turns)"))
        } else {
            published.coefficients
        };
        if coefficients.is_empty() {
            s.fault(
                "coefficients",
                "a mapping of no coefficients gives no width",
                "list those of u^0, u^1, ..., or leave `coefficients` out for the published ones",
            );
        }
        let polynomial = InversePolynomial {
            wavelength_um,
            basis,
            coefficients,
        };
        let (low, high) = polynomial.range();
        let pitch = f64::from(cell.pitch_nm);
        let (narrow, wide) = cell.width_range_nm;
        let half_step = f64::from(cell.width_step_nm) / 2.0;
        let fits = low * pitch >= f64::from(narrow) - half_step && high * pitch <= f64::from(wide) + half_step;
        if !fits && !polynomial.coefficients.is_empty() {
            s.fault_given(
                &["cell.pitch_nm", "cell.width_min_nm", "cell.width_max_nm", "cell.width_step_nm", "mapping.basis"],
                "coefficients",
                format!("this mapping asks for widths from {:.1} to {:.1} nm", low * pitch, high * pitch),
                format!("the cell allows {narrow} to {wide} nm: change the coefficients or [cell] width_min_nm, width_max_nm"),
            );
        }
        let table_file = s.has("table").then(|| s.file("table"));
        if table_file.is_some() && s.has("coefficients") {
            s.fault(
                "table",
                "a mapping that is a table has no coefficients",
                "keep one of `table` and `coefficients`",
            );
        }
        s.finish();
        Self {
            wavelength_um,
            polynomial,
            table_file,
            table: None,
        }
    }

    /// Read the table, if there is one.
    pub(crate) fn load(&mut self, cell: &CellSpec) -> Result<()> {
        if let Some(file) = &self.table_file {
            let allowed: Vec<u16> = cell.widths_nm().collect();
            self.table = Some(MappingTable::read_csv(file, &allowed)?);
        }
        Ok(())
    }
}
