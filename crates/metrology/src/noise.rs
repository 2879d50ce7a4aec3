//! White noise of one measurement, by second differences of its residual: robustly, so that edges which a model misses do not count.

use ndarray::Array2;

/// Standard deviation of a normal distribution over its median magnitude.
const OF_MEDIAN: f64 = 1.4826;

fn of_differences(mut magnitudes: Vec<f64>, gain: f64) -> f64 {
    if magnitudes.is_empty() {
        return 0.0;
    }
    let middle = magnitudes.len() / 2;
    OF_MEDIAN / gain * *magnitudes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Standard deviation of white noise on a line.
pub(crate) fn of_line(residual: &[f64]) -> f64 {
    let differences = residual.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs());
    // Weights 1, -2 and 1: noise of one has a variance of 6.
    of_differences(differences.collect(), 6.0_f64.sqrt())
}

/// Standard deviation of white noise on a map.
pub(crate) fn of_map(residual: &Array2<f64>) -> f64 {
    let differences = residual.windows((3, 3)).into_iter().map(|w| {
        let cross = w[(0, 1)] + w[(1, 0)] + w[(1, 2)] + w[(2, 1)];
        let corners = w[(0, 0)] + w[(0, 2)] + w[(2, 0)] + w[(2, 2)];
        (4.0 * w[(1, 1)] - 2.0 * cross + corners).abs()
    });
    // Weights 4, -2 and 1: noise of one has a variance of 36.
    of_differences(differences.collect(), 6.0)
}

/// Number of neighbouring points that err together: the sum of the autocorrelation up to its first zero.
pub(crate) fn correlated_points(residual: &[f64]) -> f64 {
    let product = |lag: usize| -> f64 { residual.iter().zip(&residual[lag..]).map(|(a, b)| a * b).sum() };
    let all = product(0).max(f64::MIN_POSITIVE);
    let lags = (1..residual.len()).map(|lag| product(lag) / all);
    1.0 + 2.0 * lags.take_while(|share| *share > 0.0).sum::<f64>()
}

/// Root of the mean square.
pub(crate) fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (sum / f64::max(n, 1.0)).sqrt()
}
