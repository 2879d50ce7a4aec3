//! Transmissions over width, wavelength and the quantities of a pillar that vary, solved once for many chips.
//!
//! A study judges thousands of chips whose pillars differ a little. To solve the cells of each anew costs more than its
//! light does; a bank solves them on a grid, and chips take from it by cubic interpolation along every axis.

use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;

use super::cells::lagrange;
use super::stack::{off_cutoff, perturbed, possible_width_nm};
use super::{CellChange, SolvedWidths};
use metalith_cell::{CellStack, kept};
use metalith_core::{Error, Progress, Result};
use metalith_rcwa::Orders;

/// Version of the kept file.
const MAGIC: [u8; 8] = *b"MLBANK\0\x01";

/// Longest file that is read.
const LONGEST: u64 = 1 << 32;

/// Distance of the widths of a bank (nm).
const WIDTH_STEP_NM: f64 = 1.0;

/// Widths that are solved beyond both ends, so that a cubic has its four points.
const BEYOND: usize = 2;

/// Largest distance of the nodes of height (nm), index, taper (deg), corners and mask (nm), in the order of
/// [`quantities`]: a twentieth of a turn or so.
const STACK_STEPS: [f64; QUANTITIES] = [5.0, 0.02, 0.75, 10.0, 5.0];

/// Nodes of an axis at the least: a cubic takes four.
const FEWEST: usize = 4;

/// Stacks that are solved at the most. At some 15 CPU s each that is an hour and a half.
const MOST_STACKS: usize = 400;

const QUANTITIES: usize = 5;

/// The quantities of a pillar that may vary: height (nm), index, taper (deg), corner rounding (nm), mask (nm).
fn quantities(change: &CellChange) -> [f64; QUANTITIES] {
    [
        change.height_nm,
        change.index,
        change.taper_deg,
        change.corner_rounding_nm,
        change.residual_mask_nm,
    ]
}

fn change_of([height_nm, index, taper_deg, corner_rounding_nm, residual_mask_nm]: [f64; QUANTITIES]) -> CellChange {
    CellChange {
        height_nm,
        index,
        taper_deg,
        corner_rounding_nm,
        residual_mask_nm,
    }
}

/// What a bank covers.
#[derive(Clone, Debug, PartialEq)]
pub struct BankRange {
    /// Narrowest and widest pillar as made (nm).
    pub widths_nm: [f64; 2],
    /// Changes of the pillar: the least and the most of each number.
    pub changes: [CellChange; 2],
    /// Wavelength (um) and orders along an axis.
    pub colours: Vec<(f64, usize)>,
}

/// Nodes of one quantity of the pillar: one if it does not vary.
#[derive(Clone, Debug, PartialEq)]
struct Axis {
    first: f64,
    step: f64,
    nodes: usize,
}

impl Axis {
    fn over(low: f64, high: f64, most_step: f64) -> Self {
        if high <= low {
            return Self {
                first: low,
                step: 1.0,
                nodes: 1,
            };
        }
        let nodes = (((high - low) / most_step).ceil() as usize + 1).max(FEWEST);
        Self {
            first: low,
            step: (high - low) / (nodes - 1) as f64,
            nodes,
        }
    }

    fn node(&self, k: usize) -> f64 {
        self.first + k as f64 * self.step
    }

    /// Nodes and weights for a value; none if it is outside.
    fn weights(&self, value: f64) -> Option<Vec<(usize, f64)>> {
        let x = (value - self.first) / self.step;
        // Rounding of sums and products at the ends.
        const SLACK: f64 = 1e-6;
        if !(-SLACK..=(self.nodes - 1) as f64 + SLACK).contains(&x) {
            return None;
        }
        if self.nodes == 1 {
            return Some(vec![(0, 1.0)]);
        }
        let i = (x.floor().max(0.0) as usize).clamp(1, self.nodes - 3);
        Some((i - 1..i + 3).zip(lagrange(x - i as f64)).collect())
    }
}

/// Transmissions along the normal, on a grid.
pub struct CellBank {
    stated: CellStack,
    range: BankRange,
    widths: Axis,
    axes: [Axis; QUANTITIES],
    /// By colour, stack and width; the last of each row is a site without pillar.
    t: Vec<Complex64>,
}

impl CellBank {
    /// Solve it. `stated`: the pillar that changes are counted from.
    ///
    /// # Errors
    /// If it would be too large, a cell cannot be solved, or the user stopped it.
    pub fn solve(stated: &CellStack, range: BankRange, progress: &dyn Progress) -> Result<Self> {
        let mut bank = Self::empty(stated, range)?;
        let rows = bank.range.colours.len() * bank.stacks();
        progress.begin("solving the tables of cells", rows as u64);
        let solved = (0..rows)
            .into_par_iter()
            .map(|row| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let solved = bank.solve_row(row / bank.stacks(), row % bank.stacks());
                progress.advance(1);
                solved
            })
            .collect::<Result<Vec<_>>>()?;
        bank.t = solved.concat();
        Ok(bank)
    }

    /// Read the bank that was kept for these inputs.
    ///
    /// # Errors
    /// If it is not there, damaged, or of something else: it is never solved here.
    pub fn read(path: &Path, stated: &CellStack, range: BankRange) -> Result<Self> {
        let mut bank = Self::empty(stated, range)?;
        let bytes = metalith_core::file::read_at_most(path, LONGEST, "a table of cells")?;
        let unusable = |why: String| {
            Error::invalid(
                format!("the tables of cells in {} cannot be used: {why}", path.display()),
                "plan the study again into another folder; a shard makes no tables of its own",
            )
        };
        let content = kept::open(&bytes, MAGIC, &bank.inputs()).map_err(|e| unusable(e.to_string()))?;
        let numbers: Vec<f64> = content
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
            .collect();
        let rows = bank.range.colours.len() * bank.stacks();
        if numbers.len() != 2 * rows * (bank.widths.nodes + 1) || numbers.iter().any(|v| !v.is_finite()) {
            return Err(unusable("numbers are missing".into()));
        }
        bank.t = numbers.chunks_exact(2).map(|z| Complex64::new(z[0], z[1])).collect();
        Ok(bank)
    }

    /// Keep it in a file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let numbers = self.t.iter().flat_map(|z| [z.re.to_le_bytes(), z.im.to_le_bytes()]);
        kept::write(path, MAGIC, &self.inputs(), &numbers.flatten().collect::<Vec<u8>>())
    }

    /// Number of stacks that are solved at every wavelength.
    pub fn stacks(&self) -> usize {
        self.axes.iter().map(|a| a.nodes).product()
    }

    /// The pillar that changes are counted from.
    pub fn stated(&self) -> &CellStack {
        &self.stated
    }

    fn empty(stated: &CellStack, range: BankRange) -> Result<Self> {
        let [low, high] = range.widths_nm;
        // A whole number of steps below the narrowest.
        let first = (low / WIDTH_STEP_NM).floor() * WIDTH_STEP_NM - BEYOND as f64 * WIDTH_STEP_NM;
        let nodes = ((high - first) / WIDTH_STEP_NM).ceil() as usize + 1 + BEYOND;
        let [least, most] = range.changes.each_ref().map(quantities);
        let axes: [Axis; QUANTITIES] = std::array::from_fn(|k| Axis::over(least[k], most[k], STACK_STEPS[k]));
        let bank = Self {
            stated: stated.clone(),
            widths: Axis {
                first,
                step: WIDTH_STEP_NM,
                nodes,
            },
            range,
            axes,
            t: Vec::new(),
        };
        if bank.stacks() > MOST_STACKS {
            return Err(Error::invalid(
                format!(
                    "tables of {} pillars would have to be solved, for every width and wavelength",
                    bank.stacks()
                ),
                format!("vary fewer of height, index, taper, corners and mask at once, or less: at most {MOST_STACKS} are solved"),
            ));
        }
        Ok(bank)
    }

    /// The change of a stack of the grid.
    fn change(&self, mut stack: usize) -> CellChange {
        change_of(self.axes.each_ref().map(|axis| {
            let k = stack % axis.nodes;
            stack /= axis.nodes;
            axis.node(k)
        }))
    }

    fn solve_row(&self, colour: usize, stack: usize) -> Result<Vec<Complex64>> {
        let (um, orders) = self.range.colours[colour];
        let orders = Orders::new(orders)?;
        let etched = perturbed(&self.stated, &self.change(stack));
        let at = |width: f64| {
            let width = possible_width_nm(&etched, width);
            off_cutoff(width, |w| etched.transmission(w, um, orders))
        };
        let widths = (0..self.widths.nodes).map(|k| at(self.widths.node(k)));
        widths.chain([etched.transmission(0.0, um, orders)]).collect()
    }

    /// Transmissions of pillars of these widths (nm) with a change, along the normal.
    ///
    /// # Errors
    /// If any of it is outside what the bank holds: nothing is solved here.
    pub(super) fn transmissions(
        &self,
        change: &CellChange,
        orders: usize,
        widths_nm: &[f64],
        wavelength_um: f64,
    ) -> Result<SolvedWidths> {
        let outside = |what: String| {
            Error::invalid(
                format!("the tables of cells hold no {what}"),
                "plan the study again; a shard makes no tables of its own",
            )
        };
        let colour = self.range.colours.iter().position(|c| *c == (wavelength_um, orders));
        let colour = colour.ok_or_else(|| outside(format!("wavelength of {} nm", wavelength_um * 1e3)))?;
        let mut stacks = vec![(0, 1.0)];
        let mut stride = 1;
        for (axis, value) in self.axes.iter().zip(quantities(change)) {
            let nodes = axis.weights(value).ok_or_else(|| outside(format!("pillar like {change:?}")))?;
            let pairs = stacks.iter().flat_map(|(s, w)| nodes.iter().map(move |(k, v)| (s + k * stride, w * v)));
            stacks = pairs.collect();
            stride *= axis.nodes;
        }
        // One row for this pillar; widths are then taken from it.
        let length = self.widths.nodes + 1;
        let mut row = vec![Complex64::ZERO; length];
        for (stack, weight) in stacks {
            let from = (colour * self.stacks() + stack) * length;
            for (sum, t) in row.iter_mut().zip(&self.t[from..from + length]) {
                *sum += t * weight;
            }
        }
        let at = |width: &f64| {
            let weights = self.widths.weights(*width).ok_or_else(|| outside(format!("width of {width} nm")))?;
            Ok(weights.into_iter().map(|(k, w)| row[k] * w).sum())
        };
        Ok(SolvedWidths {
            pillars: vec![widths_nm.iter().map(at).collect::<Result<_>>()?],
            bare: vec![row[length - 1]],
        })
    }

    /// What the numbers follow from.
    fn inputs(&self) -> Vec<u8> {
        let known = format!("{} {:?} {:?}", kept::SOLVER, self.stated, self.range);
        known.into_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RealisedCells;
    use metalith_cell::BAND_ORDERS;
    use metalith_core::Silent;

    /// Rms error over widths and pillars: what a cubic leaves beside resonances.
    const RMS: f64 = 0.01;

    fn bank() -> CellBank {
        let stated = CellStack::paper(350.0, 700.0).unwrap();
        let least = change_of([-6.0, 0.0, 0.0, 0.0, 0.0]);
        let most = change_of([6.0, 0.0, 0.0, 0.0, 0.0]);
        let range = BankRange {
            widths_nm: [150.0, 200.0],
            changes: [least, most],
            colours: vec![(0.53, BAND_ORDERS)],
        };
        CellBank::solve(&stated, range, &Silent).unwrap()
    }

    #[test]
    fn pillars_between_the_nodes_are_those_solved_exactly_and_none_beyond_them_is_there() {
        let bank = bank();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cells.bank");
        bank.write(&path).unwrap();
        let back = CellBank::read(&path, bank.stated(), bank.range.clone()).unwrap();
        assert_eq!(back.t, bank.t);
        let change = change_of([1.3, 0.0, 0.0, 0.0, 0.0]);
        let widths: Vec<f64> = (0..24).map(|k| 150.4 + 2.0 * f64::from(k)).collect();
        let table = bank.transmissions(&change, BAND_ORDERS, &widths, 0.53).unwrap();
        let exact = RealisedCells::new(perturbed(bank.stated(), &change), 0.4);
        let exact = exact.solve_in_band(&widths, 0.53, [0.0; 2], &Silent).unwrap();
        let pairs = table.pillars[0].iter().zip(&exact.pillars[0]);
        let rms = (pairs.map(|(a, b)| (a - b).norm_sqr()).sum::<f64>() / widths.len() as f64).sqrt();
        assert!(rms < RMS, "rms {rms}");
        let higher = change_of([7.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(bank.transmissions(&higher, BAND_ORDERS, &widths, 0.53).is_err());
        assert!(bank.transmissions(&change, BAND_ORDERS, &[260.0], 0.53).is_err());
        assert!(bank.transmissions(&change, BAND_ORDERS, &widths, 0.6).is_err());
    }
}
