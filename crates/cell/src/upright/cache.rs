//! Transmissions of upright rectangles that are kept between runs.

use std::path::Path;

use num_complex::Complex64;
use serde::Serialize;

use super::Along;
use crate::CellStack;
use crate::cache_file::{CacheEntry, bytes_of, complex_of, solver_of};
use metalith_pillars::UprightRectangles;

const MAGIC: [u8; 8] = *b"MLUPRT\0\x01";

/// The table of all pillars at a wavelength (um) with so many orders an axis.
pub(super) fn table(
    folder: Option<&Path>,
    stack: &CellStack,
    pillars: UprightRectangles,
    wavelength_um: f64,
    orders: usize,
) -> CacheEntry {
    #[derive(Serialize)]
    struct Inputs<'a> {
        solver: u32,
        stack: &'a CellStack,
        pillars: UprightRectangles,
        wavelength_um: f64,
        orders: usize,
    }
    let inputs = Inputs {
        solver: solver_of(pillars.into()),
        stack,
        pillars,
        wavelength_um,
        orders,
    };
    let inputs = serde_json::to_vec(&inputs).expect("plain data serialises");
    CacheEntry::new(folder, "upright", MAGIC, inputs, "upright rectangles")
}

/// Along x and along y by pillar, from the first on.
pub(super) fn encode(along: &Along) -> Vec<u8> {
    let pairs = along[0].iter().zip(&along[1]).skip(1);
    bytes_of(pairs.flat_map(|(x, y)| [*x, *y]))
}

/// Tables of so many pillars; `None` if the bytes are not of so many, or not finite.
pub(super) fn decode(content: &[u8], pillars: usize) -> Option<Along> {
    let numbers = complex_of(content).filter(|numbers| numbers.len() == 2 * pillars)?;
    let of = |axis: usize| {
        let each = numbers.as_chunks::<2>().0.iter();
        std::iter::once(Complex64::ZERO)
            .chain(each.map(|pair| pair[axis]))
            .collect()
    };
    Some([0, 1].map(of))
}
