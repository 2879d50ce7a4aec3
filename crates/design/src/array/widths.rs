//! Phase to width, site by site.

use rayon::prelude::*;

use crate::phase::ElementPhase;
use crate::{CellSpec, MappingSpec};
use metalith_cell::{InversePolynomial, MappingTable};
use metalith_core::WidthMap;

/// Rounds the duty cycle that a mapping asks for to a width that may be written.
#[derive(Clone, Debug)]
pub struct WidthRule {
    polynomial: InversePolynomial,
    table: Option<MappingTable>,
    pitch_nm: f64,
    step_nm: f64,
    range_nm: (f64, f64),
}

impl WidthRule {
    /// The rule of a cell and a mapping.
    pub fn new(cell: &CellSpec, mapping: &MappingSpec) -> Self {
        Self {
            polynomial: mapping.polynomial.clone(),
            table: mapping.table.clone(),
            pitch_nm: f64::from(cell.pitch_nm),
            step_nm: f64::from(cell.width_step_nm),
            range_nm: (f64::from(cell.width_range_nm.0), f64::from(cell.width_range_nm.1)),
        }
    }

    /// Width before rounding (nm) for a phase of `u` turns, `0 <= u < 1`.
    pub fn unrounded_nm(&self, u: f64) -> f64 {
        match &self.table {
            Some(table) => f64::from(table.width_nm(u)),
            None => self.pitch_nm * self.polynomial.duty(u),
        }
    }

    /// Width to write (nm) for a phase of `u` turns, `0 <= u < 1`.
    pub fn width_nm(&self, u: f64) -> u16 {
        let width = (self.unrounded_nm(u) / self.step_nm).round() * self.step_nm;
        width.clamp(self.range_nm.0, self.range_nm.1) as u16
    }

    /// The pillars of an element.
    pub fn widths(&self, phase: &ElementPhase<'_>) -> WidthMap {
        let mut map = WidthMap::empty(phase.lattice());
        let n = map.lattice.sites();
        let rows = map.width_nm.as_slice_mut().expect("a new array is contiguous");
        rows.par_chunks_mut(n).enumerate().for_each(|(iy, row)| {
            for (ix, width) in row.iter_mut().enumerate() {
                if let Some(u) = phase.wrapped(ix, iy) {
                    *width = self.width_nm(u);
                }
            }
        });
        map
    }
}
