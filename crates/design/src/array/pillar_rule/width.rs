//! Phase to width, by a polynomial or a table.

use crate::{CellSpec, MappingSpec, SteeredMapping};
use metalith_cell::{ForwardPolynomial, InversePolynomial, MappingTable};

/// Rounds the width that a mapping asks for to one that may be written.
#[derive(Clone, Debug, PartialEq)]
pub struct WidthRule {
    mapping: WidthMapping,
    pitch_nm: f64,
    step_nm: f64,
    range_nm: (f64, f64),
    /// Published phase over width of the paper's cell, and the wavelength of the mapping (um).
    forward: Option<(ForwardPolynomial, f64)>,
}

/// Phase to the width before rounding.
#[derive(Clone, Debug, PartialEq)]
enum WidthMapping {
    /// Duty cycle over phase.
    Polynomial(InversePolynomial),
    /// Width over phase.
    Table(MappingTable),
}

/// The largest phase below a turn that tables of mappings distinguish from a turn.
const LAST_TURN: f64 = 0.9999;

impl WidthRule {
    pub(super) fn new(cell: &CellSpec, mapping: &MappingSpec) -> Self {
        Self {
            mapping: match &mapping.table {
                Some(table) => WidthMapping::Table(table.clone()),
                None => WidthMapping::Polynomial(mapping.polynomial.clone()),
            },
            pitch_nm: f64::from(cell.pitch_nm),
            step_nm: f64::from(cell.width_step_nm),
            range_nm: (f64::from(cell.width_range_nm.0), f64::from(cell.width_range_nm.1)),
            forward: cell
                .is_of_the_paper()
                .then(|| (ForwardPolynomial::published(), mapping.wavelength_um)),
        }
    }

    /// This rule with a mapping of steered elements.
    pub(super) fn steered(&self, own: &SteeredMapping) -> Self {
        Self {
            mapping: WidthMapping::Polynomial(own.polynomial.clone()),
            ..self.clone()
        }
    }

    /// Width before rounding (nm) for a phase of `u` turns, `0 <= u < 1`.
    pub fn unrounded_nm(&self, u: f64) -> f64 {
        match &self.mapping {
            WidthMapping::Table(table) => f64::from(table.width_nm(u)),
            WidthMapping::Polynomial(polynomial) => self.pitch_nm * polynomial.duty(u),
        }
    }

    /// Width to write (nm) for a phase of `u` turns, `0 <= u < 1`.
    pub fn width_nm(&self, u: f64) -> u16 {
        let width = (self.unrounded_nm(u) / self.step_nm).round() * self.step_nm;
        width.clamp(self.range_nm.0, self.range_nm.1) as u16
    }

    /// Phase (turns) that stands for a width (nm) where what counts is the difference of two: by the published polynomial for
    /// the cell of the paper, else by the mean slope of the mapping.
    pub fn turns(&self, nm: f64) -> f64 {
        if let Some(forward) = &self.forward {
            return forward.0.turns(nm / self.pitch_nm, forward.1);
        }
        let span_nm = self.unrounded_nm(LAST_TURN) - self.unrounded_nm(0.0);
        nm / span_nm.abs().max(self.step_nm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_cell::Basis;

    fn rule(mapping: WidthMapping) -> WidthRule {
        WidthRule {
            mapping,
            pitch_nm: 400.0,
            step_nm: 10.0,
            range_nm: (100.0, 300.0),
            forward: None,
        }
    }

    #[test]
    fn widths_are_whole_steps_within_the_range() {
        let rule = rule(WidthMapping::Polynomial(InversePolynomial {
            wavelength_um: 0.5,
            basis: Basis::AllPowers,
            coefficients: vec![0.2, 0.6],
        }));
        // A phase of u turns asks for 80 + 240 u nm.
        for (u, wanted) in [(0.0, 100), (0.25, 140), (0.27, 140), (0.28, 150), (0.99, 300)] {
            assert_eq!(rule.width_nm(u), wanted, "{u}");
        }
        // The mean slope: 240 nm a turn, from the first phase to the last below a turn.
        assert!((rule.turns(240.0) - 1.0 / LAST_TURN).abs() < 1e-12);
    }

    #[test]
    fn widths_of_a_table_are_its_own() {
        let rule = rule(WidthMapping::Table(MappingTable {
            widths_nm: vec![120, 180, 240, 290],
        }));
        for (u, wanted) in [(0.0, 120), (0.3, 180), (0.74, 240), (0.76, 290)] {
            assert_eq!(rule.width_nm(u), wanted, "{u}");
        }
    }
}
