//! The answer for programs: `diagnosis.json`, in the shape that sets of point spread functions have.

use std::collections::BTreeSet;

use metalith_attribution::{Belonging, RefitErrors, RefitFinding, RefitModel, RefitPlan, RefitScope, SetVerdict};
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
    /// The whole bench, the kind of group that has separate values or whose values differ, or one group.
    pub of: String,
    /// Words on whether the values of groups agree within their intervals; none where each group has its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agreement: Option<String>,
    /// Groups that are predicted worse, when they are left out, than without the effect.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub worse_for: Vec<String>,
    /// Value in each group alone with all else as it was found, and its 95 % interval: one list for each parameter; empty if each
    /// group has its own.
    pub by_group: Vec<Vec<(String, f64, [f64; 2])>>,
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
    /// Root mean square that noise makes alone: by repeats, or by neighbours within a measurement; none where neither states it.
    pub noise_floor: Option<f64>,
    /// Root mean square by which the model errs; none where it is exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_error: Option<f64>,
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

/// The residual is explained up to this multiple of the noise.
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
    /// True if many measurements tell of an effect that is far below the difference of repeats.
    pub(crate) averages: bool,
    pub(crate) remarks: &'a [String],
}

impl ErrorReport {
    /// Verdict on a set without any effect, or with those that were found. Many measurements may show an effect that is far below
    /// their noise (`averages`).
    fn verdict(&self, nothing_found: bool, averages: bool) -> SetVerdict {
        let noise = EXPLAINED * self.noise_floor.unwrap_or(0.0);
        let noise_or_model = noise.hypot(self.model_error.unwrap_or(0.0));
        if self.before.fit <= noise_or_model && (nothing_found || !averages) {
            SetVerdict::NoResidual
        } else if nothing_found {
            SetVerdict::Unexplained
        } else if self.after.held_out <= noise {
            SetVerdict::Explained
        } else if self.after.held_out <= noise_or_model {
            SetVerdict::ExplainedButFor
        } else {
            SetVerdict::Partly
        }
    }

    /// What the effects leave of measurements that were left out, without the noise: in the unit of the measure, or in per cent.
    fn remainder(&self) -> String {
        let (all, noise) = (self.after.held_out, self.noise_floor.unwrap_or(0.0));
        let left = (all.powi(2) - noise.powi(2)).max(0.0).sqrt();
        match self
            .measure
            .split_once(" (")
            .map(|(_, unit)| unit.trim_end_matches(')'))
        {
            Some("rms") | None => format!("{} % (rms)", sig(100.0 * left, 3)),
            Some(unit) => format!("{} {unit}", sig(left, 3)),
        }
    }
}

impl Diagnosis {
    pub(crate) fn new(facts: &SetFacts<'_>, model: &dyn RefitModel, plan: &RefitPlan, found: &RefitFinding) -> Self {
        let (effects, parameters) = (model.effects(), model.parameters());
        let shown = |slot: usize, value: f64| (parameters[slot].shown)(value);
        let one_or_list = |list: Vec<Value>| match <[Value; 1]>::try_from(list) {
            Ok([one]) => one,
            Err(list) => Value::Array(list),
        };
        let objects = model.objects();
        let kind = plan.ways.get(objects).map_or("group", |way| way.name.as_str());
        let group_name = |group: usize| model.group_name(objects, group);
        let of_effect = |(place, &e): (usize, &usize)| {
            let own = &effects[e];
            let values = own.slots.iter().map(|&s| json!(shown(s, found.theta[s])));
            let intervals = own.slots.iter().map(|&s| match found.intervals[s] {
                Some(ends) => json!(ends.map(|v| shown(s, v))),
                None => Value::Null,
            });
            let (of, agreement) = match (model.scope(e), own.across) {
                (RefitScope::One { way, group }, _) => (model.group_name(way, group), None),
                (_, Some(way)) => (plan.ways[way].name.clone(), None),
                _ => {
                    let (of, words) = belonging_words(&found.belongings[place], kind, group_name);
                    (of, Some(words))
                }
            };
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
                        let named = groups.iter().map(|g| {
                            (
                                group_name(g.group),
                                shown(*slot, g.value),
                                g.interval.map(|v| shown(*slot, v)),
                            )
                        });
                        Some(named.collect())
                    })
                    .collect(),
                worse_for: found.worse[place].iter().map(|g| group_name(*g)).collect(),
                of,
                agreement,
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
        let error = ErrorReport {
            measure: facts.measure.into(),
            before: pair(first),
            after: pair(last),
            noise_floor: model.noise(&found.theta),
            model_error: Some(model.model_error(&found.theta)).filter(|e| *e > 0.0),
        };
        let verdict = error.verdict(found.chosen.is_empty(), facts.averages);
        let not_fitted = facts.names.iter().zip(&plan.fitted).filter(|(_, f)| !**f);
        let not_fitted: Vec<String> = not_fitted.map(|(n, _)| n.clone()).collect();
        let validation = validation(
            model,
            plan,
            (last, error.noise_floor),
            [facts.names.len(), not_fitted.len()],
        );
        Self {
            set: facts.title.into(),
            kind: facts.kind.into(),
            verdict,
            remarks: facts.remarks.to_vec(),
            effects: found.chosen.iter().enumerate().map(of_effect).collect(),
            error,
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
        let belongs = self.effects.iter().filter_map(FoundEffect::belongs);
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
        self.ladder.iter().map(line).chain(belongs).chain(proposed).collect()
    }

    /// One line for a person.
    pub fn sentence(&self) -> String {
        let list: Vec<String> = self.effects.iter().map(FoundEffect::sentence).collect();
        self.verdict.sentence(&list, &self.error.remainder())
    }
}

/// What was fitted, what was left out in turn, and what was never fitted: of so many measurements, so many.
fn validation(
    model: &dyn RefitModel,
    plan: &RefitPlan,
    (last, noise): (&RefitErrors, Option<f64>),
    [all, not_fitted]: [usize; 2],
) -> Vec<String> {
    let fitted = all - not_fitted;
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
    validation.push(match not_fitted {
        0 => "none was kept out of the fit: name some by `not_fitted`".into(),
        n => format!("{n} were never fitted; they refuse an effect that predicts them worse"),
    });
    if noise.is_none() {
        validation.push(
            "the noise is not known, because nothing was measured twice: a part that remains may be noise".into(),
        );
    }
    validation
}

/// Scope of an effect, and how the values of the groups of a kind compare.
fn belonging_words(belonging: &Belonging, kind: &str, name: impl Fn(usize) -> String) -> (String, String) {
    match belonging {
        Belonging::Bench => (
            "bench".into(),
            format!("the values of each {kind} agree within their intervals"),
        ),
        Belonging::Groups => (
            kind.into(),
            format!(
                "the values of each {kind} differ by more than their intervals: an effect of each {kind}, or an error of the model"
            ),
        ),
        Belonging::One(group) => {
            let own = format!("{kind} {}", name(*group));
            (own.clone(), format!("the intervals of all but {own} include no effect"))
        }
        Belonging::AllBut(group) => (
            "bench".into(),
            format!(
                "the values of each {kind} but {} agree within their intervals",
                name(*group)
            ),
        ),
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
    /// One line on what it belongs to; none where that is in its name.
    pub fn belongs(&self) -> Option<String> {
        let agreement = self.agreement.as_ref()?;
        let worse = match self.worse_for.as_slice() {
            [] => String::new(),
            worse => format!("; it predicts {} worse", worse.join(", ")),
        };
        Some(format!("{} is of the {}: {agreement}{worse}", self.name, self.of))
    }

    /// Values with their unit and intervals.
    pub fn sentence(&self) -> String {
        effect_words(&self.name, &self.value, &self.unit, &self.interval)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(before: f64, after: f64, noise: Option<f64>, model: f64, found: bool) -> SetVerdict {
        let pair = |error| ErrorPair {
            fit: error,
            held_out: error,
        };
        let report = ErrorReport {
            measure: "height (nm rms)".into(),
            before: pair(before),
            after: pair(after),
            noise_floor: noise,
            model_error: Some(model),
        };
        report.verdict(!found, true)
    }

    #[test]
    fn a_verdict_compares_what_is_left_with_noise_and_model() {
        let noise = Some(1.0);
        assert_eq!(verdict(1.4, 1.4, noise, 0.0, false), SetVerdict::NoResidual);
        assert_eq!(verdict(31.0, 1.03, noise, 0.0, true), SetVerdict::Explained);
        assert_eq!(verdict(31.0, 2.0, noise, 2.0, true), SetVerdict::ExplainedButFor);
        assert_eq!(verdict(31.0, 4.0, noise, 2.0, true), SetVerdict::Partly);
        assert_eq!(verdict(31.0, 4.0, None, 0.0, true), SetVerdict::Partly);
        assert_eq!(verdict(31.0, 31.0, noise, 2.0, false), SetVerdict::Unexplained);
    }
}
