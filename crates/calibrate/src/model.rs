//! The calibrated model as a file, and what it makes of a design.

use std::path::Path;

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

use super::cells::changed;
use super::departure::Departure;
use metalith_cell::{CellModel, CellStack, Fidelity, OBLIQUE_ORDERS, ORDERS, tabulate};
use metalith_core::{Error, Result, WholeFile, document};
use metalith_design::Design;
use metalith_rcwa::Orders;
use metalith_verify::Premise;

/// Version of the format.
const SCHEMA: u32 = 1;

/// What a session has taught, in a file that later designs are simulated and compensated with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedModel {
    schema: u32,
    /// The session that it comes from.
    pub set: String,
    /// In words: what was found.
    pub finding: String,
    /// How chips and bench depart from what is stated.
    pub departure: Departure,
}

impl CalibratedModel {
    /// A model of what was found.
    pub fn new(set: String, finding: String, departure: Departure) -> Self {
        Self {
            schema: SCHEMA,
            set,
            finding,
            departure,
        }
    }

    /// Read a model file.
    ///
    /// # Errors
    /// If it cannot be read or is not such a file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = document::load(path)?;
        let fault = |what: String| Error::Table {
            path: path.to_owned(),
            line: None,
            what,
            hint: "give the `model.toml` that `metalith calibrate` has written".into(),
        };
        let model: Self = toml::from_str(&text).map_err(|e| fault(e.to_string()))?;
        if model.schema != SCHEMA {
            return Err(fault(format!(
                "this is a model of schema {}, {SCHEMA} is known",
                model.schema
            )));
        }
        Ok(model)
    }

    /// Write it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = toml::to_string(self).expect("plain data serialises");
        WholeFile::write(path, text.as_bytes())
    }

    /// The cell of a design as this line makes it: the same drawn width is another pillar, of another stack.
    /// Bias that follows density counts with the fill given, since a cell knows no neighbours.
    ///
    /// # Errors
    /// If a material of the design is not known.
    pub fn cell(&self, design: &Design, fill: f64) -> Result<MadeCell> {
        let stack = design.cell_stack()?;
        Ok(self.cell_of(&stack, design.cell.widths_nm(), fill))
    }

    /// The same of a stated stack, for these drawn widths [nm].
    pub fn cell_of(&self, stated: &CellStack, widths_nm: impl IntoIterator<Item = u16>, fill: f64) -> MadeCell {
        let geometry = &self.departure.geometry;
        let mut widths_nm = widths_nm.into_iter().filter(|w| *w > 0).collect::<Vec<_>>();
        widths_nm.sort_unstable();
        widths_nm.dedup();
        MadeCell {
            stack: changed(stated, &self.departure.cell),
            bias_nm: geometry.cd_bias_nm + geometry.cd_bias_density_nm * fill,
            widths_nm,
            bare_share: geometry.missing_pillars,
            unstructured: geometry.unstructured(),
        }
    }

    /// What a layout made on this line is judged by: its cells, and chip and sensor as they stand. What departs
    /// in lamps and camera belongs to the bench and is left out.
    pub fn premise<'a>(&self, cell: &'a MadeCell) -> Premise<'a> {
        Premise {
            cell,
            gap_um: self.departure.path.gap_um,
            tilt_rad: self.departure.path.tilt_mrad.map(|t| t * 1e-3),
        }
    }
}

/// A rigorous cell by drawn width, as it is made.
#[derive(Clone, Debug)]
pub struct MadeCell {
    stack: CellStack,
    bias_nm: f64,
    widths_nm: Vec<u16>,
    bare_share: f64,
    /// Amplitude that passes without seeing pillars.
    unstructured: Complex64,
}

impl MadeCell {
    /// Transmission of a pillar drawn this wide [nm].
    ///
    /// # Errors
    /// As [`CellStack::transmission`].
    pub fn drawn(&self, width_nm: f64, wavelength_um: f64) -> Result<Complex64> {
        self.realised(width_nm + self.bias_nm, wavelength_um)
    }

    /// Transmission of a pillar that came out this wide at its top [nm].
    ///
    /// # Errors
    /// As [`CellStack::transmission`].
    pub fn realised(&self, width_nm: f64, wavelength_um: f64) -> Result<Complex64> {
        let orders = Orders::new(ORDERS)?;
        let of = |width| self.stack.transmission(width, wavelength_um, orders);
        self.mixed(of(self.possible(width_nm))?, || of(0.0))
    }

    /// The nearest width that a pillar can have, its foot within the pitch [nm].
    fn possible(&self, width_nm: f64) -> f64 {
        let foot = (2.0 * self.stack.taper.tan() * self.stack.height_nm).max(0.0);
        width_nm.clamp(1.0, self.stack.pitch_nm - 1.0 - foot)
    }

    /// A pillar's transmission with the share of pillars that are missing, and with light that sees none.
    fn mixed(&self, t: Complex64, bare: impl FnOnce() -> Result<Complex64>) -> Result<Complex64> {
        let mean = if self.bare_share == 0.0 {
            t
        } else {
            t + (bare()? - t) * self.bare_share
        };
        Ok(mean + self.unstructured)
    }
}

impl CellModel for MadeCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Calibrated
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        let solve = |w| Ok([self.drawn(f64::from(w), wavelength_um)?]);
        let [table] = tabulate(&self.widths_nm, max_width_nm, solve)?;
        Ok(table)
    }

    fn oblique(&self, wavelength_um: f64, sines: [f64; 2], max_width_nm: u16) -> Result<Option<[Vec<Complex64>; 2]>> {
        let orders = Orders::new(OBLIQUE_ORDERS)?;
        let of = |width| self.stack.oblique(width, wavelength_um, sines, orders);
        let solve = |w| {
            let pillar = of(self.possible(f64::from(w) + self.bias_nm))?;
            let bare = if self.bare_share == 0.0 { pillar } else { of(0.0)? };
            let mixed = |k: usize| self.mixed(pillar[k], || Ok(bare[k]));
            Ok([mixed(0)?, mixed(1)?])
        };
        tabulate(&self.widths_nm, max_width_nm, solve).map(Some)
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.stack.full_transmission(wavelength_um)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_file_reads_back() {
        let mut departure = Departure::default();
        departure.geometry.cd_bias_nm = -9.75;
        *departure.light.shift_mut(1) = 0.5;
        let model = CalibratedModel::new("chip".into(), "explained by cd_bias".into(), departure);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        model.write(&path).unwrap();
        assert_eq!(CalibratedModel::read(&path).unwrap(), model);
        std::fs::write(&path, "schema = 7").unwrap();
        assert!(CalibratedModel::read(&path).is_err());
    }
}
