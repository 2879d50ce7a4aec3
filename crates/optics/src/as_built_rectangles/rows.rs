//! Response of rectangles whose edges are off by so much to light, as numbers that may be interpolated between biases
//! and stacks.

use num_complex::Complex64;
use serde::Serialize;

use crate::etched_stack::{off_cutoff, possible_width_nm};
use metalith_cell::{CellStack, RotationSamples, UPRIGHT_ORDERS, birefringent_pillars, birefringent_stacks};
use metalith_core::{Progress, Result};
use metalith_pillars::{PillarId, PillarKind, PillarShape, Rectangles, RotatedRectangles};
use metalith_rcwa::Orders;

/// Number of diffraction orders an axis that rectangles are solved with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub(crate) enum RowOrders {
    /// These.
    Given(usize),
    /// Orders as many as the cell of pillars as drawn takes at single wavelengths.
    AsDrawn,
}

/// Numbers of a row: of rotated rectangles those of [`RotationSamples`], of upright ones transmissions along x and along y of each of so
/// many pillars.
pub(crate) fn row_length(pillars: Rectangles, count: usize) -> usize {
    match pillars {
        Rectangles::Rotated(_) => RotationSamples::NUMBERS,
        Rectangles::Upright(_) => 2 * count,
    }
}

/// The row of rectangles of a stack as etched whose edges are off by `bias_nm`: of upright ones those with these numbers, in their order.
pub(crate) fn solve_row(
    etched: &CellStack,
    pillars: Rectangles,
    numbers: &[u16],
    bias_nm: f64,
    wavelength_um: f64,
    orders: RowOrders,
    progress: &dyn Progress,
) -> Result<Vec<Complex64>> {
    match pillars {
        Rectangles::Rotated(pillars) => {
            let orders = match orders {
                RowOrders::Given(orders) => Some(Orders::new(orders)?),
                RowOrders::AsDrawn => None,
            };
            solve_rotated(etched, pillars, bias_nm, wavelength_um, orders)
        }
        Rectangles::Upright(pillars) => {
            let orders = Orders::new(match orders {
                RowOrders::Given(orders) => orders,
                RowOrders::AsDrawn => UPRIGHT_ORDERS,
            })?;
            let edges = |number: &u16| pillars.biased_edges_nm(PillarId(*number), bias_nm);
            let edges: Vec<[f64; 2]> = numbers.iter().map(edges).collect();
            let etched = std::slice::from_ref(etched);
            let one = |edges: [f64; 2]| Ok(solve_upright(etched, edges, wavelength_um, orders)?[0]);
            let solved = birefringent_pillars(&edges, one, progress)?;
            Ok(solved.into_iter().flatten().collect())
        }
    }
}

/// Response of rotated rectangles of a stack as etched whose edges are off by `bias_nm`, with as many orders as the
/// cell of pillars as drawn takes if none are given.
pub(crate) fn solve_rotated(
    etched: &CellStack,
    pillars: RotatedRectangles,
    bias_nm: f64,
    wavelength_um: f64,
    orders: Option<Orders>,
) -> Result<Vec<Complex64>> {
    let edges = [pillars.width_nm, pillars.length_nm].map(f64::from);
    let samples = off_cutoff(bias_nm, |bias| {
        let edges = edges.map(|edge| edge + bias);
        match orders {
            Some(orders) => RotationSamples::solve(etched, edges, wavelength_um, orders),
            None => RotationSamples::converged(etched, edges, wavelength_um),
        }
    })?;
    Ok(samples.numbers().collect())
}

/// Transmission of the upright rectangle with these edges along x and along y (nm) along both, in each of these stacks
/// as etched.
pub(crate) fn solve_upright(
    etched: &[CellStack],
    edges_nm: [f64; 2],
    wavelength_um: f64,
    orders: Orders,
) -> Result<Vec<[Complex64; 2]>> {
    off_cutoff(0.0, |less| {
        let edges = |stack: &CellStack| edges_nm.map(|edge| possible_width_nm(stack, edge) + less);
        let pillars: Vec<_> = etched.iter().map(|stack| (stack, edges(stack))).collect();
        birefringent_stacks(&pillars, wavelength_um, orders)
    })
}

/// The row of sites without pillar, as that of so many pillars.
pub(crate) fn bare_row(
    etched: &CellStack,
    pillars: Rectangles,
    count: usize,
    wavelength_um: f64,
) -> Result<Vec<Complex64>> {
    // Layers without a pillar: any shape will do, and one order is all there is.
    let bare = CellStack {
        shape: PillarShape::default(),
        ..etched.clone()
    };
    let t = bare.transmission(0.0, wavelength_um, Orders::new(1)?)?;
    Ok(match pillars {
        Rectangles::Rotated(_) => RotationSamples::of_bare(t).numbers().collect(),
        Rectangles::Upright(_) => vec![t; 2 * count],
    })
}
