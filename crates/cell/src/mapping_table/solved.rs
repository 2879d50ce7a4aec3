//! The mapping that a cell itself asks for, solved at one wavelength.

use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::{MappingTable, RampOrders};
use crate::{CellStack, MappingError, ORDERS, PhaseCurve, PointwiseCell, TabulatedCells};
use metalith_core::text::hex;
use metalith_core::{Progress, Result};

/// Power in the zeroth order of the lattice below which a width is avoided, where nobody says another.
pub const AVOIDED_BELOW: f64 = 0.3;

/// Mapping by the phase of the rigorous cell at the wavelength of the mapping, and what it does there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SolvedMapping {
    /// Wavelength (um).
    pub wavelength_um: f64,
    /// Diffraction orders along an axis.
    pub orders: usize,
    /// Number of widths that the cell allows, and of those that are avoided: they transmit little, or a wider pillar has less phase.
    pub widths: usize,
    pub avoided: usize,
    /// Waves between the least and the greatest phase of widths that are not avoided; one is all that a lens asks for.
    pub span_waves: f64,
    /// Largest distance from one of their phases to the next, around a wave (waves): what no width gives.
    pub gap_waves: f64,
    /// Phase error over all phases.
    pub phase: MappingError,
    /// Share of the light in the orders of a ramp that has this mapping.
    pub light: RampOrders,
    /// First half of the SHA-256 of [`MappingTable::to_csv`], in hexadecimal.
    pub digest: String,
    /// Table of unit cells that it was made from, in place of a solver.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<TabulatedCells>,
    #[serde(skip)]
    pub table: MappingTable,
}

impl SolvedMapping {
    /// Solve the widths (nm), which rise, of a cell at a wavelength (um), or read them from the cache in `folder`, and take for each
    /// phase the width with the nearest, as `metalith cells` does for its exact mapping without the widths to avoid.
    ///
    /// # Errors
    /// If the cell cannot be solved, all widths are avoided, or the user stopped it.
    pub fn solve(
        stack: &CellStack,
        wavelength_um: f64,
        widths_nm: &[u16],
        folder: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let cell = PointwiseCell::new(stack.clone(), widths_nm.iter().copied()).cached_in(folder);
        let curve = PhaseCurve::solved(&cell, wavelength_um, widths_nm, Some(progress))?;
        Self::of_curve(&curve, ORDERS)
    }

    /// Mapping of a curve out of a table of unit cells.
    ///
    /// # Errors
    /// If all widths are avoided.
    pub fn of_table(curve: &PhaseCurve, cells: TabulatedCells) -> Result<Self> {
        Ok(Self {
            cells: Some(cells),
            ..Self::of_curve(curve, 0)?
        })
    }

    /// Mapping of a curve that was solved before, with so many orders an axis.
    ///
    /// # Errors
    /// If all widths are avoided.
    pub fn of_curve(curve: &PhaseCurve, orders: usize) -> Result<Self> {
        let avoid: Vec<u16> = curve.bad(AVOIDED_BELOW).iter().map(|bad| bad.width_nm).collect();
        let table = MappingTable::nearest(curve, &avoid)?;
        let kept = curve.widths_nm.iter().zip(&curve.turns);
        let kept = kept
            .filter(|(width, _)| !avoid.contains(width))
            .map(|(_, turns)| *turns);
        let kept: Vec<f64> = kept.collect();
        let (least, greatest) = kept
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
        let mut around: Vec<f64> = kept.iter().map(|turns| turns.rem_euclid(1.0)).collect();
        around.sort_by(f64::total_cmp);
        let last = around.last().map_or(0.0, |last| around[0] + 1.0 - last);
        let gap_waves = around.windows(2).map(|pair| pair[1] - pair[0]).fold(last, f64::max);
        Ok(Self {
            wavelength_um: curve.wavelength_um,
            orders,
            widths: curve.widths_nm.len(),
            avoided: avoid.len(),
            span_waves: greatest - least,
            gap_waves,
            phase: table.phase_error(curve),
            light: table.orders_of(curve),
            digest: hex(&Sha256::digest(table.to_csv())[..16]),
            cells: None,
            table,
        })
    }

    /// One line of what was solved.
    pub fn words(&self) -> String {
        let nm = self.wavelength_um * 1e3;
        let source = match &self.cells {
            Some(cells) => format!("mapping at {nm:.1} nm from {} (", cells.words()),
            None => format!("mapping solved at {nm:.1} nm ({} orders an axis, ", self.orders),
        };
        format!(
            "{source}{} widths, {} avoided): {:.2} waves, {:.3} rad rms, first order {:.3}; digest {}",
            self.widths, self.avoided, self.span_waves, self.phase.rms_rad, self.light.first, self.digest
        )
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;

    /// Widths that transmit little or run backwards have no phase in the mapping, and its light is that of its error.
    #[test]
    fn dark_widths_are_avoided() {
        let widths_nm: Vec<u16> = (50..150).collect();
        let turns: Vec<f64> = (0..100).map(|i| f64::from(i) / 100.0).collect();
        let power = |i: usize| if (40..44).contains(&i) { 0.1 } else { 1.0 };
        let field = |(i, t): (usize, &f64)| Complex64::from_polar(f64::sqrt(power(i)), std::f64::consts::TAU * t);
        let curve = PhaseCurve {
            wavelength_um: 0.5,
            t: turns.iter().enumerate().map(field).collect(),
            widths_nm,
            turns,
        };
        let solved = SolvedMapping::of_curve(&curve, 3).unwrap();
        assert_eq!((solved.widths, solved.avoided), (100, 4));
        assert!(solved.table.widths_nm.iter().all(|w| !(90..94).contains(w)));
        assert!((solved.span_waves - 0.99).abs() < 1e-12 && (solved.gap_waves - 0.05).abs() < 1e-12);
        // The gap of four widths is half of 5 % of a wave at most.
        assert!(
            solved.phase.worst_rad < 0.026 * std::f64::consts::TAU,
            "{:?}",
            solved.phase
        );
        assert!(
            solved.light.first > 0.99 && solved.light.passed > 0.99,
            "{:?}",
            solved.light
        );
        assert_eq!(solved.digest.len(), 32);
    }
}
