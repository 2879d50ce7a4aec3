//! What else would explain as much, and what has become needless.

use super::fit::{Fit, Problem};
use super::forward::LEAST_GAIN;
use super::heldout::{HeldOut, gain, half_widths, held_out, mean};

/// Chi-square of the SEM's widths by which one explanation must fit better to speak for it.
const SEM_SPEAKS: f64 = 9.0;

/// Errors on captures left out that differ by more than this are not alike, however wide the interval.
const ALIKE_WITHIN: f64 = 0.02;

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

/// For each effect found: the others that would do as well in its place. Where the SEM's widths prefer one of
/// them, it takes the place.
pub fn rivals(
    problem: &Problem<'_>,
    chosen: &mut [usize],
    runners: &[Vec<usize>],
    now: &mut Fit,
    held_now: &mut HeldOut,
) -> Vec<Vec<Alternative>> {
    let mut out = Vec::new();
    for place in 0..chosen.len() {
        let mut alike = Vec::new();
        for &other in runners.get(place).into_iter().flatten() {
            if !chosen.contains(&other) {
                alike.extend(as_good(problem, chosen, place, other, now, held_now).map(|found| (other, found)));
            }
        }
        // The SEM's choice among those that the captures do not tell apart.
        let best = alike
            .iter()
            .enumerate()
            .min_by(|a, b| sem_chi2(problem, &a.1.1.0).total_cmp(&sem_chi2(problem, &b.1.1.0)))
            .map(|(i, _)| i);
        if let Some(best) = best.filter(|&b| sem_chi2(problem, now) - sem_chi2(problem, &alike[b].1.0) > SEM_SPEAKS) {
            let (other, (fit, held)) = alike.swap_remove(best);
            let loser = std::mem::replace(&mut chosen[place], other);
            alike.push((loser, (std::mem::replace(now, fit), std::mem::replace(held_now, held))));
        }
        let least = sem_chi2(problem, now);
        alike.retain(|(_, (fit, _))| sem_chi2(problem, fit) - least <= SEM_SPEAKS);
        out.push(
            alike
                .into_iter()
                .map(|(effect, (fit, _))| Alternative::new(problem, effect, &fit))
                .collect(),
        );
    }
    out
}

/// The fit with another effect in the place of one that was found, if captures left out do not tell them apart.
fn as_good(
    problem: &Problem<'_>,
    chosen: &[usize],
    place: usize,
    other: usize,
    now: &Fit,
    held_now: &HeldOut,
) -> Option<(Fit, HeldOut)> {
    let simulator = problem.simulator;
    let active: Vec<usize> = chosen
        .iter()
        .enumerate()
        .map(|(p, &e)| if p == place { other } else { e })
        .flat_map(|e| simulator.slots_of(e))
        .collect();
    let mut from = now.clone();
    for s in simulator.slots_of(chosen[place]) {
        from.theta[s] = 0.0;
    }
    let fit = problem.fit(&active, &from);
    let held = held_out(problem, &fit.forms, &fit);
    let (worse, [low, _]) = gain(problem, &held, held_now);
    let alike = (worse < LEAST_GAIN || low <= 0.0) && mean(&held) < mean(held_now) + ALIKE_WITHIN;
    alike.then_some((fit, held))
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
