//! What `calibrate` answers: `diagnosis.json`.

use std::path::Path;

use metalith_core::{Result, WholeFile};
use serde::Serialize;
use serde_json::Value;

use crate::fidelity::Rung;
use crate::fit::{Fit, HeldOutErrors, mean_error};
use crate::search::{Evidence, Finding, RESIDUAL, Rejection, TriedEffect, UnusableCapture};
use crate::set::MeasuredSet;
use crate::simulator::Simulator;
use crate::simulator_model::separating_measurement;

/// The verdict on a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SetVerdict {
    /// The captures agree with what was stated, to within their noise.
    NoResidual,
    /// The effects that were found explain the residual.
    Explained,
    /// One of a few effects that this set cannot distinguish.
    OneOf,
    /// The effects that were found explain a part of the residual.
    Partly,
    /// There is a residual that no known effect explains.
    Unexplained,
    /// More than half of the captures cannot be used.
    DataUnfit,
}

/// An effect that was found.
#[derive(Clone, Debug, Serialize)]
pub struct FoundEffect {
    pub name: String,
    /// In `unit`; a list for an effect along two axes.
    pub value: Value,
    pub unit: String,
    /// 95 % interval; a list of them for an effect along two axes.
    pub interval: Value,
    pub confounded_with: Vec<String>,
    pub separate_by: Option<String>,
}

impl FoundEffect {
    /// Whether the interval of an effect with one value contains this value; none for an effect along two axes.
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
    pub placebo_held_out: f64,
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

/// A capture that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    pub capture: String,
    pub reason: String,
}

/// The answer for a set.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    pub set: String,
    pub verdict: SetVerdict,
    pub effects: Vec<FoundEffect>,
    pub error: ErrorReport,
    pub ranking: Vec<Ranked>,
    /// Candidates on top of each effect that was taken.
    pub later_rankings: Vec<Vec<Ranked>>,
    /// Share of the error above noise that is left.
    pub unexplained_share: f64,
    /// Share of missing pillars by their speckle, where the speckle counts as noise in the error after.
    pub missing_by_grain: Option<f64>,
    pub left_out: Vec<LeftOut>,
    /// Held-out error of each capture before and after.
    pub captures: Vec<CaptureError>,
    /// The three fidelities of the cell, nuisances fitted.
    pub ladder: Vec<Rung>,
}

/// The error of one capture when it was left out.
#[derive(Clone, Debug, Serialize)]
pub struct CaptureError {
    pub capture: String,
    pub before: Option<f64>,
    pub after: Option<f64>,
}

/// The measure of error.
const MEASURE: &str = "reduced chi-square per pixel";

/// A residual is explained if this reduced chi-square per pixel is left, or less.
const EXPLAINED: f64 = 1.2;

/// Or if this share of the error above noise is left, where the error was large; and the error that this share is
/// relative to at most.
const LEFT: f64 = 0.05;
const MUCH: f64 = 6.0;

/// If a larger share is left, the residual is unexplained.
const MOSTLY_LEFT: f64 = 0.4;

/// Least error above noise that shares are relative to, where there is none.
const LEAST_ABOVE_NOISE: f64 = 1e-9;

impl Diagnosis {
    /// From the evidence of a search.
    pub fn new(
        simulator: &Simulator<'_>,
        evidence: &Evidence,
        unusable: &[UnusableCapture],
        ladder: Vec<Rung>,
    ) -> Self {
        let (set, finding) = (simulator.bench.set(), &evidence.finding);
        let pixels = evidence.problem(simulator).pixels();
        let pair = |fit: &Fit, held: &HeldOutErrors| ErrorPair {
            fit: fit.chi2 / pixels,
            held_out: mean_error(held),
        };
        let error = ErrorReport {
            measure: MEASURE.into(),
            before: pair(&finding.before, &finding.held_before),
            after: pair(&finding.after, &finding.held_after),
            noise_floor: 1.0,
            placebo_held_out: finding.null_held_out,
        };
        let unexplained_share = unexplained_share(&error, finding);
        let verdict = verdict(&error, finding, unexplained_share);
        let ranked = |tried: &Vec<TriedEffect>| tried.iter().map(|t| Ranked::new(simulator, finding, t)).collect();
        let captures = set.captures.iter_enumerated().map(|(c, capture)| CaptureError {
            capture: capture.name.clone(),
            before: finding.held_before[c],
            after: finding.held_after[c],
        });
        Self {
            set: set.title.clone(),
            verdict,
            effects: found_effects(simulator, finding, verdict),
            error,
            ranking: ranked(&finding.ranking),
            later_rankings: finding.later.iter().map(ranked).collect(),
            unexplained_share,
            missing_by_grain: evidence.missing_by_speckle,
            left_out: left_out(set, unusable),
            captures: captures.collect(),
            ladder,
        }
    }

    /// Of a set most of whose captures cannot be used; `error` is that of the nuisances alone.
    pub fn data_unfit(set: &MeasuredSet, error: f64, unusable: &[UnusableCapture]) -> Self {
        let pair = ErrorPair {
            fit: error,
            held_out: error,
        };
        Self {
            set: set.title.clone(),
            verdict: SetVerdict::DataUnfit,
            effects: Vec::new(),
            error: ErrorReport {
                measure: MEASURE.into(),
                before: pair,
                after: pair,
                noise_floor: 1.0,
                placebo_held_out: error,
            },
            ranking: Vec::new(),
            later_rankings: Vec::new(),
            unexplained_share: 1.0,
            missing_by_grain: None,
            left_out: left_out(set, unusable),
            captures: Vec::new(),
            ladder: Vec::new(),
        }
    }

    /// Write it as `diagnosis.json`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self).expect("plain data serialises");
        text.push('\n');
        WholeFile::write(path, text.as_bytes())
    }

    /// One line for a person.
    pub fn sentence(&self) -> String {
        let one = |e: &FoundEffect| {
            let unit = if e.unit.is_empty() {
                String::new()
            } else {
                format!(" {}", e.unit)
            };
            format!(
                "{} = {}{unit}, interval {}",
                e.name,
                rounded(&e.value),
                rounded(&e.interval)
            )
        };
        let list: Vec<String> = self.effects.iter().map(one).collect();
        match self.verdict {
            SetVerdict::NoResidual => {
                "no residual: the captures agree with what was stated, to within their noise".into()
            }
            SetVerdict::Explained => format!("explained by {}", list.join("; ")),
            SetVerdict::OneOf => format!("one of these, which this set cannot distinguish: {}", list.join("; ")),
            SetVerdict::Partly => format!(
                "partly explained by {}; {:.0} % of the error above noise is left",
                list.join("; "),
                100.0 * self.unexplained_share
            ),
            SetVerdict::Unexplained => "unexplained: there is a residual that no known effect explains".into(),
            SetVerdict::DataUnfit => format!("data unfit: {} captures cannot be used", self.left_out.len()),
        }
    }
}

/// Share of the error above noise that the finding leaves.
fn unexplained_share(error: &ErrorReport, finding: &Finding) -> f64 {
    if error.before.held_out < RESIDUAL && finding.chosen.is_empty() {
        return 0.0;
    }
    let above = (error.before.held_out - 1.0).max(LEAST_ABOVE_NOISE);
    ((error.after.held_out - 1.0).max(0.0) / above).clamp(0.0, 1.0)
}

fn verdict(error: &ErrorReport, finding: &Finding, unexplained_share: f64) -> SetVerdict {
    if finding.chosen.is_empty() {
        return if error.before.held_out <= RESIDUAL {
            SetVerdict::NoResidual
        } else {
            SetVerdict::Unexplained
        };
    }
    let may_be_left = 1.0 + LEFT * (error.before.held_out - 1.0).min(MUCH);
    let fits = error.after.held_out <= EXPLAINED.max(may_be_left);
    let unambiguous = finding.alternatives.iter().all(Vec::is_empty);
    if !fits && unexplained_share > MOSTLY_LEFT {
        SetVerdict::Unexplained
    } else if !fits {
        SetVerdict::Partly
    } else if finding.chosen.len() == 1 && !unambiguous {
        SetVerdict::OneOf
    } else {
        SetVerdict::Explained
    }
}

/// What is claimed: the effects that were chosen, and their alternatives where the set cannot distinguish them.
fn found_effects(simulator: &Simulator<'_>, finding: &Finding, verdict: SetVerdict) -> Vec<FoundEffect> {
    let mut effects = Vec::new();
    if verdict == SetVerdict::Unexplained {
        return effects;
    }
    for (&effect, alternatives) in finding.chosen.iter().zip(&finding.alternatives) {
        let slots = simulator.slots_of(effect);
        let values: Vec<f64> = slots.iter().map(|&s| finding.after.theta[s]).collect();
        let widths = finding.after.pick(&slots, &finding.half_widths);
        let others: Vec<usize> = alternatives.iter().map(|a| a.effect).collect();
        effects.push(found(simulator, effect, &values, &widths, &others));
        if verdict == SetVerdict::OneOf {
            for a in alternatives {
                let rest = others.iter().copied().filter(|&o| o != a.effect);
                let rest: Vec<usize> = rest.chain([effect]).collect();
                effects.push(found(simulator, a.effect, &a.values, &a.half_widths, &rest));
            }
        }
    }
    effects
}

fn left_out(set: &MeasuredSet, unusable: &[UnusableCapture]) -> Vec<LeftOut> {
    let named = unusable.iter().map(|u| LeftOut {
        capture: set.captures[u.capture].name.clone(),
        reason: u.reason.clone(),
    });
    named.collect()
}

impl Ranked {
    fn new(simulator: &Simulator<'_>, finding: &Finding, tried: &TriedEffect) -> Self {
        let rejection = rejection(finding, tried);
        Self {
            name: simulator.effects[tried.effect].name(),
            score: tried.score,
            held_out_gain: tried.gain.map(|g| g.value),
            held_out_gain_interval: tried.gain.map(|g| g.interval),
            value: (!tried.values.is_empty()).then(|| listed(&reported(simulator, tried.effect, &tried.values))),
            rejected: rejection.map(Rejection::sentence),
            remark: rejection.map_or_else(|| "taken".into(), Rejection::remark),
        }
    }
}

/// Why a candidate was not taken, if it is not among what was found in the end.
fn rejection(finding: &Finding, tried: &TriedEffect) -> Option<Rejection> {
    tried.rejected.filter(|_| !finding.chosen.contains(&tried.effect))
}

/// Numbers of an effect as they are reported.
fn reported(simulator: &Simulator<'_>, effect: usize, values: &[f64]) -> Vec<f64> {
    let own = &simulator.effects[effect];
    let none = vec![0.0; values.len()];
    let all = own.reported(values, &none, simulator.bench.set());
    all.into_iter().map(|r| r.0).collect()
}

fn found(simulator: &Simulator<'_>, effect: usize, values: &[f64], widths: &[f64], others: &[usize]) -> FoundEffect {
    let own = &simulator.effects[effect];
    let (values, intervals): (Vec<f64>, Vec<[f64; 2]>) =
        own.reported(values, widths, simulator.bench.set()).into_iter().unzip();
    FoundEffect {
        name: own.name(),
        value: listed(&values),
        unit: own.unit().into(),
        interval: listed(&intervals),
        confounded_with: others.iter().map(|&o| simulator.effects[o].name()).collect(),
        separate_by: separating_measurement(simulator, effect, others),
    }
}

fn listed<T: Serialize>(values: &[T]) -> Value {
    match values {
        [one] => serde_json::json!(one),
        more => serde_json::json!(more),
    }
}

fn rounded(value: &Value) -> String {
    match value {
        Value::Array(items) => format!("[{}]", items.iter().map(rounded).collect::<Vec<_>>().join(", ")),
        Value::Number(n) => metalith_report::sig(n.as_f64().unwrap_or(f64::NAN), 4),
        other => other.to_string(),
    }
}
