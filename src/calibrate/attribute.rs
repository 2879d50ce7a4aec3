//! From a residual to a name: score every effect, fit the leaders, keep what predicts captures it has not
//! seen, and say where two cannot be told apart.

use super::atlas::Atlas;
use super::couple::couple;
use super::fit::{Fit, Problem};
use super::forward::{LEAST_GAIN, RESIDUAL, Tried, forward};
use super::heldout::{HeldOut, half_widths, held_out, mean};
use super::nuisance::Data;
use super::optics::PixelGrid;
use super::rivals::{Alternative, Found, prune, rivals};
use super::simulator::Simulator;
use crate::error::Result;
use crate::progress::Progress;

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
    pub held_before: HeldOut,
    pub held_after: HeldOut,
    pub placebo_held_out: f64,
    pub ranking: Vec<Tried>,
    /// What was tried on top of each effect that was taken.
    pub later: Vec<Vec<Tried>>,
    /// Who else was fitted at each step.
    runners: Vec<Vec<usize>>,
    /// 95 % half-widths of the numbers of `after`.
    pub half_widths: Vec<f64>,
    /// The atlas that `after` rests on, and what the exact simulation adds to it.
    pub atlas: Atlas,
    pub exact: Option<Vec<PixelGrid>>,
    /// Share of missing pillars by the grain that they leave, where that counts as noise.
    pub by_grain: Option<f64>,
}

/// Attribute the residual of a set. With `earlier`, go on from there, on an atlas about it. With `exact`, what
/// is found is brought to rest on exact simulations.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub fn attribute(
    simulator: &Simulator<'_>,
    atlas: &Atlas,
    data: &Data,
    used: &[bool],
    exact: bool,
    earlier: Option<&Finding>,
    progress: &dyn Progress,
) -> Result<Finding> {
    let mut problem = Problem {
        simulator,
        atlas: atlas.clone(),
        data,
        used: used.to_vec(),
        exact: None,
    };
    let mut now = problem.nothing();
    let mut held_now = held_out(&problem, &now.forms, &now);
    let (mut chosen, mut ranking, mut runners) = (Vec::new(), Vec::new(), Vec::new());
    let mut later: Vec<Vec<Tried>> = Vec::new();
    let (before, held_before, mut placebo_held_out);
    if let Some(earlier) = earlier {
        // What was found is kept and fitted again from the atlas about it.
        chosen.clone_from(&earlier.chosen);
        ranking.clone_from(&earlier.ranking);
        later.clone_from(&earlier.later);
        runners.clone_from(&earlier.runners);
        let active: Vec<usize> = chosen.iter().flat_map(|&e| simulator.slots_of(e)).collect();
        now = problem.fit(&active, &now);
        if exact {
            now = problem.settle(now, progress)?;
        }
        held_now = held_out(&problem, &now.forms, &now);
        (before, held_before) = (earlier.before.clone(), earlier.held_before.clone());
        placebo_held_out = earlier.placebo_held_out;
    } else {
        (before, held_before) = (now.clone(), held_now.clone());
        placebo_held_out = mean(&held_now);
    }
    while chosen.len() < MOST_EFFECTS {
        let step = forward(&mut problem, &chosen, &now, &held_now, exact, progress)?;
        if chosen.is_empty() {
            placebo_held_out = mean(&held_now) - step.placebo;
            ranking = step.tried;
        } else {
            later.push(step.tried);
        }
        let mut taken = Vec::new();
        if let Some((tried, fit, held)) = step.taken {
            runners.push(step.leaders);
            taken.push(tried);
            (now, held_now) = (fit, held);
            if exact {
                now = problem.settle(now, progress)?;
                held_now = held_out(&problem, &now.forms, &now);
            }
        } else if mean(&held_now) > RESIDUAL && chosen.len() + 2 <= MOST_EFFECTS {
            let Some(both) = couple(&problem, &chosen, &now, &held_now, exact, progress)? else {
                break;
            };
            runners.extend([both.runners.clone(), both.runners]);
            taken.extend(both.tried);
            (now, held_now, problem) = (both.fit, both.held, both.problem);
        } else {
            break;
        }
        for tried in taken {
            if let Some(known) = ranking.iter_mut().find(|t| t.effect == tried.effect) {
                let score = known.score;
                *known = Tried { score, ..tried.clone() };
            }
            chosen.push(tried.effect);
        }
        if mean(&held_now) < 1.0 + LEAST_GAIN {
            break;
        }
    }
    let found = chosen.clone();
    prune(&problem, &mut chosen, &mut now, &mut held_now);
    if exact && chosen != found {
        now = problem.settle(now, progress)?;
        held_now = held_out(&problem, &now.forms, &now);
    }
    let mut found = Found {
        now: &mut now,
        held: &mut held_now,
        before: &held_before,
        exact,
    };
    let mut alternatives = rivals(&mut problem, &mut chosen, &runners, &mut found, progress)?;
    let mut widths = half_widths(&problem, &now);
    for (w, &s) in widths.iter_mut().zip(&now.active) {
        *w = w.max(MODEL_SHARE * simulator.slots[s].parameter.typical);
    }
    for a in alternatives.iter_mut().flatten() {
        for (w, s) in a.half_widths.iter_mut().zip(simulator.slots_of(a.effect)) {
            *w = w.max(MODEL_SHARE * simulator.slots[s].parameter.typical);
        }
    }
    Ok(Finding {
        chosen,
        alternatives,
        before,
        after: now,
        held_before,
        held_after: held_now,
        placebo_held_out,
        ranking,
        later,
        runners,
        half_widths: widths,
        exact: problem.exact,
        atlas: problem.atlas,
        by_grain: None,
    })
}

/// No interval is narrower than this share of a typical size on each side: what two forward models that are
/// both right differ by.
const MODEL_SHARE: f64 = 0.03;
