//! Local periodic approximation of squares and circles in one lens.

use std::path::Path;

use metalith_core::{Progress, Result};
use metalith_pillars::{PillarId, PillarShape, SquaresAndCircles};
use num_complex::Complex64;

use super::PointwiseCell;
use crate::{CellModel, CellResponse, CellStack, Fidelity, Illumination, JonesTables, ObliqueTables};

/// Squares and circles, each solved in a lattice of pillars equal to it.
#[derive(Clone, Debug)]
pub struct MixedCell {
    squares: PointwiseCell,
    circles: PointwiseCell,
    /// Widths of the widest of each (nm).
    widest_nm: [u16; 2],
}

impl MixedCell {
    /// The cell for pillars with these numbers.
    pub fn new(stack: &CellStack, numbers: impl IntoIterator<Item = u16>) -> Self {
        let mut widths = [Vec::new(), Vec::new()];
        for number in numbers {
            let (is_circle, PillarId(width)) = SquaresAndCircles::width(PillarId(number));
            widths[usize::from(is_circle)].push(width);
        }
        let widest_nm = [0, 1].map(|k: usize| widths[k].iter().copied().max().unwrap_or(0));
        let of = |shape: PillarShape, widths: Vec<u16>| {
            let stack = CellStack { shape, ..stack.clone() };
            PointwiseCell::new(stack, widths)
        };
        let [squares, circles] = widths;
        Self {
            squares: of(PillarShape::Square, squares),
            circles: of(PillarShape::Circle, circles),
            widest_nm,
        }
    }

    /// This cell, whose answers along the normal are cached in a folder from one run to the next.
    #[must_use]
    pub fn cached_in(self, folder: Option<&Path>) -> Self {
        Self {
            squares: self.squares.cached_in(folder),
            circles: self.circles.cached_in(folder),
            ..self
        }
    }
}

/// A table of squares, and of circles behind it.
fn joined(mut squares: Vec<Complex64>, circles: &[Complex64]) -> Vec<Complex64> {
    squares.resize(usize::from(SquaresAndCircles::CIRCLE), Complex64::ZERO);
    squares.extend(circles);
    squares
}

impl CellModel for MixedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, light: &Illumination<'_>, _largest: u16, progress: &dyn Progress) -> Result<CellResponse> {
        let [square_nm, circle_nm] = self.widest_nm;
        let squares = self.squares.response(light, square_nm, progress)?;
        let circles = self.circles.response(light, circle_nm, progress)?;
        match (squares, circles) {
            (CellResponse::Jones(JonesTables::Oblique(a)), CellResponse::Jones(JonesTables::Oblique(b))) => {
                let each = |a: [Vec<Complex64>; 2], b: &[Vec<Complex64>; 2]| {
                    let [first, second] = a;
                    [joined(first, &b[0]), joined(second, &b[1])]
                };
                Ok(CellResponse::Jones(JonesTables::Oblique(ObliqueTables {
                    kept: each(a.kept, &b.kept),
                    turned: each(a.turned, &b.turned),
                })))
            }
            (a, b) => Ok(CellResponse::Scalar(joined(a.focused()?, &b.focused()?))),
        }
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.squares.full_transmission(wavelength_um)
    }
}
