//! Diagnosis from the evidence of a search.

use std::collections::BTreeSet;

use metalith_attribution::SetVerdict;
use serde::Serialize;
use serde_json::Value;

use super::pattern::{untold_colours, untold_tilt};
use super::{
    Diagnosis, ErrorPair, ErrorReport, FoundEffect, FreePattern, LeftOut, MeasurementError, Ranked, Remainder,
};
use crate::cell_error::CellError;
use crate::effects::Effect;
use crate::fidelity::FidelityError;
use crate::interval_parts::WidthParts;
use crate::screening::UnusableMeasurement;
use crate::set::MeasuredSet;
use crate::simulator::Simulator;
use crate::simulator_model::separating_measurement;
use crate::statistics::{
    EXPLAINED, Evidence, Finding, Fit, HeldOutErrors, IntervalParts, Rejection, TriedEffect, error_of_measurement,
    may_leave, mean_error,
};

/// The measure of error.
const MEASURE: &str = "reduced chi-square per pixel";

/// If a larger share is left, the residual is unexplained.
const MOSTLY_LEFT: f64 = 0.4;

/// Up to this share the effects that were found are the cause: another effect would be a hundred times weaker.
const HARDLY_LEFT: f64 = 0.01;

/// Least error above noise that shares are relative to, where there is none.
const LEAST_ABOVE_NOISE: f64 = 1e-9;

impl Diagnosis {
    /// Diagnosis from the evidence of a search.
    pub fn new(
        simulator: &Simulator<'_>,
        evidence: &Evidence,
        unusable: &[UnusableMeasurement],
        ladder: Vec<FidelityError>,
    ) -> Self {
        let (set, finding) = (simulator.bench.set(), &evidence.finding);
        let pixels = evidence.problem(simulator).points();
        let pair = |fit: &Fit, held: &HeldOutErrors| ErrorPair {
            fit: fit.chi2 / pixels,
            held_out: mean_error(held),
        };
        let error = ErrorReport {
            measure: MEASURE.into(),
            before: pair(&finding.before, &finding.held_before),
            after: pair(&finding.after, &finding.held_after),
            noise_floor: 1.0,
            null_test_held_out: finding.null_held_out,
        };
        let unexplained_share = unexplained_share(&error, finding);
        let problem = evidence.problem(simulator);
        let may_be_left = may_leave(&problem, &finding.after);
        let images = problem.data.energy(&problem.used) / pixels;
        let remainder = Remainder::of(error.after.held_out, images);
        let verdict = verdict(&error, finding, (unexplained_share, may_be_left), &remainder);
        let patterns = if verdict.leaves_a_residual() {
            evidence.patterns(simulator)
        } else {
            &[]
        };
        let ranked = |step: usize, tried: &[TriedEffect]| -> Vec<Ranked> {
            let of_step = tried.iter().map(|t| Ranked::new(simulator, finding, t, step));
            of_step.collect()
        };
        let later = finding.later.iter().enumerate();
        let measurements = set
            .measurements
            .iter_enumerated()
            .map(|(c, measurement)| MeasurementError {
                measurement: measurement.name.clone(),
                before: error_of_measurement(&finding.held_before[c]),
                after: error_of_measurement(&finding.held_after[c]),
            });
        Self {
            set: set.title.clone(),
            verdict,
            remarks: remarks(simulator, evidence, verdict),
            stopped_after: simulator.work.is_spent().then(|| simulator.work.simulations()),
            effects: found_effects(simulator, finding, verdict),
            error,
            ranking: ranked(1, &finding.ranking),
            later_rankings: later.map(|(place, tried)| ranked(place + 2, tried)).collect(),
            patterns: patterns.iter().map(|p| FreePattern::new(simulator, p)).collect(),
            proposal: None,
            unexplained_share,
            remainder: matches!(verdict, SetVerdict::ExplainedButFor | SetVerdict::Partly).then_some(remainder),
            missing_by_speckle: evidence.amount_by_noise,
            left_out: left_out(set, unusable),
            warnings: Vec::new(),
            measurements: measurements.collect(),
            ladder,
        }
    }

    /// Diagnosis of a set most of whose measurements cannot be used; `error` is that of the nuisances alone.
    pub fn data_unfit(set: &MeasuredSet, error: f64, unusable: &[UnusableMeasurement]) -> Self {
        let pair = ErrorPair {
            fit: error,
            held_out: error,
        };
        Self {
            set: set.title.clone(),
            verdict: SetVerdict::DataUnfit,
            effects: Vec::new(),
            remarks: Vec::new(),
            stopped_after: None,
            error: ErrorReport {
                measure: MEASURE.into(),
                before: pair,
                after: pair,
                noise_floor: 1.0,
                null_test_held_out: error,
            },
            ranking: Vec::new(),
            later_rankings: Vec::new(),
            patterns: Vec::new(),
            proposal: None,
            unexplained_share: 1.0,
            remainder: None,
            missing_by_speckle: None,
            left_out: left_out(set, unusable),
            warnings: Vec::new(),
            measurements: Vec::new(),
            ladder: Vec::new(),
        }
    }
}

/// Share of the error above noise that the finding leaves.
fn unexplained_share(error: &ErrorReport, finding: &Finding) -> f64 {
    if error.before.held_out <= EXPLAINED && finding.chosen.is_empty() {
        return 0.0;
    }
    let above = (error.before.held_out - 1.0).max(LEAST_ABOVE_NOISE);
    ((error.after.held_out - 1.0).max(0.0) / above).clamp(0.0, 1.0)
}

impl Remainder {
    /// The remainder with such a reduced chi-square, in images of such a mean square over the noise.
    fn of(chi2: f64, images: f64) -> Self {
        let share = ((chi2 - 1.0).max(0.0) / images.max(f64::MIN_POSITIVE)).sqrt();
        Self {
            percent: 100.0 * share,
            model_error_percent: 100.0 * CellError::MEASURED.of_images(),
        }
    }

    /// True if the model may err by as much.
    fn is_below_the_model(&self) -> bool {
        self.percent < self.model_error_percent
    }
}

fn verdict(
    error: &ErrorReport,
    finding: &Finding,
    (unexplained_share, may_be_left): (f64, f64),
    remainder: &Remainder,
) -> SetVerdict {
    if finding.chosen.is_empty() {
        return if error.before.held_out <= EXPLAINED {
            SetVerdict::NoResidual
        } else {
            SetVerdict::Unexplained
        };
    }
    let fits = error.after.held_out <= may_be_left;
    let unambiguous = finding.alternatives.iter().all(Vec::is_empty);
    if !fits && unexplained_share > MOSTLY_LEFT {
        SetVerdict::Unexplained
    } else if !fits && unexplained_share <= HARDLY_LEFT && remainder.is_below_the_model() {
        SetVerdict::ExplainedButFor
    } else if !fits {
        SetVerdict::Partly
    } else if finding.chosen.len() == 1 && !unambiguous {
        SetVerdict::OneOf
    } else {
        SetVerdict::Explained
    }
}

/// Claims: the effects that were chosen, and their alternatives where the set cannot distinguish them.
fn found_effects(simulator: &Simulator<'_>, finding: &Finding, verdict: SetVerdict) -> Vec<FoundEffect> {
    let mut effects = Vec::new();
    if verdict == SetVerdict::Unexplained {
        return effects;
    }
    for (&effect, alternatives) in finding.chosen.iter().zip(&finding.alternatives) {
        let slots = simulator.slots_of(effect);
        let values: Vec<f64> = slots.iter().map(|&s| finding.after.theta[s]).collect();
        let widths = reported_widths(&finding.after.pick(&slots, &finding.half_widths));
        let others: Vec<usize> = alternatives.iter().map(|a| a.effect).collect();
        effects.push(FoundEffect::new(simulator, effect, &values, &widths, &others));
        if verdict == SetVerdict::OneOf {
            for a in alternatives {
                let rest = others.iter().copied().filter(|&o| o != a.effect);
                let rest: Vec<usize> = rest.chain([effect]).collect();
                effects.push(FoundEffect::new(
                    simulator,
                    a.effect,
                    &a.values,
                    &reported_widths(&a.half_widths),
                    &rest,
                ));
            }
        }
    }
    effects
}

fn reported_widths(parts: &[IntervalParts]) -> Vec<WidthParts> {
    parts.iter().map(WidthParts::from).collect()
}

/// Ambiguities that measurements of few elements or of one colour leave: their own distances would do as well as a tilt of the sensor, and
/// effects that differ by colour alone may be taken for one another.
fn remarks(simulator: &Simulator<'_>, evidence: &Evidence, verdict: SetVerdict) -> Vec<String> {
    let (set, finding) = (simulator.bench.set(), &evidence.finding);
    if verdict == SetVerdict::Unexplained || finding.chosen.is_empty() {
        return Vec::new();
    }
    let used = || set.measurements.iter_enumerated().filter(|(c, _)| evidence.used[*c]);
    let elements: BTreeSet<usize> = used()
        .map(|(_, measurement)| usize::from(measurement.element))
        .collect();
    let colours: BTreeSet<usize> = used().map(|(_, measurement)| usize::from(measurement.led)).collect();
    let is_found = |is: fn(&dyn Effect) -> bool| finding.chosen.iter().any(|&e| is(simulator.effects[e].as_ref()));
    let (defocus, tilt) = (
        is_found(|e| e.name() == "defocus"),
        is_found(|e| e.gradient_of() == Some("defocus")),
    );
    let is_tilt_open = match elements.len() {
        1 => defocus,
        2 | 3 => tilt,
        _ => false,
    };
    let of_elements = is_tilt_open.then(|| untold_tilt(elements.len()));
    of_elements
        .into_iter()
        .chain((colours.len() == 1).then(untold_colours))
        .collect()
}

fn left_out(set: &MeasuredSet, unusable: &[UnusableMeasurement]) -> Vec<LeftOut> {
    let named = unusable.iter().map(|u| LeftOut {
        measurement: set.measurements[u.measurement].name.clone(),
        reason: u.reason.clone(),
    });
    named.collect()
}

impl Ranked {
    /// Candidate as it was tried in a step, counted from one.
    fn new(simulator: &Simulator<'_>, finding: &Finding, tried: &TriedEffect, step: usize) -> Self {
        let rejection = rejection(finding, tried);
        Self {
            name: simulator.effects[tried.effect].name(),
            score: tried.score,
            held_out_gain: tried.gain.map(|g| g.value),
            held_out_gain_interval: tried.gain.map(|g| g.interval),
            value: (!tried.values.is_empty()).then(|| listed(&reported(simulator, tried.effect, &tried.values))),
            rejected: rejection.map(Rejection::sentence),
            remark: match rejection {
                Some(rejection) => rejection.remark(),
                None => taken_words(&finding.later, tried, step),
            },
        }
    }
}

/// How an effect that was found came to be taken, said of it in a table of the candidates of a step. The first table has the
/// gain with which an effect was taken, whenever that was: without the step it would read as one of the first.
fn taken_words(later: &[Vec<TriedEffect>], tried: &TriedEffect, step: usize) -> String {
    let was_taken = |t: &TriedEffect| t.effect == tried.effect && t.rejected.is_none();
    let in_step = later.iter().position(|all| all.iter().any(was_taken));
    match in_step.map(|place| place + 2) {
        Some(taken) if taken != step => format!("taken in step {taken}"),
        None if tried.rejected.is_some() => "taken in a later step".into(),
        _ => "taken".into(),
    }
}

/// Reason why a candidate was not taken, if it is not among what was found in the end.
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

impl FoundEffect {
    /// Claim with the parameters of an effect and the parts of their half-widths; `others` explain as much.
    pub(crate) fn new(
        simulator: &Simulator<'_>,
        effect: usize,
        numbers: &[f64],
        widths: &[WidthParts],
        others: &[usize],
    ) -> Self {
        let half_widths: Vec<f64> = widths.iter().map(WidthParts::half_width).collect();
        let set = simulator.bench.set();
        let own = &simulator.effects[effect];
        let (values, intervals): (Vec<f64>, Vec<[f64; 2]>) =
            own.reported(numbers, &half_widths, set).into_iter().unzip();
        // An interval may end where physics does: its longer side counts.
        let side = |(value, [low, high]): (f64, [f64; 2])| (value - low).max(high - value);
        let of_each = |part: &[f64]| own.reported(numbers, part, set).into_iter().map(side).collect();
        Self {
            name: own.name(),
            value: listed(&values),
            unit: own.unit().into(),
            interval: listed(&intervals),
            interval_from: WidthParts::map(widths, of_each),
            confounded_with: others.iter().map(|&o| simulator.effects[o].name()).collect(),
            separate_by: separating_measurement(simulator, effect, others),
        }
    }
}

fn listed<T: Serialize>(values: &[T]) -> Value {
    match values {
        [one] => serde_json::json!(one),
        more => serde_json::json!(more),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reduced chi-square of 1.06 is a small part of bright images, and a large part of dim ones.
    #[test]
    fn a_remainder_is_compared_with_the_error_of_the_model() {
        let of = |images: f64| Remainder::of(1.06, images);
        assert!((of(6e4).percent - 0.1).abs() < 1e-9);
        assert!(of(6e4).is_below_the_model() && !of(6e2).is_below_the_model());
        assert_eq!(Remainder::of(0.99, 6e4).percent, 0.0);
    }

    #[test]
    fn a_table_says_in_which_step_an_effect_was_taken() {
        let tried = |effect, rejected| TriedEffect {
            effect,
            score: 0.0,
            gain: None,
            values: Vec::new(),
            rejected,
        };
        let second = Some(Rejection::Second);
        let later = [
            vec![tried(4, None), tried(5, second)],
            vec![tried(5, None), tried(6, second)],
        ];
        // The first table has all that was taken as taken; effect 3 was so in the first step, 6 as one of a pair.
        for (effect, rejected, step, words) in [
            (3, None, 1, "taken"),
            (4, None, 1, "taken in step 2"),
            (4, None, 2, "taken"),
            (5, second, 2, "taken in step 3"),
            (6, second, 3, "taken in a later step"),
        ] {
            assert_eq!(
                taken_words(&later, &tried(effect, rejected), step),
                words,
                "{effect} in {step}"
            );
        }
    }
}
