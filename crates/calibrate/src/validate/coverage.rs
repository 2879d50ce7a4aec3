//! True if intervals are as wide as they should be: errors of what was claimed, in standard deviations of its interval.

use serde::Serialize;

use crate::diagnosis::FoundEffect;
use crate::interval_parts::WidthParts;
use crate::statistics::SIGMAS_95;
use metalith_report::sig;

/// A number that was claimed, beside the true one.
#[derive(Clone, Debug, Serialize)]
pub struct ClaimedNumber {
    pub effect: String,
    /// Number of the value of the effect, from zero.
    pub number: usize,
    /// Value that is reported, in the unit of the effect.
    pub truth: f64,
    pub found: f64,
    /// Ends of the 95 % interval.
    pub interval: [f64; 2],
    /// Error in standard deviations: half of the side of the interval that faces the truth is one.
    pub sigmas: f64,
    /// Parts of the half-width.
    pub made_of: WidthParts,
}

impl ClaimedNumber {
    /// The numbers of an effect that was found, beside the true ones; none if these are not as many.
    pub fn all(found: &FoundEffect, truth: &[f64]) -> Vec<Self> {
        let numbers = found.numbers();
        if numbers.len() != truth.len() {
            return Vec::new();
        }
        let pairs = numbers.into_iter().zip(truth).zip(&found.interval_from).enumerate();
        pairs
            .map(|(number, (((value, interval), &truth), &made_of))| {
                let side = if truth < value {
                    value - interval[0]
                } else {
                    interval[1] - value
                };
                Self {
                    effect: found.name.clone(),
                    number,
                    truth,
                    found: value,
                    interval,
                    sigmas: SIGMAS_95 * (value - truth) / side.max(f64::MIN_POSITIVE),
                    made_of,
                }
            })
            .collect()
    }

    /// True if the interval holds the truth.
    pub fn is_inside(&self) -> bool {
        (self.interval[0]..=self.interval[1]).contains(&self.truth)
    }
}

/// Quality of the intervals of some numbers.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Coverage {
    /// The effect; empty for all of them.
    pub effect: String,
    pub numbers: usize,
    /// Number of intervals that hold the truth.
    pub inside: usize,
    /// Root mean square of the errors in standard deviations: one where intervals are as wide as errors are, less where they are too
    /// wide.
    pub rms_sigmas: f64,
    /// Root mean square of the errors relative to the true numbers; zeros are left out.
    pub rms_relative: f64,
}

impl Coverage {
    /// Coverage of these numbers.
    pub fn of(effect: &str, numbers: &[&ClaimedNumber]) -> Self {
        let rms = |values: Vec<f64>| {
            let n = values.len().max(1) as f64;
            (values.iter().map(|v| v * v).sum::<f64>() / n).sqrt()
        };
        let relative = numbers.iter().filter(|c| c.truth != 0.0);
        Self {
            effect: effect.into(),
            numbers: numbers.len(),
            inside: numbers.iter().filter(|c| c.is_inside()).count(),
            rms_sigmas: rms(numbers.iter().map(|c| c.sigmas).collect()),
            rms_relative: rms(relative.map(|c| c.found / c.truth - 1.0).collect()),
        }
    }

    /// Coverage of each effect, in the order in which they appear.
    pub fn by_effect(numbers: &[&ClaimedNumber]) -> Vec<Self> {
        let mut names: Vec<&str> = Vec::new();
        for c in numbers {
            if !names.contains(&c.effect.as_str()) {
                names.push(&c.effect);
            }
        }
        let own = |name: &&str| {
            numbers
                .iter()
                .copied()
                .filter(|c| c.effect == *name)
                .collect::<Vec<_>>()
        };
        names.iter().map(|name| Self::of(name, &own(name))).collect()
    }

    /// Share of the intervals that hold the truth (percent).
    pub fn percent(&self) -> f64 {
        100.0 * self.inside as f64 / self.numbers.max(1) as f64
    }

    /// Coverage in words.
    pub fn sentence(&self) -> String {
        format!(
            "{} of {} intervals hold the true value ({} %, 95 promised); errors are {} of their standard deviations (rms, 1 if intervals are as wide as errors)",
            self.inside,
            self.numbers,
            sig(self.percent(), 3),
            sig(self.rms_sigmas, 2)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(value: serde_json::Value, interval: serde_json::Value) -> FoundEffect {
        let numbers = value.as_array().map_or(1, Vec::len);
        FoundEffect {
            name: "tilt".into(),
            interval_from: vec![WidthParts::default(); numbers],
            value,
            unit: "mrad".into(),
            interval,
            confounded_with: Vec::new(),
            separate_by: None,
        }
    }

    /// Two standard deviations on the side of the truth are one side of the interval.
    #[test]
    fn errors_are_counted_on_the_side_of_the_truth() {
        let one = found(serde_json::json!(3.0), serde_json::json!([2.0, 7.0]));
        let all = ClaimedNumber::all(&one, &[2.5]);
        assert_eq!((all[0].sigmas, all[0].is_inside()), (1.0, true));
        let all = ClaimedNumber::all(&one, &[9.0]);
        assert_eq!((all[0].sigmas, all[0].is_inside()), (-3.0, false));
        let two = found(
            serde_json::json!([3.0, -1.0]),
            serde_json::json!([[2.0, 4.0], [-2.0, 0.0]]),
        );
        let all = ClaimedNumber::all(&two, &[3.0, -2.0]);
        assert_eq!((all[0].sigmas, all[1].sigmas), (0.0, 2.0));
        assert!(ClaimedNumber::all(&two, &[3.0]).is_empty());
        let numbers: Vec<&ClaimedNumber> = all.iter().collect();
        let coverage = Coverage::of("tilt", &numbers);
        assert_eq!((coverage.numbers, coverage.inside), (2, 2));
        assert!((coverage.rms_sigmas - 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(coverage.rms_relative, (0.5f64 * 0.25).sqrt());
    }
}
