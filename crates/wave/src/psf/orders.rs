//! Order efficiencies of a mapping from its own transmission, before any propagation.

use num_complex::Complex64;

/// Shares of light in diffraction orders of a mapping, where the phase it is asked for runs evenly through a turn.
///
/// `transmission[i]` is what the mapping sets where the target phase is (i + 1/2) / len turns. The share of order m is
/// |c_m|^2 / full^2 with c_m the mean of t(u) exp(-2 pi i m u): order one is the designed one, order zero passes
/// undiffracted, and what is missing from one is reflected or leaves in other orders.
pub fn order_shares(transmission: &[Complex64], full_transmission: f64, orders: &[i32]) -> Vec<f64> {
    let n = transmission.len() as f64;
    let share = |&m: &i32| {
        let wave = |i: usize| Complex64::cis(-std::f64::consts::TAU * f64::from(m) * (i as f64 + 0.5) / n);
        let sum: Complex64 = transmission.iter().enumerate().map(|(i, t)| t * wave(i)).sum();
        (sum / (n * full_transmission)).norm_sqr()
    };
    orders.iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_perfect_mapping_has_one_order_and_a_scaled_one_follows_sinc() {
        // Of sums over 4096 samples, and of the midpoint rule over them, 1 / 24 (2 pi m / n)^2.
        const ROUNDING: f64 = 1e-12;
        const MIDPOINTS: f64 = 1e-6;
        let n = 4096;
        let ramp = |scale: f64| -> Vec<Complex64> {
            (0..n)
                .map(|i| 1.2 * Complex64::cis(TAU * scale * (f64::from(i) + 0.5) / f64::from(n)))
                .collect()
        };
        let perfect = order_shares(&ramp(1.0), 1.2, &[0, 1, 2]);
        assert!(perfect[0] < ROUNDING && (perfect[1] - 1.0).abs() < ROUNDING && perfect[2] < ROUNDING);
        // A blaze that reaches a fraction s of a turn puts sinc^2(m - s) into order m.
        for (share, m) in order_shares(&ramp(0.7), 1.2, &[0, 1, 2]).iter().zip([0.0, 1.0, 2.0]) {
            let x = std::f64::consts::PI * (m - 0.7);
            assert!((share - (x.sin() / x).powi(2)).abs() < MIDPOINTS);
        }
    }
}
