//! What else would explain as much, and what has become needless.

use super::fit::{Fit, Problem};
use super::forward::{LEAST_GAIN, physical};
use super::heldout::{HeldOut, gain, half_widths, held_out, mean};
use super::optics::PixelGrid;
use crate::error::Result;
use crate::progress::Progress;

/// Chi-square of the SEM's widths by which one explanation must fit better to speak for it.
const SEM_SPEAKS: f64 = 9.0;

/// Errors on captures left out that differ by more than this are not alike, however wide the interval.
const ALIKE_WITHIN: f64 = 0.02;

/// An explanation that leaves so much more on the atlas, as a part of what the best takes away, is not brought
/// to rest to be compared.
const WORTH_SETTLING: f64 = 0.1;

/// Another effect that explains as much.
#[derive(Clone, Debug)]
pub struct Alternative {
    pub effect: usize,
    pub values: Vec<f64>,
    pub half_widths: Vec<f64>,
}

/// Drop what the others have made needless.
pub fn prune(problem: &Problem<'_>, chosen: &mut Vec<usize>, now: &mut Fit, held_now: &mut HeldOut) {
    let mut place = 0;
    while chosen.len() > 1 && place < chosen.len() {
        let rest: Vec<usize> = chosen.iter().copied().filter(|&e| e != chosen[place]).collect();
        let active: Vec<usize> = rest.iter().flat_map(|&e| problem.simulator.slots_of(e)).collect();
        let mut from = now.clone();
        for s in problem.simulator.slots_of(chosen[place]) {
            from.theta[s] = 0.0;
        }
        let fit = problem.fit(&active, &from);
        let held = held_out(problem, &fit.forms, &fit);
        let (loss, [low, _]) = gain(problem, &held, held_now);
        if loss < LEAST_GAIN || low <= 0.0 {
            *chosen = rest;
            (*now, *held_now) = (fit, held);
            place = 0;
        } else {
            place += 1;
        }
    }
}

/// For each effect found: the others that would do as well in its place. Where one does better, or the SEM's
/// widths prefer it among those that captures do not tell apart, it takes the place.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn rivals(
    problem: &mut Problem<'_>,
    chosen: &mut [usize],
    runners: &[Vec<usize>],
    found: &mut Found<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Alternative>>> {
    let mut out = Vec::new();
    for place in 0..chosen.len() {
        let mut best = Rival {
            effect: chosen[place],
            fit: found.now.clone(),
            held: found.held.clone(),
            exact: problem.exact.clone(),
        };
        let mut others = Vec::new();
        // Where something is left, whoever was screened out early may be who was there.
        let all: Vec<usize> = (0..problem.simulator.effects.len()).collect();
        let runners = if mean(found.held) > 1.0 + ALIKE_WITHIN {
            Some(&all)
        } else {
            runners.get(place)
        };
        for &other in runners.into_iter().flatten() {
            if !chosen.contains(&other) {
                others.extend(Rival::in_place(problem, chosen, place, other, found, progress)?);
            }
        }
        for other in &mut others {
            if other.beats(&best, problem) {
                std::mem::swap(other, &mut best);
            }
        }
        if best.effect != chosen[place] {
            chosen[place] = best.effect;
            *found.now = best.fit.clone();
            found.held.clone_from(&best.held);
            problem.exact.clone_from(&best.exact);
        }
        let least = sem_chi2(problem, &best.fit);
        others.retain(|o| o.is_as_good(&best, problem) && sem_chi2(problem, &o.fit) - least <= SEM_SPEAKS);
        out.push(
            others
                .iter()
                .map(|o| Alternative::new(problem, o.effect, &o.fit))
                .collect(),
        );
    }
    Ok(out)
}

/// What was found so far.
pub struct Found<'f> {
    pub now: &'f mut Fit,
    pub held: &'f mut HeldOut,
    /// The error on captures left out before anything was found.
    pub before: &'f HeldOut,
    /// Whether fits are brought to rest on exact simulations.
    pub exact: bool,
}

/// An explanation with a certain effect in the place of one that was found.
struct Rival {
    effect: usize,
    fit: Fit,
    held: HeldOut,
    exact: Option<Vec<PixelGrid>>,
}

impl Rival {
    /// With `other` in the place; nothing if it is far behind.
    fn in_place(
        problem: &Problem<'_>,
        chosen: &[usize],
        place: usize,
        other: usize,
        found: &Found<'_>,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let simulator = problem.simulator;
        let active: Vec<usize> = chosen
            .iter()
            .enumerate()
            .map(|(p, &e)| if p == place { other } else { e })
            .flat_map(|e| simulator.slots_of(e))
            .collect();
        let mut from = found.now.clone();
        for s in simulator.slots_of(chosen[place]) {
            from.theta[s] = 0.0;
        }
        let mut own = problem.branch();
        let mut fit = own.fit(&active, &from);
        let mut held = held_out(&own, &fit.forms, &fit);
        let behind = mean(&held) - mean(found.held);
        let much = ALIKE_WITHIN.max(WORTH_SETTLING * (mean(found.before) - mean(found.held)));
        if behind > much || !physical(&own, &fit, &simulator.slots_of(other)) {
            return Ok(None);
        }
        if found.exact {
            fit = own.settle(fit, progress)?;
            held = held_out(&own, &fit.forms, &fit);
        }
        Ok(Some(Self {
            effect: other,
            fit,
            held,
            exact: own.exact,
        }))
    }

    /// Whether captures left out do not tell it apart from the best.
    fn is_as_good(&self, best: &Self, problem: &Problem<'_>) -> bool {
        let (worse, [low, _]) = gain(problem, &self.held, &best.held);
        (worse < LEAST_GAIN || low <= 0.0) && mean(&self.held) < mean(&best.held) + ALIKE_WITHIN
    }

    fn beats(&self, best: &Self, problem: &Problem<'_>) -> bool {
        let (better, [low, _]) = gain(problem, &best.held, &self.held);
        let by_sem = sem_chi2(problem, &best.fit) - sem_chi2(problem, &self.fit);
        better >= LEAST_GAIN && low > 0.0 && by_sem > -SEM_SPEAKS
            || self.is_as_good(best, problem) && by_sem > SEM_SPEAKS
    }
}

fn sem_chi2(problem: &Problem<'_>, fit: &Fit) -> f64 {
    let form = &fit.forms[problem.used.len()];
    form[(form.nrows() - 1, form.nrows() - 1)]
}

impl Alternative {
    fn new(problem: &Problem<'_>, effect: usize, fit: &Fit) -> Self {
        let widths = half_widths(problem, fit);
        let own = problem.simulator.slots_of(effect);
        Self {
            effect,
            values: own.iter().map(|&s| fit.theta[s]).collect(),
            half_widths: own
                .iter()
                .filter_map(|s| fit.active.iter().position(|a| a == s).map(|k| widths[k]))
                .collect(),
        }
    }
}
