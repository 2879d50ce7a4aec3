//! How one parameter changes every capture: a polynomial through the simulated values.

use std::sync::Arc;

use crate::optics::PixelGrid;
use crate::set::{CaptureIndex, PerCapture};

/// Most nodes of a polynomial; if there are more, those farthest from where it is evaluated are dropped.
const MOST_NODES: usize = 6;

/// Changes of all captures with one parameter.
#[derive(Clone, Default)]
pub struct Curve {
    /// Offsets from the base; zero is not among them.
    nodes: Vec<f64>,
    /// Changes from the base at each node, `by node and capture`.
    grids: Vec<Arc<PerCapture<PixelGrid>>>,
    /// Nodes on one side of zero do not count on the other.
    kinked: bool,
}

impl Curve {
    /// A polynomial through the changes at some offsets.
    pub fn new(nodes: Vec<f64>, grids: impl IntoIterator<Item = PerCapture<PixelGrid>>, kinked: bool) -> Self {
        let grids = grids.into_iter().map(Arc::new).collect();
        Self { nodes, grids, kinked }
    }

    /// Add an offset, near which the polynomial is evaluated from now on.
    pub fn add(&mut self, node: f64, grids: PerCapture<PixelGrid>) {
        if self.nodes.len() >= MOST_NODES {
            let farthest = (0..self.nodes.len())
                .max_by(|&a, &b| (self.nodes[a] - node).abs().total_cmp(&(self.nodes[b] - node).abs()));
            if let Some(farthest) = farthest {
                self.nodes.remove(farthest);
                self.grids.remove(farthest);
            }
        }
        self.nodes.push(node);
        self.grids.push(Arc::new(grids));
    }

    /// The change of one capture at an offset: grids and their factors.
    pub fn change(&self, u: f64, capture: CaptureIndex) -> impl Iterator<Item = (&PixelGrid, f32)> {
        self.grids
            .iter()
            .zip(self.weights(u))
            .map(move |(grids, w)| (&grids[capture], w as f32))
    }

    /// Its derivative by the offset.
    pub fn slope(&self, u: f64, capture: CaptureIndex) -> impl Iterator<Item = (&PixelGrid, f32)> {
        self.grids
            .iter()
            .zip(self.slopes(u))
            .map(move |(grids, w)| (&grids[capture], w as f32))
    }

    /// Least and greatest simulated offset.
    pub fn ends(&self) -> (f64, f64) {
        let low = self.nodes.iter().copied().fold(0.0, f64::min);
        let high = self.nodes.iter().copied().fold(0.0, f64::max);
        (low, high)
    }

    /// Weights of the changes at the nodes for an offset `u`; linear beyond the ends.
    fn weights(&self, u: f64) -> Vec<f64> {
        let (low, high) = self.ends();
        let inside = u.clamp(low, high);
        let beyond = u - inside;
        (0..self.nodes.len())
            .map(|i| {
                self.lagrange(i, inside)
                    + if beyond == 0.0 {
                        0.0
                    } else {
                        beyond * self.lagrange_slope(i, inside)
                    }
            })
            .collect()
    }

    fn slopes(&self, u: f64) -> Vec<f64> {
        let (low, high) = self.ends();
        (0..self.nodes.len())
            .map(|i| self.lagrange_slope(i, u.clamp(low, high)))
            .collect()
    }

    /// Whether a node counts at `u`.
    fn counts(&self, node: f64, u: f64) -> bool {
        !self.kinked || (node > 0.0) == (u >= 0.0)
    }

    /// Zeros of the Lagrange polynomial of node `i`: the other nodes and the base.
    fn roots(&self, i: usize, u: f64) -> Vec<f64> {
        let others = self.nodes.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, n)| *n);
        others.filter(|n| self.counts(*n, u)).chain([0.0]).collect()
    }

    fn lagrange(&self, i: usize, u: f64) -> f64 {
        let at = self.nodes[i];
        if !self.counts(at, u) {
            return 0.0;
        }
        self.roots(i, u).into_iter().map(|n| (u - n) / (at - n)).product()
    }

    fn lagrange_slope(&self, i: usize, u: f64) -> f64 {
        let at = self.nodes[i];
        if !self.counts(at, u) {
            return 0.0;
        }
        let roots = self.roots(i, u);
        let scale: f64 = roots.iter().map(|n| at - n).product();
        (0..roots.len())
            .map(|k| {
                let rest = roots.iter().enumerate().filter(|(j, _)| *j != k);
                rest.map(|(_, n)| u - n).product::<f64>()
            })
            .sum::<f64>()
            / scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_of_degree_four_is_reproduced_and_continued_linearly() {
        /// Absolute, of values of a few: rounding.
        const ROUNDING: f64 = 1e-12;
        let curve = Curve {
            nodes: vec![-2.0, -1.0, 1.0, 2.0],
            grids: Vec::new(),
            kinked: false,
        };
        let f = |u: f64| 3.0 * u - 0.5 * u * u + 0.1 * u.powi(4);
        let slope = |u: f64| 3.0 - u + 0.4 * u.powi(3);
        let value = |u: f64| -> f64 { curve.weights(u).iter().zip(&curve.nodes).map(|(w, n)| w * f(*n)).sum() };
        let derivative = |u: f64| -> f64 { curve.slopes(u).iter().zip(&curve.nodes).map(|(w, n)| w * f(*n)).sum() };
        for u in [-2.0, -0.7, 0.0, 0.3, 1.9] {
            assert!((value(u) - f(u)).abs() < ROUNDING && (derivative(u) - slope(u)).abs() < ROUNDING);
        }
        assert!((value(3.0) - f(2.0) - slope(2.0)).abs() < ROUNDING);
    }
}
