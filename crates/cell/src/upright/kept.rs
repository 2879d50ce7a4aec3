//! Transmissions of upright rectangles that are kept between runs.

use std::path::Path;

use num_complex::Complex64;
use serde::Serialize;

use super::Along;
use crate::CellStack;
use crate::kept::{KeptTable, solver_of};
use metalith_core::{PillarShape, UprightRectangles};

const MAGIC: [u8; 8] = *b"MLUPRT\0\x01";

/// Bytes of a pillar: real and imaginary part along x and along y.
const EACH: usize = 32;

/// The table of all pillars at a wavelength (um) with so many orders an axis.
pub(super) fn table(
    folder: Option<&Path>,
    stack: &CellStack,
    pillars: UprightRectangles,
    wavelength_um: f64,
    orders: usize,
) -> KeptTable {
    #[derive(Serialize)]
    struct Inputs<'a> {
        solver: u32,
        stack: &'a CellStack,
        pillars: UprightRectangles,
        wavelength_um: f64,
        orders: usize,
    }
    let inputs = Inputs {
        solver: solver_of(PillarShape::Rectangle(pillars.into())),
        stack,
        pillars,
        wavelength_um,
        orders,
    };
    let inputs = serde_json::to_vec(&inputs).expect("plain data serialises");
    KeptTable::new(folder, "upright", MAGIC, inputs, "upright rectangles")
}

/// Along x and along y by pillar (f64, little-endian), from the first on.
pub(super) fn encode(along: &Along) -> Vec<u8> {
    let pairs = along[0].iter().zip(&along[1]).skip(1);
    let numbers = pairs.flat_map(|(x, y)| [x.re, x.im, y.re, y.im]);
    numbers.flat_map(f64::to_le_bytes).collect()
}

/// Those of so many pillars; none if the bytes are not of so many, or not finite.
pub(super) fn decode(content: &[u8], pillars: usize) -> Option<Along> {
    let (numbers, rest) = content.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
    if content.len() != pillars * EACH || !rest.is_empty() || numbers.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let of = |axis: usize| {
        let each = numbers.as_chunks::<4>().0.iter();
        let each = each.map(|n| Complex64::new(n[2 * axis], n[2 * axis + 1]));
        std::iter::once(Complex64::ZERO).chain(each).collect()
    };
    Some([0, 1].map(of))
}
