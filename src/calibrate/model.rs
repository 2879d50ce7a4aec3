//! The calibrated model as a file, and what it makes of a design.

use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cells::changed;
use super::departure::Departure;
use crate::cell::rcwa::Orders;
use crate::cell::{CellModel, CellStack, Fidelity};
use crate::design::Design;
use crate::document;
use crate::error::{Error, Result};
use crate::file::WholeFile;

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
        let folder = design.path.parent().unwrap_or(Path::new(""));
        let stack = changed(&CellStack::of_spec(&design.cell, folder)?, &self.departure.cell);
        let geometry = &self.departure.geometry;
        Ok(MadeCell {
            stack,
            bias_nm: geometry.cd_bias_nm + geometry.cd_bias_density_nm * fill,
            widths_nm: design.cell.widths_nm().collect(),
            bare_share: geometry.missing_pillars,
        })
    }
}

/// A rigorous cell by drawn width, as it is made.
#[derive(Clone, Debug)]
pub struct MadeCell {
    stack: CellStack,
    bias_nm: f64,
    widths_nm: Vec<u16>,
    bare_share: f64,
}

/// Orders along an axis: errs by about 0.005 rad.
const ORDERS: usize = 13;

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
        let foot = (2.0 * self.stack.taper.tan() * self.stack.height_nm).max(0.0);
        let room = self.stack.pitch_nm - 1.0 - foot;
        let t = self
            .stack
            .transmission(width_nm.clamp(1.0, room), wavelength_um, orders)?;
        if self.bare_share == 0.0 {
            return Ok(t);
        }
        let bare = self.stack.transmission(0.0, wavelength_um, orders)?;
        Ok(t + (bare - t) * self.bare_share)
    }
}

impl CellModel for MadeCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        let mut table = vec![Complex64::ZERO; usize::from(max_width_nm) + 1];
        let solved: Vec<(u16, Complex64)> = self
            .widths_nm
            .par_iter()
            .filter(|w| **w <= max_width_nm)
            .map(|&w| Ok((w, self.drawn(f64::from(w), wavelength_um)?)))
            .collect::<Result<_>>()?;
        // Widths that are not drawn take the nearest that is.
        for (w, to) in table.iter_mut().enumerate().skip(1) {
            let nearest = solved.iter().min_by_key(|(known, _)| usize::from(*known).abs_diff(w));
            *to = nearest.map_or(Complex64::ZERO, |(_, t)| *t);
        }
        Ok(table)
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
