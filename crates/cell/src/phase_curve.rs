//! Phase and zero-order power of the rigorous cell over its widths, and the widths to stay away from.

use std::f64::consts::TAU;

use num_complex::Complex64;
use serde::Serialize;

use super::{CellModel, Illumination};
use metalith_core::{Error, Progress, Result};

/// The cell at one wavelength, width by width.
#[derive(Clone, Debug)]
pub struct PhaseCurve {
    /// Wavelength (um).
    pub wavelength_um: f64,
    /// Widths (nm), rising.
    pub widths_nm: Vec<u16>,
    /// Transmission over that of a cell that passes all power.
    pub t: Vec<Complex64>,
    /// Phase (turns), continued from width to width.
    pub turns: Vec<f64>,
}

/// A width to stay away from at a wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BadCell {
    /// Width (nm).
    pub width_nm: u16,
    /// Wavelength (um).
    pub wavelength_um: f64,
    /// Power of the zero order over the incident.
    pub zero_order: f64,
    /// True if a wider pillar here has less phase.
    pub backwards: bool,
}

impl PhaseCurve {
    /// The curve of a cell over these widths (nm), which rise in small steps.
    ///
    /// # Errors
    /// As [`CellModel::transmissions`]; also if there are fewer than two widths.
    pub fn new(cell: &dyn CellModel, wavelength_um: f64, widths_nm: &[u16]) -> Result<Self> {
        Self::solved(cell, wavelength_um, widths_nm, None)
    }

    /// [`PhaseCurve::new`] of a cell that solves what it is asked, with its progress where it is not coupled.
    ///
    /// # Errors
    /// As [`PhaseCurve::new`]; also if the user stopped it.
    pub fn solved(
        cell: &dyn CellModel,
        wavelength_um: f64,
        widths_nm: &[u16],
        progress: Option<&dyn Progress>,
    ) -> Result<Self> {
        let (Some(&widest), true) = (widths_nm.last(), widths_nm.len() > 1) else {
            return Err(Error::refused(
                "cell/curve-too-short",
                "the phase curve has fewer than two widths",
                "widen the range of widths of the cell",
            ));
        };
        let all = match progress {
            Some(progress) => (cell.response(&Illumination::normal(wavelength_um), widest, progress)?).focused()?,
            None => cell.transmissions(wavelength_um, widest)?,
        };
        let full = cell.full_transmission(wavelength_um)?;
        let t = widths_nm.iter().map(|&w| all[usize::from(w)] / full).collect();
        Ok(Self::of_transmissions(wavelength_um, widths_nm.to_vec(), t))
    }

    /// The curve of widths (nm), which rise in small steps, by their transmissions over that of a cell that passes all power.
    pub fn of_transmissions(wavelength_um: f64, widths_nm: Vec<u16>, t: Vec<Complex64>) -> Self {
        let mut turns: Vec<f64> = Vec::with_capacity(t.len());
        for value in &t {
            let wrapped = value.arg() / TAU;
            turns.push(
                turns
                    .last()
                    .map_or(wrapped, |last| wrapped + f64::round(last - wrapped)),
            );
        }
        Self {
            wavelength_um,
            widths_nm,
            t,
            turns,
        }
    }

    /// Power of the zero order over the incident, by width.
    pub fn zero_order(&self) -> impl Iterator<Item = f64> + '_ {
        self.t.iter().map(Complex64::norm_sqr)
    }

    /// True if the phase falls from the width before to the width after.
    pub fn backwards(&self, index: usize) -> bool {
        let last = self.turns.len() - 1;
        self.turns[(index + 1).min(last)] < self.turns[index.saturating_sub(1)]
    }

    /// Widths whose zero order carries less than `threshold`, or whose phase runs backwards.
    pub fn bad(&self, threshold: f64) -> Vec<BadCell> {
        let entries = self.widths_nm.iter().zip(self.zero_order()).enumerate();
        entries
            .map(|(i, (&width_nm, zero_order))| BadCell {
                width_nm,
                wavelength_um: self.wavelength_um,
                zero_order,
                backwards: self.backwards(i),
            })
            .filter(|cell| cell.zero_order < threshold || cell.backwards)
            .collect()
    }

    /// Phase (turns) at any width within the curve (nm), straight between its widths.
    pub fn turns_at(&self, width_nm: f64) -> f64 {
        let last = self.widths_nm.len() - 1;
        let i = self
            .widths_nm
            .partition_point(|&w| f64::from(w) <= width_nm)
            .clamp(1, last);
        let (a, b) = (f64::from(self.widths_nm[i - 1]), f64::from(self.widths_nm[i]));
        let share = ((width_nm - a) / (b - a)).clamp(0.0, 1.0);
        self.turns[i - 1] + share * (self.turns[i] - self.turns[i - 1])
    }
}

/// Bad widths at each of some wavelengths; see [`PhaseCurve::bad`].
///
/// # Errors
/// As [`PhaseCurve::new`].
pub fn bad_cells(
    cell: &dyn CellModel,
    wavelengths_um: &[f64],
    widths_nm: &[u16],
    threshold: f64,
) -> Result<Vec<BadCell>> {
    let mut bad = Vec::new();
    for &wavelength_um in wavelengths_um {
        bad.extend(PhaseCurve::new(cell, wavelength_um, widths_nm)?.bad(threshold));
    }
    Ok(bad)
}
