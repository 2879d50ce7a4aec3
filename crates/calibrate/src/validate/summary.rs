//! Summary of the trials: shares, confusions, detection limits.

use serde::Serialize;

use super::chips::NOTHING;
use super::{ClaimedNumber, Coverage, ValidationTrial};
use crate::statistics::LEAST_GAIN;
use metalith_attribution::SetVerdict;
use metalith_report::sig;

/// The column that a set without a claim counts in.
const UNEXPLAINED: &str = "unexplained";

/// Trials and their summary.
#[derive(Clone, Debug, Serialize)]
pub struct Validation {
    /// The measured set that the synthetic ones are like.
    pub like: String,
    /// Sets without effect that were judged, and how many of them an effect was claimed in.
    pub nulls: usize,
    pub false_claims: usize,
    /// Other sets without effect, which thresholds are compared with; the largest gain in them, and the least gain
    /// of a claim.
    pub threshold_nulls: usize,
    pub largest_gain_by_chance: f64,
    pub least_gain: f64,
    /// Names of the columns of `confusion`.
    pub claimed: Vec<String>,
    /// Rows for each truth: shares of its trials in which each column was claimed.
    pub confusion: Vec<(String, Vec<f64>)>,
    pub limits: Vec<DetectionLimit>,
    /// Sets with one listed effect or two, in how many of them all of these were named, and in how many something was claimed that
    /// is not there.
    pub with_effects: usize,
    pub with_effects_named: usize,
    pub with_effects_beside: usize,
    /// All numbers of effects that were named, and those of each effect.
    pub coverage: Coverage,
    pub coverage_by_effect: Vec<Coverage>,
    pub trials: Vec<ValidationTrial>,
}

/// The size from which on an effect is found.
#[derive(Clone, Debug, Serialize)]
pub struct DetectionLimit {
    pub name: String,
    /// The smallest size from which on it was named at all sizes (typical sizes); none if not at the largest.
    pub named_from: Option<f64>,
    /// Size at which the residual would reach the least gain of a claim (typical sizes): a residual grows with
    /// the square of the size, and is known at the smallest size tried.
    pub estimate: Option<f64>,
}

impl Validation {
    /// Summarise the trials.
    pub(super) fn new(like: String, thresholds: &[ValidationTrial], trials: Vec<ValidationTrial>) -> Self {
        let nulls: Vec<&ValidationTrial> = trials.iter().filter(|t| t.truth == NOTHING).collect();
        let mut truths: Vec<String> = Vec::new();
        for t in &trials {
            if !truths.contains(&t.truth) {
                truths.push(t.truth.clone());
            }
        }
        let mut claimed: Vec<String> = truths
            .iter()
            .filter(|t| *t != NOTHING && trials.iter().any(|o| o.truth == **t && !o.off_list && !o.pair))
            .cloned()
            .collect();
        for name in trials.iter().flat_map(|t| &t.found) {
            if !claimed.contains(name) {
                claimed.push(name.clone());
            }
        }
        claimed.extend([UNEXPLAINED.to_owned(), NOTHING.to_owned()]);
        let confusion = truths
            .iter()
            .map(|truth| {
                let own: Vec<&ValidationTrial> = trials.iter().filter(|t| t.truth == *truth).collect();
                let shares = claimed.iter().map(|column| {
                    let sum: f64 = own.iter().map(|t| t.share(column)).sum();
                    sum / own.len() as f64
                });
                (truth.clone(), shares.collect())
            })
            .collect();
        let limits = truths
            .iter()
            .filter(|t| *t != NOTHING && !trials.iter().any(|o| o.truth == **t && (o.off_list || o.pair)))
            .map(|name| DetectionLimit::new(name, &trials))
            .collect();
        let listed: Vec<&ValidationTrial> = trials.iter().filter(|t| t.truth != NOTHING && !t.off_list).collect();
        let numbers: Vec<&ClaimedNumber> = trials.iter().flat_map(|t| &t.numbers).collect();
        Self {
            like,
            nulls: nulls.len(),
            false_claims: nulls.iter().filter(|t| !t.found.is_empty()).count(),
            threshold_nulls: thresholds.len(),
            largest_gain_by_chance: thresholds.iter().map(|t| t.largest_gain).fold(0.0, f64::max),
            least_gain: LEAST_GAIN,
            claimed,
            confusion,
            limits,
            with_effects: listed.len(),
            with_effects_named: listed.iter().filter(|t| t.named).count(),
            with_effects_beside: listed.iter().filter(|t| !t.not_there.is_empty()).count(),
            coverage: Coverage::of("", &numbers),
            coverage_by_effect: Coverage::by_effect(&numbers),
            trials,
        }
    }

    /// Summary as text: shares, then one line for each trial.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{} false claims in {} sets without effect\n",
            self.false_claims, self.nulls
        );
        if self.threshold_nulls > 0 {
            text.push_str(&format!(
                "largest gain by chance in {} others {}, least gain of a claim {}\n",
                self.threshold_nulls,
                sig(self.largest_gain_by_chance, 2),
                self.least_gain
            ));
        }
        text.push_str(&format!(
            "{} of {} sets with effects: all of them named; {}: something beside them\n{}\n\n",
            self.with_effects_named,
            self.with_effects,
            self.with_effects_beside,
            self.coverage.sentence()
        ));
        for own in &self.coverage_by_effect {
            text.push_str(&format!(
                "{:29} {:3} of {:3} inside, rms {:5.2} standard deviations, {:.4} relative\n",
                own.effect, own.inside, own.numbers, own.rms_sigmas, own.rms_relative
            ));
        }
        text.push('\n');
        for t in self
            .trials
            .iter()
            .filter(|t| t.truth != NOTHING || !t.numbers.is_empty())
        {
            let inside = match t.numbers.iter().all(ClaimedNumber::is_inside) {
                _ if t.numbers.is_empty() => "",
                true => "inside",
                false => "OUTSIDE",
            };
            text.push_str(&format!(
                "{:29} x{:<4.2} {:12} {:40} {inside:8} {:10.4} -> {:.4}\n",
                t.truth,
                t.size,
                t.verdict_name(),
                t.found.join(", "),
                t.held_out_before,
                t.held_out_after
            ));
            for c in &t.numbers {
                text.push_str(&format!(
                    "{:34} {} = {}, truth {}, {} to {}, {:.2} standard deviations\n",
                    "",
                    c.effect,
                    sig(c.found, 5),
                    sig(c.truth, 5),
                    sig(c.interval[0], 5),
                    sig(c.interval[1], 5),
                    c.sigmas
                ));
            }
        }
        text
    }
}

impl ValidationTrial {
    /// The verdict as it is written in JSON.
    pub fn verdict_name(&self) -> String {
        let value = serde_json::to_value(self.verdict).ok();
        value.and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// Share of this trial that counts for a column: effects that cannot be distinguished share it.
    fn share(&self, column: &str) -> f64 {
        if self.found.is_empty() {
            let said = if self.verdict == SetVerdict::NoResidual {
                NOTHING
            } else {
                UNEXPLAINED
            };
            return f64::from(u8::from(said == column));
        }
        let hits = self.found.iter().filter(|f| *f == column).count();
        hits as f64 / self.found.len() as f64
    }
}

impl DetectionLimit {
    fn new(name: &str, trials: &[ValidationTrial]) -> Self {
        let mut own: Vec<&ValidationTrial> = trials.iter().filter(|t| t.truth == name).collect();
        own.sort_by(|a, b| a.size.abs().total_cmp(&b.size.abs()));
        let named_from = own.iter().rev().take_while(|t| t.named).last().map(|t| t.size.abs());
        let estimate = own.first().and_then(|t| {
            let above = t.held_out_before - 1.0;
            (above > LEAST_GAIN).then(|| t.size.abs() * (LEAST_GAIN / above).sqrt())
        });
        Self {
            name: name.into(),
            named_from,
            estimate,
        }
    }
}
