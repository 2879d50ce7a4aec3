//! The grid of the quantities of a pillar that vary, and what stands between its nodes.

use num_complex::Complex64;

use crate::CellChange;
use crate::rational_interpolation::{around, rational};
use crate::realised_cells::lagrange;

/// Nodes of an axis at the least: a cubic takes four.
const FEWEST: usize = 4;

/// Largest distance of the nodes of height (nm), index, taper (deg), corners and mask (nm), in the order of
/// [`quantities`]: a twentieth of a turn or so.
const STEPS: [f64; QUANTITIES] = [5.0, 0.02, 0.75, 10.0, 5.0];

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

pub(super) fn change_of(
    [height_nm, index, taper_deg, corner_rounding_nm, residual_mask_nm]: [f64; QUANTITIES],
) -> CellChange {
    CellChange {
        height_nm,
        index,
        taper_deg,
        corner_rounding_nm,
        residual_mask_nm,
        ..CellChange::default()
    }
}

/// Nodes of one quantity of the pillar: one if it does not vary.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    pub first: f64,
    pub step: f64,
    pub nodes: usize,
}

impl Axis {
    pub(crate) fn over(low: f64, high: f64, most_step: f64) -> Self {
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

    pub(crate) fn node(&self, k: usize) -> f64 {
        self.first + k as f64 * self.step
    }

    /// All nodes, rising.
    pub(crate) fn all(&self) -> Vec<f64> {
        (0..self.nodes).map(|k| self.node(k)).collect()
    }

    /// Steps from the first node to a value; `None` if it is outside.
    fn steps_to(&self, value: f64) -> Option<f64> {
        let x = (value - self.first) / self.step;
        // Rounding of sums and products at the ends.
        const SLACK: f64 = 1e-6;
        (-SLACK..=(self.nodes - 1) as f64 + SLACK).contains(&x).then_some(x)
    }

    /// Nodes and weights for a value; none if it is outside.
    pub(crate) fn weights(&self, value: f64) -> Option<Vec<(usize, f64)>> {
        let x = self.steps_to(value)?;
        if self.nodes == 1 {
            return Some(vec![(0, 1.0)]);
        }
        let i = (x.floor().max(0.0) as usize).clamp(1, self.nodes - 3);
        Some((i - 1..i + 3).zip(lagrange(x - i as f64)).collect())
    }
}

/// Stacks that are solved: all combinations of the nodes of what varies.
pub(super) struct StackGrid([Axis; QUANTITIES]);

impl StackGrid {
    /// Over all changes between the least and the most of each number.
    pub(crate) fn over([least, most]: &[CellChange; 2]) -> Self {
        let (least, most) = (quantities(least), quantities(most));
        Self(std::array::from_fn(|k| Axis::over(least[k], most[k], STEPS[k])))
    }

    /// Number of stacks.
    pub(crate) fn count(&self) -> usize {
        self.0.iter().map(|a| a.nodes).product()
    }

    /// The change of a stack of the grid.
    pub(crate) fn change(&self, mut stack: usize) -> CellChange {
        change_of(self.0.each_ref().map(|axis| {
            let k = stack % axis.nodes;
            stack /= axis.nodes;
            axis.node(k)
        }))
    }

    /// Stacks and weights of the cubics along every axis; none if a number is outside.
    pub(crate) fn weights(&self, change: &CellChange) -> Option<Vec<(usize, f64)>> {
        let mut stacks = vec![(0, 1.0)];
        let mut stride = 1;
        for (axis, value) in self.0.iter().zip(quantities(change)) {
            let nodes = axis.weights(value)?;
            let pairs = stacks
                .iter()
                .flat_map(|(s, w)| nodes.iter().map(move |(k, v)| (s + k * stride, w * v)));
            stacks = pairs.collect();
            stride *= axis.nodes;
        }
        Some(stacks)
    }

    /// True if a change is between the nodes.
    pub(crate) fn holds(&self, change: &CellChange) -> bool {
        let mut axes = self.0.iter().zip(quantities(change));
        axes.all(|(axis, value)| axis.steps_to(value).is_some())
    }

    /// Value at a change that the grid holds, by rational functions along every axis, from the values of all stacks.
    pub(crate) fn between(&self, change: &CellChange, of_stacks: impl Iterator<Item = Complex64>) -> Complex64 {
        let mut values: Vec<Complex64> = of_stacks.collect();
        for (axis, value) in self.0.iter().zip(quantities(change)) {
            let nodes = axis.all();
            let near = around(&nodes, value);
            let along = values.chunks_exact(axis.nodes);
            values = along
                .map(|own| rational(&nodes[near.clone()], &own[near.clone()], value))
                .collect();
        }
        values[0]
    }
}
