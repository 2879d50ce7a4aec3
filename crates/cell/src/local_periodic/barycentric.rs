//! Rational functions in barycentric form, fitted to samples by the AAA algorithm (Nakatsukasa, Sete and Trefethen, SIAM J. Sci.
//! Comput. 40, A1494, 2018).

use nalgebra::DMatrix;
use num_complex::Complex64;

/// Quotient of two polynomials of the same degree: sum of w f / (x - z) over sum of w / (x - z), with nodes z, values f, weights w.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Barycentric {
    /// Distinct nodes.
    pub nodes: Vec<f64>,
    /// Values at the nodes.
    pub values: Vec<Complex64>,
    pub weights: Vec<Complex64>,
}

/// Pole of a rational function beside the real axis, and its residue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pole {
    pub at: Complex64,
    pub residue: Complex64,
}

impl Barycentric {
    /// Function of the lowest degree that is within a tolerance of samples at distinct places; of the highest degree that they
    /// tell if none is. The next node is the sample that it misses most; weights are the singular vector of the smallest singular
    /// value of the Loewner matrix.
    pub(super) fn fit(places: &[f64], values: &[Complex64], tolerance: f64) -> Self {
        let mean = values.iter().sum::<Complex64>() / values.len() as f64;
        let mut misses: Vec<f64> = values.iter().map(|v| (v - mean).norm()).collect();
        let (mut nodes, mut free) = (Vec::new(), (0..places.len()).collect::<Vec<usize>>());
        loop {
            let most = free.iter().copied().max_by(|a, b| misses[*a].total_cmp(&misses[*b]));
            nodes.extend(most);
            free.retain(|k| Some(*k) != most);
            let own = Self::of_nodes(places, values, &nodes, &free);
            for &k in &free {
                misses[k] = (own.at(places[k]) - values[k]).norm();
            }
            let met = free.iter().all(|k| misses[*k] <= tolerance);
            if met || nodes.len() >= places.len().div_ceil(2) {
                return own;
            }
        }
    }

    /// Function with these samples as nodes, nearest to the free ones.
    fn of_nodes(places: &[f64], values: &[Complex64], nodes: &[usize], free: &[usize]) -> Self {
        let count = nodes.len();
        // At least square, or the singular vectors are fewer than the nodes.
        let loewner = DMatrix::from_fn(free.len().max(count), count, |row, column| match free.get(row) {
            Some(&k) => (values[k] - values[nodes[column]]) / (places[k] - places[nodes[column]]),
            None => Complex64::ZERO,
        });
        let right = loewner
            .try_svd(false, true, f64::EPSILON, STEPS)
            .and_then(|svd| svd.v_t);
        let weights = match right {
            Some(right) => right.row(count - 1).iter().map(|w| w.conj()).collect(),
            // Meets its nodes and nothing else, so that whoever compares it sees that it is none.
            None => vec![Complex64::ONE; count],
        };
        Self {
            nodes: nodes.iter().map(|&k| places[k]).collect(),
            values: nodes.iter().map(|&k| values[k]).collect(),
            weights,
        }
    }

    /// Value at a place.
    pub(super) fn at(&self, x: f64) -> Complex64 {
        let (mut above, mut below) = (Complex64::ZERO, Complex64::ZERO);
        for ((node, value), weight) in self.nodes.iter().zip(&self.values).zip(&self.weights) {
            let apart = x - node;
            if apart == 0.0 {
                return *value;
            }
            let share = weight / apart;
            above += share * value;
            below += share;
        }
        above / below
    }

    /// Poles, in no order.
    pub(super) fn poles(&self) -> Vec<Pole> {
        if self.nodes.len() < 2 {
            return Vec::new();
        }
        let low = self.nodes.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.nodes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Scaled so that the zero which the matrix has besides the poles is far from all nodes.
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let scaled: Vec<f64> = self.nodes.iter().map(|x| (x - middle) / half + AWAY).collect();
        let sum: Complex64 = self.weights.iter().sum();
        let count = self.nodes.len();
        let matrix = DMatrix::from_fn(count, count, |row, column| {
            let own = if row == column { scaled[row] } else { 0.0 };
            Complex64::from(own) - self.weights[column] * scaled[column] / sum
        });
        let Some(found) = matrix
            .try_schur(f64::EPSILON, STEPS)
            .and_then(|schur| schur.eigenvalues())
        else {
            return Vec::new();
        };
        let far = found.iter().filter(|pole| pole.norm() > 0.5 * (AWAY - 1.0));
        far.map(|pole| {
            let at = (pole - AWAY) * half + middle;
            let (mut above, mut slope) = (Complex64::ZERO, Complex64::ZERO);
            for ((node, value), weight) in self.nodes.iter().zip(&self.values).zip(&self.weights) {
                let apart = at - node;
                above += weight * value / apart;
                slope -= weight / (apart * apart);
            }
            Pole {
                at,
                residue: above / slope,
            }
        })
        .collect()
    }
}

/// Place of the middle of the nodes when poles are found, in halves of their range.
const AWAY: f64 = 3.0;

/// Steps after which singular vectors and poles are given up.
const STEPS: usize = 1000;

#[cfg(test)]
mod tests {
    use super::*;

    /// Double precision, times the condition of a small fit.
    const ROUNDING: f64 = 1e-9;

    /// A slow background with two resonances.
    fn resonant(x: f64) -> Complex64 {
        let pole = |at: f64, wide: f64| Complex64::new(0.0, wide) / Complex64::new(x - at, wide);
        Complex64::new(0.8, 0.3) + pole(1.3, 0.02) + pole(3.8, 0.4)
    }

    #[test]
    fn quotients_of_polynomials_and_their_poles_are_found() {
        let places: Vec<f64> = (0..12).map(|k| f64::from(k) * 0.45).collect();
        let values: Vec<Complex64> = places.iter().map(|x| resonant(*x)).collect();
        let fit = Barycentric::fit(&places, &values, ROUNDING);
        assert_eq!(fit.nodes.len(), 3);
        for k in 0..=100 {
            let x = f64::from(k) * 0.05;
            assert!((fit.at(x) - resonant(x)).norm() < ROUNDING, "{x}");
        }
        let mut poles = fit.poles();
        poles.sort_by(|a, b| a.at.re.total_cmp(&b.at.re));
        assert_eq!(poles.len(), 2);
        for (pole, (at, wide)) in poles.iter().zip([(1.3, 0.02), (3.8, 0.4)]) {
            assert!((pole.at - Complex64::new(at, -wide)).norm() < ROUNDING, "{pole:?}");
            assert!((pole.residue - Complex64::new(0.0, wide)).norm() < ROUNDING, "{pole:?}");
        }
    }

    #[test]
    fn what_does_not_vary_stays() {
        let fit = Barycentric::fit(&[1.0, 2.0, 4.0], &[Complex64::I; 3], ROUNDING);
        assert!((fit.at(2.7) - Complex64::I).norm() < ROUNDING);
        let one = Barycentric::fit(&[1.0], &[Complex64::I], ROUNDING);
        assert_eq!(one.at(3.0), Complex64::I);
        assert!(one.poles().is_empty());
    }
}
