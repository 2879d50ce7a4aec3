//! Kernels between the places at which they were formed.

use std::ops::Range;

use metalith_sensor::lagrange;

/// Rule by which the kernel at a place of an element's field follows from the kernels of the nodes about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BetweenNodes {
    /// Linear interpolation along each axis.
    #[default]
    Linear,
    /// Along each axis the polynomial through the six next to it, or through all where they are fewer. For images without
    /// rounding: fine detail, as light of narrow bands gives, then follows a polynomial.
    Sixfold,
}

/// Nodes along each axis of [`BetweenNodes::Sixfold`].
const SIX: usize = 6;

impl BetweenNodes {
    /// Nodes of `n` along one axis that may count at a place among them.
    pub fn nodes_about(self, place: f32, n: usize) -> Range<usize> {
        let count = match self {
            Self::Linear => 2,
            Self::Sixfold => SIX,
        };
        let count = count.min(n);
        // As many on one side as on the other, unless they end there.
        let start = (place.max(0.0) as usize + 1).saturating_sub(count / 2).min(n - count);
        start..start + count
    }

    /// Weight of one of `n` by `n` nodes at a place among them: one at its own, zero at the others; all of them add up to one.
    pub fn weight(self, place: [f32; 2], node: [usize; 2], n: usize) -> f32 {
        let axis = |a: usize| match self {
            Self::Linear => hat(place[a] - node[a] as f32),
            Self::Sixfold => {
                let about = self.nodes_about(place[a], n);
                if about.contains(&node[a]) {
                    lagrange(
                        node[a] - about.start,
                        about.len(),
                        f64::from(place[a]) - about.start as f64,
                    ) as f32
                } else {
                    0.0
                }
            }
        };
        let first = axis(0);
        if first == 0.0 { 0.0 } else { first * axis(1) }
    }

    /// Append the weights of a node at places next to one another.
    pub fn weights(self, places: &[[f32; 2]], node: [usize; 2], n: usize, to: &mut Vec<f32>) {
        match self {
            // Without a branch, so that many are found at once.
            Self::Linear => {
                let at = node.map(|k| k as f32);
                to.extend(places.iter().map(|p| hat(p[0] - at[0]) * hat(p[1] - at[1])));
            }
            Self::Sixfold => to.extend(places.iter().map(|p| self.weight(*p, node, n))),
        }
    }
}

/// Weight of a node by the distance in steps from it, where light is blended linearly.
fn hat(distance: f32) -> f32 {
    (1.0 - distance.abs()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: [BetweenNodes; 2] = [BetweenNodes::Linear, BetweenNodes::Sixfold];

    /// All places of a field, its ends and the nodes among them.
    fn places(n: usize) -> impl Iterator<Item = f32> {
        (0..=8 * (n - 1)).map(|i| i as f32 / 8.0)
    }

    #[test]
    fn weights_add_up_to_one_and_are_those_of_a_node_at_it() {
        // Sums of a few products in single precision.
        const SINGLE: f32 = 1e-6;
        for between in BOTH {
            for n in [1, 3, 5, 9, 33] {
                for (y, x) in places(n).zip(places(n).collect::<Vec<_>>().into_iter().rev()) {
                    let about = [y, x].map(|p| between.nodes_about(p, n));
                    let mut of_many = Vec::new();
                    between.weights(&[[y, x]; 3], [n / 2, n - 1], n, &mut of_many);
                    assert_eq!(of_many, [between.weight([y, x], [n / 2, n - 1], n); 3]);
                    let of = |i: usize| between.weight([y, x], [i / n, i % n], n);
                    let all: f32 = (0..n * n).map(of).sum();
                    assert!((all - 1.0).abs() < SINGLE, "{between:?} {n} {y} {x}: {all}");
                    let counts = |i: usize| about[0].contains(&(i / n)) && about[1].contains(&(i % n));
                    assert!((0..n * n).all(|i| of(i) == 0.0 || counts(i)));
                    if y.fract() == 0.0 && x.fract() == 0.0 {
                        assert_eq!(of(y as usize * n + x as usize), 1.0);
                    }
                }
            }
        }
    }

    #[test]
    fn six_nodes_hold_polynomials_of_the_fifth_degree() {
        /// Single precision of weights, of values up to one.
        const SINGLE: f64 = 1e-6;
        let n = 9;
        let value = |p: f64| ((p - 4.0) / 4.0).powi(5) - 0.3 * ((p - 4.0) / 4.0).powi(2);
        for p in places(n) {
            let of = |i: usize| f64::from(BetweenNodes::Sixfold.weight([p, 2.0], [i, 2], n)) * value(i as f64);
            let found: f64 = (0..n).map(of).sum();
            assert!((found - value(p.into())).abs() < SINGLE, "{p}: {found}");
        }
    }

    /// Kernels of an element and its mirrored twin are equal at mirrored places.
    #[test]
    fn both_sides_are_alike() {
        let n = 9;
        for between in BOTH {
            for p in places(n) {
                for node in 0..n {
                    let there = between.weight([p, 4.0], [node, 4], n);
                    let mirrored = between.weight([8.0 - p, 4.0], [8 - node, 4], n);
                    // Rounding of products in another order.
                    assert!((there - mirrored).abs() < 1e-6, "{between:?} {p} {node}");
                }
            }
        }
    }
}
