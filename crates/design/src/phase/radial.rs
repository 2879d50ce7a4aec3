//! Phase over the radius of the lens.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::table;
use metalith_core::document::{Limits, Section};
use metalith_core::{Error, Result};

/// Interpolation of a table between its radii.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Straight lines between the phases as they stand: for smooth, unwrapped tables.
    Linear,
    /// The entry with the nearest radius: for phases given ring by ring.
    Nearest,
}

/// Phase of a lens over its radius, from one of three sources.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RadialPhase {
    /// `-k (sqrt(r^2 + f^2) - f)`: perfect at one wavelength, on axis.
    Hyperbola { wavelength_um: f64, focal_length_um: f64 },
    /// `sum a_i (r / R)^(2 i)`, `i` from one, in radians: what optical design programs call Binary 2.
    EvenPowers {
        coefficients_rad: Vec<f64>,
        /// The radius R that r is divided by (um).
        normalisation_um: f64,
    },
    /// Flat phase: what is added over the plane is all.
    Flat,
    /// Phase (rad) over radius (um), ascending.
    Table {
        #[serde(skip)]
        file: PathBuf,
        interpolation: Interpolation,
        radius_um: Vec<f64>,
        phase_rad: Vec<f64>,
        /// Reading of the file, which the phases are the result of.
        #[serde(skip)]
        reading: TableReading,
    },
}

/// Settings of reading the file of a table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TableReading {
    /// True if its phases are known up to whole waves, false if they are not; found if nothing says so.
    wrapped: Option<bool>,
    /// Distance of its places from the middle on (um), if the file has phases alone.
    pitch_um: Option<f64>,
    /// True if whole waves were added.
    is_unwrapped: bool,
}

impl TableReading {
    pub(crate) fn read(s: &Section<'_, '_>) -> Self {
        Self {
            wrapped: s
                .has("wrapped")
                .then(|| s.choice("wrapped", &[("no", false), ("yes", true)], None)),
            pitch_um: s.optional_float("pitch_um", Limits::new(1e-3..=1e5, "um")),
            is_unwrapped: false,
        }
    }
}

impl Interpolation {
    pub(crate) fn read(s: &Section<'_, '_>) -> Self {
        s.choice(
            "interpolation",
            &[("linear", Self::Linear), ("nearest", Self::Nearest)],
            Some(Self::Linear),
        )
    }
}

impl RadialPhase {
    /// A table that is still to be loaded.
    pub fn table(file: PathBuf, interpolation: Interpolation) -> Self {
        Self::Table {
            file,
            interpolation,
            radius_um: Vec::new(),
            phase_rad: Vec::new(),
            reading: TableReading::default(),
        }
    }

    /// The same, with a file that is read in another way if it is a table.
    #[must_use]
    pub(crate) fn read_as(mut self, other: TableReading) -> Self {
        if let Self::Table { reading, .. } = &mut self {
            *reading = other;
        }
        self
    }

    /// The file of the table, if whole waves were added to its phases because they jump.
    pub(crate) fn unwrapped(&self) -> Option<&Path> {
        match self {
            Self::Table { file, reading, .. } if reading.is_unwrapped => Some(file),
            _ => None,
        }
    }

    /// Read a table for a lens of this radius.
    ///
    /// # Errors
    /// If the file is not a table of `r_um, phase_rad` that covers the lens.
    pub fn read_table(file: &Path, interpolation: Interpolation, lens_radius_um: f64) -> Result<Self> {
        let mut table = Self::table(file.to_owned(), interpolation);
        table.load(lens_radius_um)?;
        Ok(table)
    }

    /// Load the table, if this is one, for a lens of this radius.
    ///
    /// # Errors
    /// If the file is not a table of `r_um, phase_rad` that covers the lens.
    pub fn load(&mut self, lens_radius_um: f64) -> Result<()> {
        let Self::Table {
            file,
            interpolation,
            radius_um,
            phase_rad,
            reading,
        } = self
        else {
            return Ok(());
        };
        let rows = table::read(file, reading.pitch_um)?;
        (*radius_um, *phase_rad) = (rows.radius_um, rows.phase_rad);
        reading.is_unwrapped = false;
        if *interpolation == Interpolation::Nearest || reading.wrapped == Some(true) {
            table::unwrap(phase_rad);
        } else if reading.wrapped.is_none() {
            reading.is_unwrapped = table::unwrap_if_wrapped(phase_rad).map_err(|row| Error::Table {
                path: file.clone(),
                line: rows.lines.get(row).copied(),
                what: format!(
                    "the phase jumps from {} to {} rad between radii of {} and {} um, and both a wave and a step may be meant",
                    phase_rad[row - 1],
                    phase_rad[row],
                    radius_um[row - 1],
                    radius_um[row]
                ),
                hint: "say `wrapped = \"yes\"` for phases that are known up to whole waves, or `wrapped = \"no\"`; more rows make a \
                       wrapped table clear"
                    .into(),
            })?;
        }
        let (first, last) = (radius_um[0], radius_um[radius_um.len() - 1]);
        // A ring-by-ring table ends in the middle of the last ring.
        let slack = 1.5 * (last - first) / radius_um.len() as f64;
        if first > slack || last < lens_radius_um - slack {
            let what =
                format!("the table covers radii from {first} to {last} um, the lens needs 0 to {lens_radius_um} um");
            return Err(Error::table(
                file,
                None,
                what,
                "extend the table, or make the lens smaller",
            ));
        }
        Ok(())
    }

    /// Phase at a radius (turns), not reduced. `radius2_um2` is the square of the radius (um^2).
    pub fn turns(&self, radius2_um2: f64) -> f64 {
        match self {
            Self::Hyperbola {
                wavelength_um,
                focal_length_um: f,
            } => {
                // The path difference without the cancellation of sqrt(r^2 + f^2) - f.
                -radius2_um2 / ((radius2_um2 + f * f).sqrt() + f) / wavelength_um
            }
            Self::EvenPowers {
                coefficients_rad,
                normalisation_um,
            } => {
                let x = radius2_um2 / (normalisation_um * normalisation_um);
                coefficients_rad.iter().rev().fold(0.0, |sum, a| (sum + a) * x) / std::f64::consts::TAU
            }
            Self::Flat => 0.0,
            Self::Table {
                interpolation,
                radius_um,
                phase_rad,
                ..
            } => table::at(radius_um, phase_rad, *interpolation, radius2_um2.sqrt()) / std::f64::consts::TAU,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a phase of a hundred turns in double precision.
    const ROUNDING_TURNS: f64 = 1e-11;

    #[test]
    fn a_hyperbola_makes_all_paths_to_the_focus_equal() {
        let phase = RadialPhase::Hyperbola {
            wavelength_um: 0.55,
            focal_length_um: 2400.0,
        };
        for r in [0.0_f64, 0.175, 20.0, 499.9] {
            let path = (r * r + 2400.0_f64.powi(2)).sqrt() - 2400.0;
            assert!((phase.turns(r * r) + path / 0.55).abs() < ROUNDING_TURNS);
        }
    }

    #[test]
    fn even_powers_count_from_the_square() {
        let phase = RadialPhase::EvenPowers {
            coefficients_rad: vec![-10.0, 3.0],
            normalisation_um: 50.0,
        };
        let turns = phase.turns(25.0 * 25.0);
        assert!((turns * std::f64::consts::TAU - (-10.0 * 0.25 + 3.0 * 0.0625)).abs() < ROUNDING_TURNS);
    }

    #[test]
    fn a_table_gives_its_entries_and_what_is_between() {
        let mut phase = RadialPhase::table(PathBuf::new(), Interpolation::Linear);
        if let RadialPhase::Table {
            radius_um, phase_rad, ..
        } = &mut phase
        {
            *radius_um = vec![0.0, 1.0, 3.0];
            *phase_rad = vec![1.0, 2.0, 6.0];
        }
        let rad = |phase: &RadialPhase, r: f64| phase.turns(r * r) * std::f64::consts::TAU;
        for (r, expected) in [(0.0, 1.0), (0.5, 1.5), (2.0, 4.0), (3.0, 6.0), (4.0, 6.0)] {
            assert!((rad(&phase, r) - expected).abs() < ROUNDING_TURNS);
        }
        if let RadialPhase::Table { interpolation, .. } = &mut phase {
            *interpolation = Interpolation::Nearest;
        }
        for (r, expected) in [(0.4, 1.0), (0.6, 2.0), (1.9, 2.0), (2.1, 6.0)] {
            assert!((rad(&phase, r) - expected).abs() < ROUNDING_TURNS);
        }
    }
}
