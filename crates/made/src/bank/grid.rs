//! The grid that a bank is solved on, and what stands between its nodes.

use num_complex::Complex64;

use crate::cells::lagrange;

/// Nodes of an axis at the least: a cubic takes four.
const FEWEST: usize = 4;

/// Nodes of one quantity of the pillar: one if it does not vary.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    pub first: f64,
    pub step: f64,
    pub nodes: usize,
}

impl Axis {
    pub fn over(low: f64, high: f64, most_step: f64) -> Self {
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

    pub fn node(&self, k: usize) -> f64 {
        self.first + k as f64 * self.step
    }

    /// Nodes and weights for a value; none if it is outside.
    pub fn weights(&self, value: f64) -> Option<Vec<(usize, f64)>> {
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

/// One wavelength of a bank.
#[derive(Debug, PartialEq)]
pub(super) struct Colour {
    /// Widths that are solved (nm), rising.
    pub widths_nm: Vec<f64>,
    /// By stack, width and number of a pillar; the last of each row is a site without pillar.
    pub t: Vec<Complex64>,
}

impl Colour {
    /// Weights of four widths for any between them; none outside.
    pub fn weights(&self, width_nm: f64) -> Option<[(usize, f64); 4]> {
        let (first, last) = (self.widths_nm.first()?, self.widths_nm.last()?);
        if !(*first..=*last).contains(&width_nm) {
            return None;
        }
        let above = self.widths_nm.partition_point(|w| *w <= width_nm);
        let from = above.clamp(2, self.widths_nm.len() - 2) - 2;
        let at = |k: usize| self.widths_nm[from + k];
        // Lagrange's polynomial through four points at any distances.
        Some(std::array::from_fn(|k| {
            let others = (0..4).filter(|j| *j != k);
            (from + k, others.map(|j| (width_nm - at(j)) / (at(k) - at(j))).product())
        }))
    }
}
