//! The answer for programs: `diagnosis.json`, in the shape that sets of point spread functions have.

use std::collections::BTreeSet;

use metalith_attribution::{RefitErrors, RefitFinding, RefitModel, RefitPlan, RefitScope, SetVerdict};
use metalith_report::{effect_words, sig};
use serde::Serialize;
use serde_json::{Value, json};

use crate::proposal::Proposal;

/// An effect that was found.
#[derive(Clone, Debug, Serialize)]
pub struct FoundEffect {
    pub name: String,
    /// A number, or a list of them with `parameters` for their names.
    pub value: Value,
    pub unit: String,
    /// 95 % interval of each value.
    pub interval: Value,
    pub parameters: Vec<String>,
    /// The whole bench, or the kind of group that has separate values.
    pub of: String,
    /// Value in each group alone with all else as it was found: one list for each parameter; empty if each group has its own.
    pub by_group: Vec<Vec<(String, f64)>>,
}

/// An effect as it was tried last.
#[derive(Clone, Debug, Serialize)]
pub struct Ranked {
    pub name: String,
    /// Share of the fitted mean square that it removes.
    pub score: f64,
    pub held_out_gain: f64,
    pub held_out_gain_interval: [f64; 2],
    pub value: Value,
    pub rejected: Option<String>,
}

/// Errors with some effects.
#[derive(Clone, Debug, Serialize)]
pub struct LadderStep {
    /// Effect that was added last; none before any.
    pub effect: Option<String>,
    /// Why it was not taken; none if it was.
    pub rejected: Option<String>,
    /// Root mean square of what was fitted.
    pub fit: f64,
    /// Root mean square of what was left out, by the way of leaving out.
    pub held_out: Vec<(String, Option<f64>)>,
    /// Figures of merit of what was fitted, by name.
    pub fitted_figures: Vec<(String, f64)>,
    /// Figures of merit of measurements that were not fitted, by name.
    pub not_fitted_figures: Vec<(String, f64)>,
}

/// Error before and after.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ErrorPair {
    pub fit: f64,
    pub held_out: f64,
}

/// Errors of a set.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorReport {
    pub measure: String,
    pub before: ErrorPair,
    pub after: ErrorPair,
    /// Root mean square by which repeats differ; none where there are none.
    pub noise_floor: Option<f64>,
}

/// The answer for a set.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    pub set: String,
    pub kind: String,
    pub verdict: SetVerdict,
    /// What was found in the files before any fit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    pub effects: Vec<FoundEffect>,
    pub error: ErrorReport,
    pub ranking: Vec<Ranked>,
    pub ladder: Vec<LadderStep>,
    /// Patterns that explain a part of what effects leave, those first that predict most.
    pub proposals: Vec<Proposal>,
    /// What was fitted, what was left out in turn, and what was never fitted.
    pub validation: Vec<String>,
    /// Measurements that were never fitted.
    pub not_fitted: Vec<String>,
    /// Effects that `model.toml` does not hold.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_in_model: Vec<NotInModel>,
}

/// An effect that `model.toml` does not hold.
#[derive(Clone, Debug, Serialize)]
pub struct NotInModel {
    pub effect: String,
    pub why: String,
}

/// The residual is explained up to this multiple of the difference of repeats.
const EXPLAINED: f64 = 1.5;

/// Most groups that a line names.
const MOST_NAMED: usize = 12;

/// What a set says of itself.
pub(crate) struct SetFacts<'a> {
    pub(crate) title: &'a str,
    pub(crate) kind: &'a str,
    pub(crate) measure: &'a str,
    /// Names of the measurements.
    pub(crate) names: Vec<String>,
    pub(crate) noise_floor: Option<f64>,
    /// True if many measurements tell of an effect that is far below the difference of repeats.
    pub(crate) averages: bool,
    pub(crate) remarks: &'a [String],
}

impl Diagnosis {
    pub(crate) fn new(facts: &SetFacts<'_>, model: &dyn RefitModel, plan: &RefitPlan, found: &RefitFinding) -> Self {
        let (effects, parameters) = (model.effects(), model.parameters());
        let shown = |slot: usize, value: f64| (parameters[slot].shown)(value);
        let one_or_list = |list: Vec<Value>| match <[Value; 1]>::try_from(list) {
            Ok([one]) => one,
            Err(list) => Value::Array(list),
        };
        let of_effect = |&e: &usize| {
            let own = &effects[e];
            let values = own.slots.iter().map(|&s| json!(shown(s, found.theta[s])));
            let intervals = own.slots.iter().map(|&s| match found.intervals[s] {
                Some(ends) => json!(ends.map(|v| shown(s, v))),
                None => Value::Null,
            });
            FoundEffect {
                name: own.name.clone(),
                value: one_or_list(values.collect()),
                unit: unit(&own.slots.iter().map(|&s| parameters[s].unit).collect::<Vec<_>>()),
                interval: one_or_list(intervals.collect()),
                parameters: own.slots.iter().map(|&s| parameters[s].name.clone()).collect(),
                by_group: own
                    .slots
                    .iter()
                    .filter_map(|slot| {
                        let (_, groups) = found.by_group.iter().find(|(s, _)| s == slot)?;
                        let named = groups.iter().map(|(g, v)| (model.group_name(0, *g), shown(*slot, *v)));
                        Some(named.collect())
                    })
                    .collect(),
                of: match (model.scope(e), own.across) {
                    (RefitScope::One { way, group }, _) => model.group_name(way, group),
                    (_, across) => across.map_or_else(|| "bench".into(), |w| plan.ways[w].name.clone()),
                },
            }
        };
        let names = model.figure_names();
        let step = |effect: Option<usize>, errors: &RefitErrors, rejected: Option<String>| {
            let figures = |k: usize| -> Vec<(String, f64)> {
                let own = errors.figures[k].iter().zip(&names);
                own.map(|(v, (name, unit))| (format!("{name} {unit}").trim().to_owned(), *v))
                    .collect()
            };
            LadderStep {
                effect: effect.map(|e| effects[e].name.clone()),
                rejected,
                fit: errors.fitted,
                held_out: plan
                    .ways
                    .iter()
                    .zip(&errors.held_out)
                    .map(|(w, v)| (w.name.clone(), *v))
                    .collect(),
                fitted_figures: figures(0),
                not_fitted_figures: figures(1),
            }
        };
        let mut ladder = vec![step(None, &found.ladder[0], None)];
        ladder.extend(
            found
                .chosen
                .iter()
                .zip(&found.ladder[1..])
                .map(|(&e, errors)| step(Some(e), errors, None)),
        );
        ladder.extend(found.tried.iter().filter_map(|t| {
            let rejected = t.rejected.as_ref()?;
            (t.score > 0.0).then(|| step(Some(t.effect), &t.errors, Some(rejected.sentence())))
        }));
        let (first, last) = (&found.ladder[0], &found.ladder[found.ladder.len() - 1]);
        let judging = judging(model, plan, found);
        let pair = |errors: &RefitErrors| ErrorPair {
            fit: errors.fitted,
            held_out: { judging.iter().filter_map(|&w| errors.held_out[w]) }.fold(0.0, f64::max),
        };
        let verdict = match (found.chosen.is_empty(), facts.noise_floor) {
            (none, Some(floor)) if first.fitted <= EXPLAINED * floor && (none || !facts.averages) => {
                SetVerdict::NoResidual
            }
            (true, _) => SetVerdict::Unexplained,
            (_, Some(floor)) if pair(last).held_out <= EXPLAINED * floor => SetVerdict::Explained,
            _ => SetVerdict::Partly,
        };
        let not_fitted = facts.names.iter().zip(&plan.fitted).filter(|(_, f)| !**f);
        let not_fitted: Vec<String> = not_fitted.map(|(n, _)| n.clone()).collect();
        let fitted = facts.names.len() - not_fitted.len();
        let mut validation = vec![format!("{fitted} measurements were fitted")];
        // Groups of a way among measurements that were fitted, or that were not.
        let groups = |way: usize, fitted: bool| {
            let own = plan.ways[way].groups.iter().zip(&plan.fitted);
            let own: BTreeSet<usize> = own.filter(|(_, f)| **f == fitted).map(|(g, _)| *g).collect();
            own
        };
        let named = |way: usize, own: &BTreeSet<usize>| {
            let names: Vec<String> = own.iter().take(MOST_NAMED).map(|g| model.group_name(way, *g)).collect();
            let more = if own.len() > MOST_NAMED { ", ..." } else { "" };
            format!("{}{more}", names.join(", "))
        };
        for (w, (way, error)) in plan.ways.iter().zip(&last.held_out).enumerate() {
            let (own, others) = (groups(w, true), groups(w, false));
            validation.push(match error {
                Some(_) => format!("each {} was left out in turn: {}", way.name, named(w, &own)),
                None => format!(
                    "only one {} was fitted, so none was left out: {}",
                    way.name,
                    named(w, &own)
                ),
            });
            let new: BTreeSet<usize> = others.difference(&own).copied().collect();
            if !new.is_empty() {
                validation.push(format!("never fitted, {}: {}", way.name, named(w, &new)));
            }
        }
        validation.push(match not_fitted.len() {
            0 => "none was kept out of the fit: name some by `not_fitted`".into(),
            n => format!("{n} were never fitted; they refuse an effect that predicts them worse"),
        });
        Self {
            set: facts.title.into(),
            kind: facts.kind.into(),
            verdict,
            remarks: facts.remarks.to_vec(),
            effects: found.chosen.iter().map(of_effect).collect(),
            error: ErrorReport {
                measure: facts.measure.into(),
                before: pair(first),
                after: pair(last),
                noise_floor: facts.noise_floor,
            },
            ranking: found
                .tried
                .iter()
                .map(|t| Ranked {
                    name: effects[t.effect].name.clone(),
                    score: t.score,
                    held_out_gain: t.gain.value,
                    held_out_gain_interval: t.gain.interval,
                    value: {
                        let slots = effects[t.effect].slots.iter().zip(&t.values);
                        one_or_list(slots.map(|(&s, v)| json!(shown(s, *v))).collect())
                    },
                    rejected: t.rejected.as_ref().map(|r| r.sentence()),
                })
                .collect(),
            ladder,
            proposals: Vec::new(),
            validation,
            not_fitted,
            not_in_model: Vec::new(),
        }
    }

    /// Errors before and after each effect, and why others were refused, line by line.
    pub fn ladder_lines(&self) -> Vec<String> {
        let line = |step: &LadderStep| {
            let name = step
                .effect
                .as_ref()
                .map_or_else(|| "as stated".into(), |e| format!("+ {e}"));
            let left = step
                .held_out
                .iter()
                .filter_map(|(way, v)| Some(format!("each {way} left out {}", sig((*v)?, 4))));
            let judged = step
                .not_fitted_figures
                .iter()
                .map(|(name, v)| format!("{name} {}", sig(*v, 4)));
            let mut parts = vec![format!("fitted {}", sig(step.fit, 4))];
            parts.extend(left);
            let judged: Vec<String> = judged.collect();
            if !judged.is_empty() {
                parts.push(format!("not fitted: {}", judged.join("; ")));
            }
            match &step.rejected {
                None => format!("{name}: {}", parts.join(", ")),
                Some(why) => format!("refused {}: {why}", name.trim_start_matches("+ ")),
            }
        };
        let proposed = self.proposals.iter().map(Proposal::sentence);
        self.ladder.iter().map(line).chain(proposed).collect()
    }

    /// One line for a person.
    pub fn sentence(&self) -> String {
        let list: Vec<String> = self.effects.iter().map(FoundEffect::sentence).collect();
        let unit = self
            .error
            .measure
            .split_once(" (")
            .map_or("", |(_, unit)| unit.trim_end_matches(')'));
        let remainder = format!("{} {unit}", sig(self.error.after.held_out, 3));
        self.verdict.sentence(&list, &remainder)
    }
}

/// Ways of leaving out that judge what was found: no group predicts an effect of another group.
fn judging(model: &dyn RefitModel, plan: &RefitPlan, found: &RefitFinding) -> Vec<usize> {
    let of_a_group = |w: usize| {
        let own = |&e: &usize| matches!(model.scope(e), RefitScope::One { way, .. } if way == w);
        found.chosen.iter().any(own)
    };
    (0..plan.ways.len()).filter(|&w| !of_a_group(w)).collect()
}

/// Unit of the values of an effect: one of each where they differ, 1 for a number.
fn unit(units: &[&str]) -> String {
    if units.iter().all(|unit| *unit == units[0]) {
        return units[0].to_owned();
    }
    let each = units.iter().map(|unit| if unit.is_empty() { "1" } else { unit });
    format!("({})", each.collect::<Vec<_>>().join(", "))
}

impl FoundEffect {
    /// Values with their unit and intervals.
    pub fn sentence(&self) -> String {
        effect_words(&self.name, &self.value, &self.unit, &self.interval)
    }
}
