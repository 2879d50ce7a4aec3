//! Rational functions through values at nodes: what transmissions are between them.
//!
//! A guided-mode resonance is a pole beside the real axis, of the size of a pillar as of its height or index. A cubic follows it where nodes are a
//! fraction of its width apart; a quotient of two polynomials has its own poles, and takes some nodes for each resonance, however narrow.

use std::ops::Range;

use num_complex::Complex64;

/// Nodes that a function goes through at the most: four poles.
pub(crate) const MOST_NODES: usize = 8;

/// Range of the nodes, rising, that the function at `x` goes through: the nearest on either side, as many on one as on
/// the other where there are.
pub(crate) fn around(nodes: &[f64], x: f64) -> Range<usize> {
    let count = nodes.len().min(MOST_NODES);
    let above = nodes.partition_point(|node| *node <= x);
    let first = above.saturating_sub(count / 2).min(nodes.len() - count);
    first..first + count
}

/// The value at `x` of the rational function through these values at distinct nodes, [`MOST_NODES`] at the most: the degree below the line
/// is that above it, or one more (Stoer and Bulirsch, Introduction to Numerical Analysis, 2.2.3). Zero if there is no node.
pub(crate) fn rational(nodes: &[f64], values: &[Complex64], x: f64) -> Complex64 {
    let nearest = |a: &usize, b: &usize| (nodes[*a] - x).abs().total_cmp(&(nodes[*b] - x).abs());
    let Some(nearest) = (0..nodes.len()).min_by(nearest) else {
        return Complex64::ZERO;
    };
    let mut value = values[nearest];
    if nodes[nearest] == x {
        return value;
    }
    // Differences of functions through neighbouring nodes: with one node more above, and with one more below.
    let (mut above, mut below) = ([Complex64::ZERO; MOST_NODES], [Complex64::ZERO; MOST_NODES]);
    above[..nodes.len()].copy_from_slice(values);
    below[..nodes.len()].copy_from_slice(values);
    // How many nodes of the function are below the nearest.
    let mut left = nearest;
    for more in 1..nodes.len() {
        let rest = nodes.len() - more;
        for k in 0..rest {
            let ratio = (nodes[k] - x) / (nodes[k + more] - x);
            let turned = below[k] * ratio;
            let under = turned - above[k + 1];
            // Functions of lower degree that agree, or have a pole here: nothing is added to them.
            let step = if under == Complex64::ZERO {
                Complex64::ZERO
            } else {
                (above[k + 1] - below[k]) / under
            };
            below[k] = above[k + 1] * step;
            above[k] = turned * step;
        }
        value += if 2 * left < rest {
            above[left]
        } else {
            left -= 1;
            below[left]
        };
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUNDING: f64 = 1e-10;

    fn nodes(count: usize) -> Vec<f64> {
        // At uneven distances.
        (0..count).map(|k| k as f64 + 0.2 * (k as f64).sin()).collect()
    }

    /// A background with three resonances, a tenth of a step wide at the least: seven nodes tell it.
    fn resonant(x: f64) -> Complex64 {
        let poles = [(1.3, 0.1), (3.8, 0.4), (5.5, 0.2)];
        let sum: Complex64 = poles
            .iter()
            .map(|(at, wide)| Complex64::new(0.0, *wide) / Complex64::new(x - at, *wide))
            .sum();
        Complex64::new(0.8, 0.3) + sum
    }

    #[test]
    fn quotients_of_polynomials_are_met_everywhere_by_as_many_nodes_as_tell_them() {
        let nodes = nodes(7);
        let values: Vec<Complex64> = nodes.iter().map(|x| resonant(*x)).collect();
        for k in 0..=60 {
            let x = f64::from(k) * 0.1;
            assert!((rational(&nodes, &values, x) - resonant(x)).norm() < ROUNDING, "{x}");
        }
        assert_eq!(rational(&nodes, &values, nodes[2]), values[2]);
    }

    #[test]
    fn what_does_not_vary_stays_and_few_nodes_are_enough_to_answer() {
        let same = [Complex64::new(0.4, -1.2); 5];
        assert!((rational(&nodes(5), &same, 2.4) - same[0]).norm() < ROUNDING);
        assert_eq!(rational(&[1.0], &same[..1], 3.0), same[0]);
        assert_eq!(rational(&[], &[], 3.0), Complex64::ZERO);
        let nothing = [Complex64::ZERO; 4];
        assert_eq!(rational(&nodes(4), &nothing, 1.5), Complex64::ZERO);
    }

    #[test]
    fn the_nearest_nodes_are_taken_from_either_side_and_all_where_they_are_few() {
        let nodes: Vec<f64> = (0..20).map(f64::from).collect();
        assert_eq!(around(&nodes, 9.5), 6..14);
        assert_eq!(around(&nodes, 0.5), 0..8);
        assert_eq!(around(&nodes, 19.0), 12..20);
        assert_eq!(around(&nodes[..3], 1.5), 0..3);
        assert_eq!(around(&[], 1.5), 0..0);
    }
}
