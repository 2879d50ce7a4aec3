//! Diagnosis of `calibrate`: `diagnosis.json`.

mod assemble;
mod pattern;

use std::path::Path;

use metalith_attribution::SetVerdict;
use metalith_core::Result;
use metalith_report::{counted, sig};
use serde::Serialize;
use serde_json::Value;

pub use pattern::{FreePattern, GroupValue, PatternTrend, Slope};

use crate::fidelity::FidelityError;
use crate::interval_parts::WidthParts;

/// An effect that was found.
#[derive(Clone, Debug, Serialize)]
pub struct FoundEffect {
    pub name: String,
    /// Value in `unit`; a list for an effect along two axes.
    pub value: Value,
    pub unit: String,
    /// 95 % interval; a list of them for an effect along two axes.
    pub interval: Value,
    /// Parts of the half-width of each value.
    pub interval_from: Vec<WidthParts>,
    pub confounded_with: Vec<String>,
    pub separate_by: Option<String>,
}

impl FoundEffect {
    /// Values, each with the ends of its interval.
    pub fn numbers(&self) -> Vec<(f64, [f64; 2])> {
        let pair = |value: &Value, interval: &Value| {
            let ends = interval.as_array()?;
            Some((value.as_f64()?, [ends.first()?.as_f64()?, ends.get(1)?.as_f64()?]))
        };
        let (Value::Array(values), Value::Array(intervals)) = (&self.value, &self.interval) else {
            return pair(&self.value, &self.interval).into_iter().collect();
        };
        values.iter().zip(intervals).filter_map(|(v, i)| pair(v, i)).collect()
    }

    /// True if the interval of an effect with one value contains this value; none for an effect along two axes.
    pub fn holds(&self, value: f64) -> Option<bool> {
        let ends = self.interval.as_array()?;
        Some((ends.first()?.as_f64()?..=ends.get(1)?.as_f64()?).contains(&value))
    }
}

/// Fit and held-out error.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ErrorPair {
    pub fit: f64,
    pub held_out: f64,
}

/// The error before and after.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorReport {
    pub measure: String,
    pub before: ErrorPair,
    pub after: ErrorPair,
    pub noise_floor: f64,
    pub null_test_held_out: f64,
}

/// A candidate that was tried.
#[derive(Clone, Debug, Serialize)]
pub struct Ranked {
    pub name: String,
    /// Share of the residual that its signature alone explains, nuisances projected out.
    pub score: f64,
    pub held_out_gain: Option<f64>,
    pub held_out_gain_interval: Option<[f64; 2]>,
    pub value: Option<Value>,
    pub rejected: Option<String>,
    /// The reason for the rejection in a few words.
    #[serde(skip)]
    pub remark: String,
}

/// A measurement that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    pub measurement: String,
    pub reason: String,
}

/// Part of the images that effects do not explain.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Remainder {
    /// Root mean square above noise, over that of the images (%).
    pub percent: f64,
    /// The same of the error of the model (%).
    pub model_error_percent: f64,
}

/// The answer for a set.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    pub set: String,
    pub verdict: SetVerdict,
    pub effects: Vec<FoundEffect>,
    /// Properties of them that these measurements cannot determine, besides other effects.
    pub remarks: Vec<String>,
    /// Number of simulations after which the search was stopped; none where it ended before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped_after: Option<u64>,
    pub error: ErrorReport,
    pub ranking: Vec<Ranked>,
    /// Candidates on top of each effect that was taken.
    pub later_rankings: Vec<Vec<Ranked>>,
    /// Quantities that explain most of the residual if they differ by element, colour, distance or angle; best first.
    pub patterns: Vec<FreePattern>,
    /// Effects that are proposed for the residual; none where nothing stands out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proposal: Option<Proposal>,
    /// Share of the error above noise that is left.
    pub unexplained_share: f64,
    /// What the effects leave, if they explain the rest; none with another verdict.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remainder: Option<Remainder>,
    /// Share of missing pillars by their speckle, where the speckle counts as noise in the error after.
    pub missing_by_speckle: Option<f64>,
    pub left_out: Vec<LeftOut>,
    /// Mistakes of frames that were recognised before anything was fitted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Held-out error of each measurement before and after.
    pub measurements: Vec<MeasurementError>,
    /// The three fidelities of the cell, nuisances fitted.
    pub ladder: Vec<FidelityError>,
}

/// Effects for what no effect of the list explains, in a file that can be declared.
#[derive(Clone, Debug, Serialize)]
pub struct Proposal {
    /// The file.
    pub file: String,
    /// Names of the effects in it.
    pub effects: Vec<String>,
    /// Evidence of each, with its name.
    pub reasons: Vec<String>,
    /// The error on measurements left out without them, where they were tried.
    pub held_out_without: Option<f64>,
}

impl Proposal {
    /// One line for a person.
    pub fn sentence(&self, diagnosis: &Diagnosis) -> String {
        let names = self.effects.join(", ");
        let Some(without) = self.held_out_without else {
            return format!(
                "proposed for the residual: {names} in {}; --adopt tries them, --declare with an edited copy as well",
                self.file
            );
        };
        let taken: Vec<&str> = diagnosis
            .effects
            .iter()
            .map(|e| e.name.as_str())
            .filter(|name| self.effects.iter().any(|own| own == name))
            .collect();
        let [without, with] = [without, diagnosis.error.after.held_out].map(|error| sig(error, 4));
        if taken.is_empty() {
            format!("proposed for the residual, tried and not taken: {names}")
        } else {
            format!(
                "adopted: {}; error on measurements left out {without} without, {with} with",
                taken.join(", ")
            )
        }
    }
}

/// The error of one measurement when it was left out.
#[derive(Clone, Debug, Serialize)]
pub struct MeasurementError {
    pub measurement: String,
    pub before: Option<f64>,
    pub after: Option<f64>,
}

impl Diagnosis {
    /// Write it as `diagnosis.json`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        metalith_report::write_plain_json(path, self)
    }

    /// One line for a person.
    pub fn sentence(&self) -> String {
        let found = self.found();
        match self.stopped_after {
            Some(simulations) => {
                format!(
                    "{found}; the search was stopped after {simulations} simulations, and this is the best finding so far"
                )
            }
            None => found,
        }
    }

    /// The finding in one line.
    fn found(&self) -> String {
        let one = |e: &FoundEffect| metalith_report::effect_words(&e.name, &e.value, &e.unit, &e.interval);
        let list: Vec<String> = self.effects.iter().map(one).collect();
        let remainder = match self.remainder {
            Some(remainder) => format!("{} % of the images (rms)", sig(remainder.percent, 2)),
            None => format!("{} % of the error above noise", sig(100.0 * self.unexplained_share, 2)),
        };
        match self.verdict {
            SetVerdict::DataUnfit if self.left_out.is_empty() => {
                "data unfit: one measurement alone leaves nothing to judge a finding by; take others, of another colour, element or distance".into()
            }
            SetVerdict::DataUnfit => format!(
                "data unfit: {} cannot be used",
                counted(self.left_out.len(), "measurement")
            ),
            verdict => verdict.sentence(&list, &remainder),
        }
    }
}
