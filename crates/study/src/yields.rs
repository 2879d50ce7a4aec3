//! Shares of draws that hold a limit, with their uncertainty.

use serde::Serialize;

/// Share of chips that hold a limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Yield {
    /// Key of the limit; `all` for all of them.
    pub key: String,
    pub held: u64,
    pub of: u64,
    pub share: f64,
    /// Wilson's interval of 95 %.
    pub interval: [f64; 2],
}

impl Yield {
    /// Yield of a count.
    pub fn of(key: String, held: u64, of: u64) -> Self {
        Self {
            key,
            held,
            of,
            share: held as f64 / of.max(1) as f64,
            interval: wilson(held, of),
        }
    }
}

/// Quantile of the normal distribution for two-sided 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// Wilson's score interval of 95 % for a share of which `held` of `of` draws were seen (E. B. Wilson, J. Am. Stat.
/// Assoc. 22, 209, 1927): unlike the mean with its standard error, it keeps its promise near 0 and 1.
pub fn wilson(held: u64, of: u64) -> [f64; 2] {
    if of == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (of as f64, held as f64 / of as f64);
    let middle = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    // Ends that are whole are so but for rounding, and a person would read 6e-16.
    let low = if held == 0 { 0.0 } else { (middle - half) / scale };
    let high = if held == of { 1.0 } else { (middle + half) / scale };
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the closed form by hand: sums of a few numbers of size one.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn intervals_are_those_of_the_score_test() {
        for (held, of) in [(0, 10), (5, 10), (81, 100), (1000, 1000)] {
            let [low, high] = wilson(held, of);
            let p = held as f64 / of as f64;
            // At either end the score of the seen share is exactly the quantile, or the end is that of the range.
            for end in [low, high] {
                let score = (p - end).powi(2) * of as f64 - Z * Z * end * (1.0 - end);
                assert!(score.abs() < ROUNDING * of as f64, "{held} of {of}: {end}");
            }
            assert!(low <= p && p <= high);
        }
    }
}
