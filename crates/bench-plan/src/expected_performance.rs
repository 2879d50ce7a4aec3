//! Forecast for a chosen session: the gain of each effect at its wanted size, the interval that a calibration would
//! give it, and what could be taken for it.

use metalith_core::{Progress, Result};
use serde::Serialize;

use crate::choice::{Choice, ChosenMeasurement, NEEDED, Requirement, energy, lookalike};
use metalith_attribution::{ForwardModel, Measurements, REFERENCES_DECIDE, half_widths};
use metalith_calibrate::Effect;
use metalith_calibrate::MeasuredSet;
use metalith_calibrate::Simulator;
use metalith_calibrate::separating_measurement;
use metalith_calibrate::{Data, Nuisances};
use metalith_calibrate::{FitProblem, Surrogate};

/// Margin that is enough: the choice stops at one, and its sums round.
const ENOUGH: f64 = 1.0 - 1e-6;

/// An effect as the planned session would see it.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedEffect {
    /// Name, with its axis or number where an effect has several.
    pub name: String,
    pub unit: String,
    /// Size that is to be found, in `unit`: a change from what is stated, or the distance of a source.
    pub wanted: f64,
    /// Value that a calibration would report for it: of the height of the film and of widths and sizes of the light the whole.
    pub reported: f64,
    /// Gain in reduced chi-square per pixel at this size, and what is asked for.
    pub gain: f64,
    pub needed: f64,
    /// Half of the 95 % interval that a calibration would give it there, in `unit`, if it is the only one.
    pub half_interval: f64,
    /// True if it is found: gain enough, and an interval without zero.
    pub detected: bool,
    /// True if any measurements of this bench could find it.
    pub reachable: bool,
}

/// An effect that the planned session could take for another.
#[derive(Clone, Debug, Serialize)]
pub struct Confusion {
    pub effect: String,
    /// Size, and its unit.
    pub size: f64,
    pub unit: String,
    /// Effect that it resembles.
    pub looks_like: String,
    /// At this size of each of its parameters, in its own unit.
    pub at: Vec<f64>,
    pub looks_like_unit: String,
    /// Gain in reduced chi-square per pixel by which measurements distinguish them, and what is asked for.
    pub gain: f64,
    pub needed: f64,
    /// True if other measurements of this bench would distinguish them.
    pub measurements_could: bool,
    /// Increase of chi-square by the widths by SEM, if the bench offers them.
    pub sem_chi2: Option<f64>,
    /// True if that decides.
    pub sem_decides: bool,
    /// The measurement that would distinguish them, as far as one is known.
    pub separate_by: Option<String>,
}

/// An amount of an effect in its unit for a value of one of its parameters.
pub(crate) fn amount(effect: &dyn Effect, parameter: f64, set: &MeasuredSet) -> f64 {
    let zero = effect.value(0.0, set);
    let value = effect.value(parameter.abs(), set);
    // Of some the value is absolute; of a distance that is infinite without effect it is the amount.
    let counted = if effect.parameter(1.0) == 1.0 {
        value - zero
    } else {
        value
    };
    parameter.signum() * counted
}

/// Every effect at its wanted size in a session that shows what `exposed` says; `margins` are of the requirements that ask
/// for detection alone.
pub(crate) fn effects(
    simulator: &Simulator<'_>,
    surrogate: &Surrogate,
    exposed: &MeasuredSet,
    asked: &[(Requirement, f64, bool)],
    progress: &dyn Progress,
) -> Result<Vec<PlannedEffect>> {
    let stated = Data::new(exposed);
    let mut out = Vec::new();
    progress.begin("effects at their wanted size", asked.len() as u64);
    for (r, margin, reachable) in asked {
        progress.check_stopped()?;
        let slot = simulator.slots[r.slot];
        let effect = simulator.effects[slot.effect].as_ref();
        let mut theta = surrogate.about.clone();
        theta[r.slot] = r.size;
        // The session shows the effect, so that nothing is left but the noise.
        let mut data = stated.clone();
        for c in stated.indices() {
            let shown = surrogate.prediction(&theta, c).pixels([0.0; 2]);
            data.signal[c] = shown.mapv(|v| (f64::from(v) * stated.scale[c]) as f32);
        }
        let problem = FitProblem::new(simulator, surrogate.clone(), &data);
        let own = simulator.slots_of(slot.effect);
        let fit = problem.at(&own, theta, Nuisances::stated(&data));
        let half = fit.pick(&[r.slot], &half_widths(&problem, &fit))[0].half_width();
        let width = |by: f64| amount(effect, (r.size + by).clamp(0.0, slot.parameter.range.1), exposed);
        let wanted = amount(effect, r.size, exposed);
        let half_interval = 0.5 * (width(half) - width(-half)).abs();
        out.push(PlannedEffect {
            name: simulator.slot_name(r.slot),
            unit: effect.unit().into(),
            wanted,
            reported: effect.value(r.size, exposed),
            gain: margin * NEEDED,
            needed: NEEDED,
            half_interval,
            detected: *margin >= ENOUGH && half < r.size,
            reachable: *reachable,
        });
        progress.advance(1);
    }
    Ok(out)
}

/// Pairs that the chosen measurements cannot distinguish: pairs of effects that are both found, by the worst direction of each
/// pair.
pub(crate) fn confusions(
    simulator: &Simulator<'_>,
    set: &MeasuredSet,
    choice: &Choice<'_>,
    picked: &[ChosenMeasurement],
    reachable: &[bool],
) -> Vec<Confusion> {
    let (products, pixels) = choice.products(picked);
    let margins = choice.margins(picked);
    let of = |slot: usize| simulator.slots[slot].effect;
    let with_sem = choice.information.widths.as_ref().map(|widths| {
        let first = choice.information.shared;
        let n = products.nrows();
        &products + widths.view((first, first), (n, n))
    });
    let mut out: Vec<(usize, usize, Confusion)> = Vec::new();
    let all = choice.requirements.iter().zip(&margins).zip(reachable);
    for ((r, margin), reachable) in all {
        let Some(other) = r.beside.first().map(|&s| of(s)) else {
            continue;
        };
        if *margin >= ENOUGH {
            continue;
        }
        let (own, pair) = (of(r.slot), [of(r.slot).min(other), of(r.slot).max(other)]);
        let [effect, beside] = [own, other].map(|e| simulator.effects[e].as_ref());
        let alike = lookalike(&products, r).unwrap_or_default();
        let sem_chi2 = with_sem.as_ref().map(|both| energy(both, r) - energy(&products, r));
        let confusion = Confusion {
            effect: simulator.slot_name(r.slot),
            size: amount(effect, r.size, set),
            unit: effect.unit().into(),
            looks_like: beside.name(),
            at: alike.iter().map(|v| amount(beside, *v, set)).collect(),
            looks_like_unit: beside.unit().into(),
            gain: energy(&products, r) / pixels.max(1.0),
            needed: NEEDED,
            measurements_could: *reachable,
            sem_chi2,
            sem_decides: sem_chi2.is_some_and(|chi2| chi2 >= REFERENCES_DECIDE),
            separate_by: separating_measurement(simulator, own, &[other]),
        };
        match out.iter_mut().find(|(a, b, _)| [*a, *b] == pair) {
            Some((_, _, worst)) if confusion.gain < worst.gain => *worst = confusion,
            Some(_) => {}
            None => out.push((pair[0], pair[1], confusion)),
        }
    }
    out.into_iter().map(|(_, _, c)| c).collect()
}

impl Confusion {
    /// Advice to the user.
    pub fn remedy(&self) -> String {
        let sem = match (self.sem_chi2, self.sem_decides) {
            (Some(chi2), true) => Some(format!(
                "the widths by SEM of this plan (they raise chi-square by {})",
                metalith_report::sig(chi2, 3)
            )),
            _ => None,
        };
        let more = self
            .measurements_could
            .then(|| "more measurements of this bench".to_owned());
        let known = self.separate_by.clone().filter(|_| sem.is_none());
        let all: Vec<String> = [more, sem, known].into_iter().flatten().collect();
        if all.is_empty() {
            return "no measurement is known".into();
        }
        all.join("; or ")
    }
}
