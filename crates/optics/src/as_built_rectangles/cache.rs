//! Rows of rectangles that are kept between runs.

use std::path::Path;

use num_complex::Complex64;
use serde::Serialize;

use super::RowOrders;
use metalith_cell::CellStack;
use metalith_cell::cache_file::{CacheEntry, complex_of, solver_of};
use metalith_pillars::Rectangles;

const MAGIC: [u8; 8] = *b"MLMADE\0\x01";

/// The table of the row of rectangles of a stack as etched whose edges are off by `bias_nm`: of upright ones those with these numbers.
pub(super) fn table(
    folder: Option<&Path>,
    etched: &CellStack,
    pillars: Rectangles,
    numbers: &[u16],
    bias_nm: f64,
    (wavelength_um, orders): (f64, RowOrders),
) -> CacheEntry {
    #[derive(Serialize)]
    struct Inputs<'a> {
        solver: u32,
        etched: &'a CellStack,
        pillars: Rectangles,
        numbers: &'a [u16],
        bias_nm: f64,
        wavelength_um: f64,
        orders: RowOrders,
    }
    let inputs = Inputs {
        solver: solver_of(pillars.into()),
        etched,
        pillars,
        numbers,
        bias_nm,
        wavelength_um,
        orders,
    };
    let inputs = serde_json::to_vec(&inputs).expect("plain data serialises");
    CacheEntry::new(folder, "made", MAGIC, inputs, "rectangles as made")
}

/// A row of so many numbers; none if the bytes are of others.
pub(super) fn decode(content: &[u8], length: usize) -> Option<Vec<Complex64>> {
    complex_of(content).filter(|row| row.len() == length)
}
