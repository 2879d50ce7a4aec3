//! Figures of a sample, with their standard errors.

use serde::Serialize;

/// Standard errors on each side of a value that its interval reaches: of a normal distribution it holds 99.7 %.
const ERRORS_OF_INTERVAL: f64 = 3.0;

/// Figure of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    /// Standard error of the value, from the spread between the parts of the sample.
    pub standard_error: f64,
}

impl Estimate {
    /// Estimate by the figure of the whole sample and those of the sample without each of its parts (jackknife): the square of a
    /// mean is too large by the variance of the mean, which this removes.
    pub(super) fn jackknife(whole: f64, without: &[f64]) -> Self {
        let parts = without.len() as f64;
        let mean = without.iter().sum::<f64>() / parts;
        let squares = without.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        Self {
            value: parts * whole - (parts - 1.0) * mean,
            standard_error: ((parts - 1.0) / parts * squares).sqrt(),
        }
    }

    /// Estimate of a root mean square by those of parts of one size.
    pub(super) fn rms(parts: &[f64]) -> Self {
        let root = |without: Option<usize>| {
            let kept = parts.iter().enumerate().filter(|(k, _)| Some(*k) != without);
            let squares: Vec<f64> = kept.map(|(_, rms)| rms * rms).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        let without: Vec<f64> = (0..parts.len()).map(|k| root(Some(k))).collect();
        Self::jackknife(root(None), &without)
    }

    /// The lower end of its interval.
    pub fn least(&self) -> f64 {
        self.value - ERRORS_OF_INTERVAL * self.standard_error
    }

    /// The upper end of its interval.
    pub fn most(&self) -> f64 {
        self.value + ERRORS_OF_INTERVAL * self.standard_error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of a few numbers near one, in double precision.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn the_jackknife_of_a_mean_is_its_standard_error_and_of_its_square_has_no_bias() {
        let values = [1.0, 4.0, 2.0, 7.0, 3.5];
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let without: Vec<f64> = values.iter().map(|v| (n * mean - v) / (n - 1.0)).collect();
        let found = Estimate::jackknife(mean, &without);
        assert!((found.value - mean).abs() < ROUNDING);
        assert!((found.standard_error - (variance / n).sqrt()).abs() < ROUNDING);
        let squares: Vec<f64> = without.iter().map(|m| m * m).collect();
        let found = Estimate::jackknife(mean * mean, &squares);
        assert!((found.value - (mean * mean - variance / n)).abs() < ROUNDING);
    }

    #[test]
    fn the_root_mean_square_of_equal_parts_is_exact() {
        let found = Estimate::rms(&[0.3; 4]);
        assert!((found.value - 0.3).abs() < ROUNDING && found.standard_error < ROUNDING);
        assert!(Estimate::rms(&[f64::NAN; 4]).value.is_nan());
    }
}
