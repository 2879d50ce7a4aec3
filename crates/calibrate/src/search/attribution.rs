//! From a residual to a name: score every effect, fit the leaders, keep what predicts captures it has not
//! seen, and say where two cannot be told apart.

use crate::fit::cross_validation::{HeldOutErrors, half_widths, mean};
use crate::fit::nuisances::Data;
use crate::fit::problem::{Fit, Problem};
use crate::optics::PixelGrid;
use crate::search::alternatives::{Alternative, alternatives, drop_redundant};
use crate::search::pairs::find_pair;
use crate::search::state::SearchState;
use crate::search::stepwise::{LEAST_GAIN, RESIDUAL, TriedEffect, step_forward};
use crate::simulator::Simulator;
use crate::surrogate::Surrogate;
use metalith_core::{Progress, Result};

/// Most effects that one session is taken to show at once.
const MOST_EFFECTS: usize = 4;

/// What was found.
pub struct Finding {
    /// Effects, strongest first.
    pub chosen: Vec<usize>,
    /// What else would explain as much, for each of them.
    pub alternatives: Vec<Vec<Alternative>>,
    pub before: Fit,
    pub after: Fit,
    pub held_before: HeldOutErrors,
    pub held_after: HeldOutErrors,
    pub placebo_held_out: f64,
    pub ranking: Vec<TriedEffect>,
    /// What was tried on top of each effect that was taken.
    pub later: Vec<Vec<TriedEffect>>,
    /// Who else was fitted at each step.
    runners: Vec<Vec<usize>>,
    /// 95 % half-widths of the numbers of `after`.
    pub half_widths: Vec<f64>,
    /// The atlas that `after` rests on, and what the exact simulation adds to it.
    pub atlas: Surrogate,
    pub exact: Option<Vec<PixelGrid>>,
    /// Share of missing pillars by the grain that they leave, where that counts as noise.
    pub by_grain: Option<f64>,
}

/// What a search has been through.
struct SearchHistory {
    chosen: Vec<usize>,
    before: Fit,
    held_before: HeldOutErrors,
    placebo_held_out: f64,
    ranking: Vec<TriedEffect>,
    later: Vec<Vec<TriedEffect>>,
    runners: Vec<Vec<usize>>,
}

impl SearchHistory {
    /// From where nothing is found.
    fn from(start: &SearchState<'_>) -> Self {
        Self {
            chosen: Vec::new(),
            before: start.fit.clone(),
            held_before: start.held.clone(),
            placebo_held_out: start.error(),
            ranking: Vec::new(),
            later: Vec::new(),
            runners: Vec::new(),
        }
    }

    /// That which led to an earlier finding.
    fn of(earlier: &Finding) -> Self {
        Self {
            chosen: earlier.chosen.clone(),
            before: earlier.before.clone(),
            held_before: earlier.held_before.clone(),
            placebo_held_out: earlier.placebo_held_out,
            ranking: earlier.ranking.clone(),
            later: earlier.later.clone(),
            runners: earlier.runners.clone(),
        }
    }

    /// Keep what was tried in a step, at which random terms gained `placebo`.
    fn keep(&mut self, tried: Vec<TriedEffect>, placebo: f64) {
        if self.chosen.is_empty() {
            self.placebo_held_out = mean(&self.held_before) - placebo;
            self.ranking = tried;
        } else {
            self.later.push(tried);
        }
    }

    /// Take an effect, with who else was fitted.
    fn take(&mut self, tried: &TriedEffect, runners: Vec<usize>) {
        if let Some(known) = self.ranking.iter_mut().find(|t| t.effect == tried.effect) {
            let score = known.score;
            *known = TriedEffect { score, ..tried.clone() };
        }
        self.chosen.push(tried.effect);
        self.runners.push(runners);
    }
}

/// Attribute the residual of a set. With `earlier`, go on from there, on an atlas about it. With `exact`, what
/// is found is brought to rest on exact simulations.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn attribute(
    simulator: &Simulator<'_>,
    atlas: &Surrogate,
    data: &Data,
    used: &[bool],
    exact: bool,
    earlier: Option<&Finding>,
    progress: &dyn Progress,
) -> Result<Finding> {
    let problem = Problem {
        simulator,
        atlas: atlas.clone(),
        data,
        used: used.to_vec(),
        exact: None,
    };
    let nothing = problem.nothing();
    let mut now = SearchState::new(problem, nothing);
    let mut trail = earlier.map_or_else(|| SearchHistory::from(&now), SearchHistory::of);
    if earlier.is_some() {
        // What was found is kept and fitted again from the atlas about it.
        let fit = now.problem.fit(&simulator.slots_of_all(&trail.chosen), &now.fit);
        now.go(fit);
        if exact {
            now.refine(progress)?;
        }
    }
    while trail.chosen.len() < MOST_EFFECTS {
        let step = step_forward(&mut now, &trail.chosen, exact, progress)?;
        trail.keep(step.tried, step.placebo);
        if let Some((tried, fit, held)) = step.taken {
            trail.take(&tried, step.leaders);
            (now.fit, now.held) = (fit, held);
            if exact {
                now.refine(progress)?;
            }
        } else if now.error() > RESIDUAL && trail.chosen.len() + 2 <= MOST_EFFECTS {
            let Some(both) = find_pair(&now, &trail.chosen, exact, progress)? else {
                break;
            };
            for tried in &both.tried {
                trail.take(tried, both.runners.clone());
            }
            now = both.standing;
        } else {
            break;
        }
        if now.error() < 1.0 + LEAST_GAIN {
            break;
        }
    }
    let found = trail.chosen.len();
    drop_redundant(&mut now, &mut trail.chosen, &mut trail.runners);
    if exact && trail.chosen.len() < found {
        now.refine(progress)?;
    }
    let (runners, before) = (&trail.runners, &trail.held_before);
    let mut alternatives = alternatives(&mut now, &mut trail.chosen, runners, before, exact, progress)?;
    let least = |slot: usize| MODEL_SHARE * simulator.slots[slot].parameter.typical;
    let mut widths = half_widths(&now.problem, &now.fit);
    for (w, &s) in widths.iter_mut().zip(&now.fit.active) {
        *w = w.max(least(s));
    }
    for a in alternatives.iter_mut().flatten() {
        for (w, s) in a.half_widths.iter_mut().zip(simulator.slots_of(a.effect)) {
            *w = w.max(least(s));
        }
    }
    Ok(Finding {
        chosen: trail.chosen,
        alternatives,
        before: trail.before,
        after: now.fit,
        held_before: trail.held_before,
        held_after: now.held,
        placebo_held_out: trail.placebo_held_out,
        ranking: trail.ranking,
        later: trail.later,
        runners: trail.runners,
        half_widths: widths,
        exact: now.problem.exact,
        atlas: now.problem.atlas,
        by_grain: None,
    })
}

/// No interval is narrower than this share of a typical size on each side: what two forward models that are
/// both right differ by.
const MODEL_SHARE: f64 = 0.03;
