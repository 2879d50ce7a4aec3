//! Rectangles of one chip as fabricated, solved where they are needed.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use num_complex::Complex64;

use super::cache;
use super::rows::{RowOrders, bare_row, row_length, solve_row};
use super::{Colour, RowsOfBiases};
use crate::cell_bank::Axis;
use crate::rational_interpolation::{around, rational};
use crate::{CellChange, perturbed};
use metalith_cell::cache_file::bytes_of;
use metalith_cell::{BAND_ORDERS, CellStack};
use metalith_core::{Progress, Result};
use metalith_pillars::{PillarShape, Rectangles};

/// Biases of one element that are solved themselves at the most; of more, those a step apart are.
const MOST_BIASES: usize = 4;

/// Distance of the biases between which rational functions are taken (nm): they follow resonances that are a nanometre wide to some thousandths.
const STEP_NM: f64 = 2.0;

/// Pillars of one bias in one light: height of the change, wavelength and bias, bit by bit, and the orders.
type Place = (u64, u64, u64, RowOrders);

/// Solutions of rectangles, kept in memory for as long as this lives.
pub(crate) struct SolvedRectangles {
    stated: CellStack,
    pillars: Rectangles,
    /// Folder in which solutions are cached from one run to the next.
    pub folder: Option<PathBuf>,
    /// Solutions by the number of the pillar; zero for rotated ones, which share one solution.
    known: Mutex<BTreeMap<u16, HashMap<Place, Vec<Complex64>>>>,
}

impl SolvedRectangles {
    pub(crate) fn new(stated: CellStack, pillars: Rectangles) -> Self {
        Self {
            stated,
            pillars,
            folder: None,
            known: Mutex::default(),
        }
    }

    /// A row for each bias (nm), and one for a site without pillar; of upright rectangles for these numbers.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub(crate) fn rows(
        &self,
        change: &CellChange,
        (um, spectral): Colour,
        biases_nm: &[f64],
        numbers: &[u16],
        progress: &dyn Progress,
    ) -> Result<RowsOfBiases> {
        let orders = spectral.choose(RowOrders::AsDrawn, RowOrders::Given(BAND_ORDERS));
        let etched = perturbed(&self.stated, change);
        let row = |bias: &f64| self.row(&etched, (um, orders), *bias, numbers, progress);
        let bare = bare_row(&etched, self.pillars, numbers.len(), um)?;
        if biases_nm.len() <= MOST_BIASES {
            return Ok((biases_nm.iter().map(row).collect::<Result<_>>()?, bare));
        }
        let least = biases_nm.iter().copied().fold(f64::INFINITY, f64::min);
        let most = biases_nm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let axis = Axis::over(least, most, STEP_NM);
        let nodes = axis.all();
        let rows = nodes.iter().map(row).collect::<Result<Vec<_>>>()?;
        let between = |bias: &f64| -> Vec<Complex64> {
            let near = around(&nodes, *bias);
            let at = |number: usize| {
                let values: Vec<Complex64> = rows[near.clone()].iter().map(|row| row[number]).collect();
                rational(&nodes[near.clone()], &values, *bias)
            };
            (0..bare.len()).map(at).collect()
        };
        Ok((biases_nm.iter().map(between).collect(), bare))
    }

    /// The row of one bias: what is not known of it is solved.
    fn row(
        &self,
        etched: &CellStack,
        (um, orders): (f64, RowOrders),
        bias_nm: f64,
        numbers: &[u16],
        progress: &dyn Progress,
    ) -> Result<Vec<Complex64>> {
        let place = (etched.height_nm.to_bits(), um.to_bits(), bias_nm.to_bits(), orders);
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let of_all = [0];
        // Pillars of one size are solved together, whatever their rotation.
        let numbers = if PillarShape::from(self.pillars).has_one_size() {
            &of_all
        } else {
            numbers
        };
        let missing: Vec<u16> = {
            let known = known();
            let is_known = |number: &u16| known.get(number).is_some_and(|own| own.contains_key(&place));
            numbers.iter().copied().filter(|number| !is_known(number)).collect()
        };
        if !missing.is_empty() {
            let solved = self.kept_or_solved(etched, (um, orders), bias_nm, &missing, progress)?;
            let each = solved.len() / missing.len();
            let mut known = known();
            for (number, own) in missing.into_iter().zip(solved.chunks_exact(each)) {
                known.entry(number).or_default().insert(place, own.to_vec());
            }
        }
        let known = known();
        Ok(numbers
            .iter()
            .flat_map(|number| known[number][&place].clone())
            .collect())
    }

    /// The row of one bias of the pillars with these numbers, from the folder if it is there.
    fn kept_or_solved(
        &self,
        etched: &CellStack,
        (um, orders): (f64, RowOrders),
        bias_nm: f64,
        numbers: &[u16],
        progress: &dyn Progress,
    ) -> Result<Vec<Complex64>> {
        let length = row_length(self.pillars, numbers.len());
        let folder = self.folder.as_deref();
        let table = cache::table(folder, etched, self.pillars, numbers, bias_nm, (um, orders));
        if let Some(row) = table.read(|content| cache::decode(content, length), progress) {
            return Ok(row);
        }
        let row = solve_row(etched, self.pillars, numbers, bias_nm, um, orders, progress)?;
        table.write(&bytes_of(row.iter().copied()), progress);
        Ok(row)
    }
}
