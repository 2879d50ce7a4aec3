//! Change of every prediction by one parameter: a polynomial through the simulated values.

use std::sync::Arc;

use metalith_core::lagrange_weight;

use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::Measurements;

/// Most nodes of a polynomial; if there are more, those farthest from where it is evaluated are dropped.
const MOST_NODES: usize = 6;

/// One of the two sides of a parameter is taken from the other if it errs by less than this share of the change: half of that is
/// the error of its slope, and changes err by 1 to 3 % in any case.
const SECOND_SIDE: f64 = 0.03;

/// And if the change on the other side is another by less than this share: of one that is new, nothing was known before.
const SAME_CHANGE: f64 = 0.3;

/// Changes of all predictions with one parameter.
#[derive(Clone)]
pub(crate) struct Curve<M: Measurements> {
    /// The value that offsets are from.
    about: f64,
    /// Offsets from the base; zero is not among them.
    nodes: Vec<f64>,
    /// Changes from the base at each node, by node and measurement.
    changes: Vec<Arc<PerMeasurement<M::Prediction>>>,
    /// Nodes on one side of zero do not count on the other.
    kinked: bool,
}

impl<M: Measurements> Curve<M> {
    /// A polynomial through the changes at some offsets from a value of the parameter.
    pub(crate) fn new(
        about: f64,
        nodes: Vec<f64>,
        changes: impl IntoIterator<Item = PerMeasurement<M::Prediction>>,
        kinked: bool,
    ) -> Self {
        let changes = changes.into_iter().map(Arc::new).collect();
        Self {
            about,
            nodes,
            changes,
            kinked,
        }
    }

    /// The changes of a parameter that was not simulated.
    pub(crate) fn unknown() -> Self {
        Self::new(0.0, Vec::new(), [], false)
    }

    /// True if offsets are from this value.
    pub(crate) fn is_about(&self, value: f64) -> bool {
        self.about == value
    }

    /// True if it was simulated at any offset.
    pub(crate) fn is_simulated(&self) -> bool {
        !self.nodes.is_empty()
    }

    /// Add an offset, near which the polynomial is evaluated from now on.
    pub(crate) fn add(&mut self, node: f64, changes: PerMeasurement<M::Prediction>) {
        if self.nodes.len() >= MOST_NODES {
            let farthest = (0..self.nodes.len())
                .max_by(|&a, &b| (self.nodes[a] - node).abs().total_cmp(&(self.nodes[b] - node).abs()));
            if let Some(farthest) = farthest {
                self.nodes.remove(farthest);
                self.changes.remove(farthest);
            }
        }
        self.nodes.push(node);
        self.changes.push(Arc::new(changes));
    }

    /// The change of one prediction at an offset: changes at the nodes and their factors.
    pub(crate) fn change(&self, u: f64, measurement: MeasurementIndex) -> impl Iterator<Item = (&M::Prediction, f32)> {
        self.changes
            .iter()
            .zip(self.weights(u))
            .map(move |(changes, w)| (&changes[measurement], w as f32))
    }

    /// Derivative by the offset.
    pub(crate) fn slope(&self, u: f64, measurement: MeasurementIndex) -> impl Iterator<Item = (&M::Prediction, f32)> {
        self.changes
            .iter()
            .zip(self.slopes(u))
            .map(move |(changes, w)| (&changes[measurement], w as f32))
    }

    /// The changes at `node`, from those that `anew` has at `-node`: what is even in the offset is taken as this curve has it. None where
    /// that may be wrong by more than [`SECOND_SIDE`]: it is taken to be so by the share by which the change at `-node` is another.
    pub(crate) fn other_side(&self, anew: &Self, node: f64) -> Option<PerMeasurement<M::Prediction>> {
        let (low, high) = self.ends();
        if !self.is_about(anew.about) || self.kinked || anew.kinked || low > -node.abs() || high < node.abs() {
            return None;
        }
        let measurements = self.changes[0].keys();
        let [mut own, mut moved, mut even] = [0.0; 3];
        let mut other_side = Vec::new();
        for measurement in measurements {
            let before = M::combine(&self.change(-node, measurement).collect::<Vec<_>>());
            let beyond = M::combine(&self.change(node, measurement).collect::<Vec<_>>());
            let now = M::combine(&anew.change(-node, measurement).collect::<Vec<_>>());
            own += M::mean_square(&now);
            moved += M::mean_square(&M::combine(&[(&now, 1.0), (&before, -1.0)]));
            even += M::mean_square(&M::combine(&[(&before, 1.0), (&beyond, 1.0)]));
            other_side.push(M::combine(&[(&before, 1.0), (&beyond, 1.0), (&now, -1.0)]));
        }
        let is_known = (moved * even).sqrt() < SECOND_SIDE * own && moved < SAME_CHANGE.powi(2) * own;
        is_known.then(|| other_side.into())
    }

    /// Least and greatest simulated offset.
    pub(crate) fn ends(&self) -> (f64, f64) {
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

    /// True if a node counts at `u`.
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
        lagrange_weight(u, at, self.roots(i, u))
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
    use crate::test_model::{Samples, Waves};

    #[test]
    fn a_polynomial_of_degree_four_is_reproduced_and_continued_linearly() {
        /// Absolute, of values of a few: rounding.
        const ROUNDING: f64 = 1e-12;
        let curve = Curve::<Samples> {
            about: 0.0,
            nodes: vec![-2.0, -1.0, 1.0, 2.0],
            changes: Vec::new(),
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

    /// Changes of one prediction: cosines of these periods and amplitudes.
    fn changes(waves: &[([u32; 2], f64)]) -> PerMeasurement<Waves> {
        vec![Waves::new(0.0, waves)].into()
    }

    /// Curve through the changes u * odd + u^2 * even at offsets of -1 and 1.
    fn both_sides(odd: f64, even: f64) -> Curve<Samples> {
        let at = |u: f64| changes(&[([2, 3], u * odd), ([5, 4], u * u * even)]);
        Curve::new(0.0, vec![-1.0, 1.0], [at(-1.0), at(1.0)], false)
    }

    fn one_side(odd: f64, even: f64) -> Curve<Samples> {
        Curve::new(0.0, vec![-1.0], [changes(&[([2, 3], -odd), ([5, 4], even)])], false)
    }

    #[test]
    fn the_other_side_follows_where_what_is_even_is_the_same() {
        /// Of a mean square: single-precision factors.
        const ROUNDING: f64 = 1e-9;
        let before = both_sides(0.3, 0.05);
        let found = before.other_side(&one_side(0.32, 0.05), 1.0).unwrap();
        let want = changes(&[([2, 3], 0.32), ([5, 4], 0.05)]);
        let first = MeasurementIndex::from(0);
        let error = Samples::combine(&[(&found[first], 1.0), (&want[first], -1.0)]);
        assert!(
            Samples::mean_square(&error) < ROUNDING,
            "{}",
            Samples::mean_square(&error)
        );
    }

    #[test]
    fn the_other_side_is_not_known_of_what_changed_much_or_was_not_there() {
        // What is even counts much, and the change is another by a fifth.
        assert!(both_sides(0.3, 0.2).other_side(&one_side(0.36, 0.2), 1.0).is_none());
        // The change is new, as that of a parameter which did nothing.
        assert!(both_sides(0.0, 0.0).other_side(&one_side(0.3, 0.1), 1.0).is_none());
        // From another value, and where the derivative jumps.
        let elsewhere = Curve {
            about: 0.5,
            ..both_sides(0.3, 0.0)
        };
        let kinked = Curve {
            kinked: true,
            ..both_sides(0.3, 0.0)
        };
        let anew = one_side(0.3, 0.0);
        assert!(both_sides(0.3, 0.0).other_side(&anew, 1.0).is_some());
        assert!(elsewhere.other_side(&anew, 1.0).is_none() && kinked.other_side(&anew, 1.0).is_none());
    }
}
