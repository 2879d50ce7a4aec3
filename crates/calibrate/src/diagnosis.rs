//! What `calibrate` answers: `diagnosis.json`.

use std::path::Path;

use ndarray::Array2;
use serde::Serialize;
use serde_json::Value;

use crate::fit::cross_validation::mean as mean_held_out;
use crate::fit::problem::{Fit, Problem};
use crate::search::attribution::Finding;
use crate::search::signatures::{names, separate_by};
use crate::search::stepwise::{RESIDUAL, Rejection, TriedEffect};
use crate::session::Session;
use metalith_core::{Result, WholeFile};

/// What a session comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SetVerdict {
    /// The set is what was stated, to within its noise.
    NoResidual,
    /// What was found explains it.
    Explained,
    /// One of a few effects that this set cannot tell apart.
    OneOf,
    /// What was found explains a part.
    Partly,
    /// There is something, and it has no name here.
    Unexplained,
    /// Too few captures can be used.
    DataUnfit,
}

/// One number that was found, or one for each of its axes.
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
    /// Whether the interval of an effect of one number holds a value.
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

/// One candidate.
#[derive(Clone, Debug, Serialize)]
pub struct Ranked {
    pub name: String,
    /// Share of the residual that its signature explains.
    pub score: f64,
    pub held_out_gain: Option<f64>,
    pub held_out_gain_interval: Option<[f64; 2]>,
    pub value: Option<Value>,
    pub rejected: Option<String>,
    /// The same in a few words.
    #[serde(skip)]
    pub remark: String,
}

/// A capture that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    pub capture: String,
    pub reason: String,
}

/// Everything that a program needs to know.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    pub set: String,
    pub verdict: SetVerdict,
    pub effects: Vec<FoundEffect>,
    pub error: ErrorReport,
    pub ranking: Vec<Ranked>,
    /// Candidates on top of each effect that was taken.
    pub later_rankings: Vec<Vec<Ranked>>,
    /// Share of the residual's energy above noise that is left.
    pub unexplained_share: f64,
    /// Share of missing pillars by the grain that they leave, where that was counted as noise in the error after.
    pub missing_by_grain: Option<f64>,
    pub left_out: Vec<LeftOut>,
    /// Held-out error of each capture before and after.
    pub captures: Vec<CaptureError>,
    /// Error of the three fidelities of the cell, the nuisances fitted.
    pub ladder: Vec<Rung>,
}

/// The error of one capture when it was left out.
#[derive(Clone, Debug, Serialize)]
pub struct CaptureError {
    pub capture: String,
    pub before: Option<f64>,
    pub after: Option<f64>,
}

/// One fidelity of the cell.
#[derive(Clone, Debug, Serialize)]
pub struct Rung {
    pub fidelity: String,
    pub fit: f64,
    pub held_out: f64,
    /// Residual of each capture [sigma], nuisances fitted; for pictures.
    #[serde(skip)]
    pub residuals: Vec<Array2<f32>>,
}

/// What is measured.
const MEASURE: &str = "chi-square a pixel";

/// What counts as explained may leave this of chi-square a pixel.
const EXPLAINED: f64 = 1.2;

/// Share of the residual's energy that may be left of what counts as explained, where much was there.
const LEFT: f64 = 0.05;

/// Share past which what was found is no explanation.
const MOSTLY_LEFT: f64 = 0.4;

impl Diagnosis {
    /// From what was found.
    pub fn new(session: &Session<'_>, finding: &Finding, left_out: Vec<LeftOut>, ladder: Vec<Rung>) -> Self {
        let simulator = &session.simulator;
        let pixels: f64 = (0..session.used.len())
            .filter(|&c| session.used[c])
            .map(|c| session.data.pixels(c) as f64)
            .sum();
        let pair = |fit: &Fit, held: f64| ErrorPair {
            fit: fit.chi2 / pixels,
            held_out: held,
        };
        let before = pair(&finding.before, mean_held_out(&finding.held_before));
        let after = pair(&finding.after, mean_held_out(&finding.held_after));
        let share = ((after.held_out - 1.0).max(0.0) / (before.held_out - 1.0).max(1e-9)).clamp(0.0, 1.0);
        let unexplained_share = if before.held_out < RESIDUAL && finding.chosen.is_empty() {
            0.0
        } else {
            share
        };
        let many_unfit = 2 * left_out.len() > session.used.len();
        let fits = after.held_out <= EXPLAINED.max(1.0 + LEFT * (before.held_out - 1.0).min(6.0));
        let alone = finding.alternatives.iter().all(Vec::is_empty);
        let verdict = if many_unfit {
            SetVerdict::DataUnfit
        } else if finding.chosen.is_empty() {
            if before.held_out <= RESIDUAL {
                SetVerdict::NoResidual
            } else {
                SetVerdict::Unexplained
            }
        } else if !fits && unexplained_share > MOSTLY_LEFT {
            SetVerdict::Unexplained
        } else if !fits {
            SetVerdict::Partly
        } else if finding.chosen.len() == 1 && !alone {
            SetVerdict::OneOf
        } else {
            SetVerdict::Explained
        };
        let mut effects = Vec::new();
        if !matches!(verdict, SetVerdict::DataUnfit | SetVerdict::Unexplained) {
            for (&effect, alternatives) in finding.chosen.iter().zip(&finding.alternatives) {
                let slots = simulator.slots_of(effect);
                let values: Vec<f64> = slots.iter().map(|&s| finding.after.theta[s]).collect();
                let widths = finding.after.pick(&slots, &finding.half_widths);
                let others: Vec<usize> = alternatives.iter().map(|a| a.effect).collect();
                effects.push(found(session, effect, &values, &widths, &others));
                if verdict == SetVerdict::OneOf {
                    for a in alternatives {
                        let rest: Vec<usize> = others
                            .iter()
                            .copied()
                            .filter(|&o| o != a.effect)
                            .chain([effect])
                            .collect();
                        effects.push(found(session, a.effect, &a.values, &a.half_widths, &rest));
                    }
                }
            }
        }
        let ranked = |tried: &Vec<TriedEffect>| tried.iter().map(|t| Ranked::new(session, finding, t)).collect();
        Self {
            set: session.set().title.clone(),
            verdict,
            effects,
            error: ErrorReport {
                measure: MEASURE.into(),
                before,
                after,
                noise_floor: 1.0,
                placebo_held_out: finding.placebo_held_out,
            },
            ranking: ranked(&finding.ranking),
            later_rankings: finding.later.iter().map(ranked).collect(),
            unexplained_share,
            missing_by_grain: finding.by_grain,
            left_out,
            captures: session
                .set()
                .captures
                .iter()
                .enumerate()
                .map(|(c, capture)| CaptureError {
                    capture: capture.name.clone(),
                    before: finding.held_before[c],
                    after: finding.held_after[c],
                })
                .collect(),
            ladder,
        }
    }

    /// Nothing can be said of a set that is mostly unfit.
    pub fn data_unfit(session: &Session<'_>, problem: &Problem<'_>, left_out: Vec<LeftOut>, fit: &Fit) -> Self {
        let error = fit.chi2 / problem.pixels().max(1.0);
        let pair = ErrorPair {
            fit: error,
            held_out: error,
        };
        Self {
            set: session.set().title.clone(),
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
            left_out,
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
            SetVerdict::NoResidual => "no residual: the captures are what was stated, to within their noise".into(),
            SetVerdict::Explained => format!("explained by {}", list.join("; ")),
            SetVerdict::OneOf => format!("one of, which this set cannot tell apart: {}", list.join("; ")),
            SetVerdict::Partly => format!(
                "partly explained by {}; {:.0} % of the residual is left",
                list.join("; "),
                100.0 * self.unexplained_share
            ),
            SetVerdict::Unexplained => "unexplained: there is a residual that no effect known here accounts for".into(),
            SetVerdict::DataUnfit => format!("data unfit: {} captures cannot be used", self.left_out.len()),
        }
    }
}

impl Ranked {
    fn new(session: &Session<'_>, finding: &Finding, tried: &TriedEffect) -> Self {
        let rejection = rejection(finding, tried);
        Self {
            name: session.simulator.effects[tried.effect].name(),
            score: tried.score,
            held_out_gain: tried.gain.map(|g| g.0),
            held_out_gain_interval: tried.gain.map(|g| g.1),
            value: (!tried.values.is_empty()).then(|| listed(&reported(session, tried.effect, &tried.values))),
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
fn reported(session: &Session<'_>, effect: usize, values: &[f64]) -> Vec<f64> {
    let own = &session.simulator.effects[effect];
    let none = vec![0.0; values.len()];
    let all = own.reported(values, &none, session.set());
    all.into_iter().map(|r| r.0).collect()
}

fn found(session: &Session<'_>, effect: usize, values: &[f64], widths: &[f64], others: &[usize]) -> FoundEffect {
    let simulator = &session.simulator;
    let own = &simulator.effects[effect];
    let (values, intervals): (Vec<f64>, Vec<[f64; 2]>) =
        own.reported(values, widths, session.set()).into_iter().unzip();
    FoundEffect {
        name: own.name(),
        value: listed(&values),
        unit: own.unit().into(),
        interval: listed(&intervals),
        confounded_with: names(simulator, others),
        separate_by: separate_by(simulator, effect, others),
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
