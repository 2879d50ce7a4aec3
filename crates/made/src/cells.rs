//! Transmission of pillars of any realised width, solved where they are needed.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Mutex, PoisonError};

use num_complex::Complex64;
use rayon::prelude::*;

use super::stack::{off_cutoff, possible_width_nm};
use metalith_cell::{CellStack, OBLIQUE_ORDERS, ORDERS};
use metalith_core::{Error, Progress, Result};
use metalith_rcwa::Orders;

/// Distance of the widths at which cells are solved [nm]. Widths between them are interpolated by a cubic through
/// four neighbours: over 100 to 300 nm and the visible that errs by less than 1e-3 rms and, at the narrowest
/// resonances, by 0.03; see the tests.
pub const NODE_STEP_NM: f64 = 0.5;

/// A width this near to a node is that node [steps].
const ON_NODE: f64 = 1e-6;

/// One for light along the normal, one each for s and p else.
type Polarised = [Complex64; 2];

/// Wavelength and direction, bit by bit, and node.
type Key = ([u64; 3], Option<i64>);

/// Cells of one stack by realised width. What was solved is kept for as long as this lives.
pub struct RealisedCells {
    stack: CellStack,
    /// Nodes are at this width and whole steps from it [nm]: drawn widths are whole nanometres, so that pillars
    /// under a bias common to all are solved exactly at their width.
    offset_nm: f64,
    known: Mutex<HashMap<Key, Polarised>>,
}

/// What sites of some widths transmit, one table for each polarisation that is to be averaged over.
pub struct SolvedWidths {
    /// In the order of the widths that were asked for.
    pub pillars: Vec<Vec<Complex64>>,
    /// Of a site without pillar, for each polarisation.
    pub bare: Vec<Complex64>,
}

/// What a width rests on: nodes with their weights.
fn support(width_nm: f64, offset_nm: f64) -> ([i64; 4], Option<[f64; 4]>) {
    let x = (width_nm - offset_nm) / NODE_STEP_NM;
    let nearest = x.round();
    if (x - nearest).abs() < ON_NODE {
        return ([nearest as i64; 4], None);
    }
    let i = x.floor();
    ([-1, 0, 1, 2].map(|k| i as i64 + k), Some(lagrange(x - i)))
}

/// Weights of the values at -1, 0, 1, 2 in the cubic through them, at `u` between 0 and 1.
pub fn lagrange(u: f64) -> [f64; 4] {
    [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ]
}

impl RealisedCells {
    /// Cells of a stack as etched; `bias_nm` is what drawn widths are off by at the least.
    pub fn new(stack: CellStack, bias_nm: f64) -> Self {
        Self {
            stack,
            offset_nm: bias_nm - bias_nm.floor(),
            known: Mutex::default(),
        }
    }

    /// The stack.
    pub fn stack(&self) -> &CellStack {
        &self.stack
    }

    /// Transmission of pillars of these widths [nm], zero-order, as `CellModel::transmissions` has it; and as
    /// `CellModel::oblique` has it where `sines` are not zero: those of the direction in air along x and y.
    /// Widths that no pillar can have are those of the nearest that can be.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn solve(
        &self,
        widths_nm: &[f64],
        wavelength_um: f64,
        sines: [f64; 2],
        progress: &dyn Progress,
    ) -> Result<SolvedWidths> {
        let place = [wavelength_um, sines[0], sines[1]].map(f64::to_bits);
        let supports: Vec<_> = widths_nm.iter().map(|w| support(*w, self.offset_nm)).collect();
        let nodes: BTreeSet<i64> = supports.iter().flat_map(|s| s.0).collect();
        let wanted = std::iter::once(None).chain(nodes.into_iter().map(Some));
        let missing: Vec<Option<i64>> = {
            let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            wanted.filter(|node| !known.contains_key(&(place, *node))).collect()
        };
        let solved = missing
            .into_par_iter()
            .map(|node| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                Ok(((place, node), self.solve_one(node, wavelength_um, sines)?))
            })
            .collect::<Result<Vec<_>>>()?;
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.extend(solved);
        let polarisations = if sines == [0.0; 2] { 0..1 } else { 0..2 };
        let at = |node: i64, p: usize| known[&(place, Some(node))][p];
        Ok(SolvedWidths {
            pillars: polarisations
                .clone()
                .map(|p| {
                    let value = |(nodes, weights): &([i64; 4], Option<[f64; 4]>)| match weights {
                        None => at(nodes[0], p),
                        Some(weights) => nodes.iter().zip(weights).map(|(n, w)| at(*n, p) * w).sum(),
                    };
                    supports.iter().map(value).collect()
                })
                .collect(),
            bare: polarisations.map(|p| known[&(place, None)][p]).collect(),
        })
    }

    /// One node, or a site without pillar.
    fn solve_one(&self, node: Option<i64>, wavelength_um: f64, sines: [f64; 2]) -> Result<Polarised> {
        let width = node.map_or(0.0, |k| {
            possible_width_nm(&self.stack, self.offset_nm + k as f64 * NODE_STEP_NM)
        });
        if sines == [0.0; 2] {
            let orders = Orders::new(ORDERS)?;
            let t = off_cutoff(width, |w| self.stack.transmission(w, wavelength_um, orders))?;
            return Ok([t; 2]);
        }
        let orders = Orders::new(OBLIQUE_ORDERS)?;
        off_cutoff(width, |w| self.stack.oblique(w, wavelength_um, sines, orders))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;

    /// Rms error of |t| = 1 or so between the nodes, over widths and colours.
    const RMS: f64 = 1e-3;

    /// And the worst of it, beside a guided-mode resonance that is narrower than a node's distance.
    const WORST: f64 = 0.03;

    #[test]
    fn widths_between_the_nodes_are_those_solved_exactly() {
        let stack = CellStack::paper(350.0, 700.0).unwrap();
        let orders = Orders::new(ORDERS).unwrap();
        let cells = RealisedCells::new(stack.clone(), -9.25);
        let (mut squares, mut worst, mut count) = (0.0, 0.0_f64, 0.0);
        for um in [0.455, 0.53, 0.66] {
            // Halfway between nodes, where a cubic errs most.
            let widths: Vec<f64> = (0..67).map(|k| 100.0 + 3.0 * f64::from(k)).collect();
            let solved = cells.solve(&widths, um, [0.0; 2], &Silent).unwrap();
            for (w, t) in widths.iter().zip(&solved.pillars[0]) {
                let error = (stack.transmission(*w, um, orders).unwrap() - t).norm();
                squares += error * error;
                worst = worst.max(error);
                count += 1.0;
            }
        }
        let rms = f64::sqrt(squares / count);
        println!("rms {rms}, worst {worst}");
        assert!(rms < RMS && worst < WORST, "rms {rms}, worst {worst}");
    }

    #[test]
    fn widths_on_the_nodes_are_solved_and_nothing_else_is() {
        let stack = CellStack::paper(350.0, 700.0).unwrap();
        let orders = Orders::new(ORDERS).unwrap();
        let cells = RealisedCells::new(stack.clone(), -9.3);
        let widths = [150.0 - 9.3, 152.0 - 9.3];
        let solved = cells.solve(&widths, 0.53, [0.0; 2], &Silent).unwrap();
        for (w, t) in widths.iter().zip(&solved.pillars[0]) {
            // Widths agree to rounding, and a transmission's slope is below one a nanometre.
            assert!((stack.transmission(*w, 0.53, orders).unwrap() - t).norm() < 1e-12);
        }
        // Two pillars and a bare site.
        assert_eq!(cells.known.lock().unwrap().len(), 3);
        assert_eq!(solved.bare[0], stack.transmission(0.0, 0.53, orders).unwrap());
    }
}
