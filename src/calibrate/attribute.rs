//! From a residual to a name: score every effect, fit the leaders, keep what predicts captures it has not
//! seen, and say where two cannot be told apart.

use super::atlas::{Atlas, Simulator};
use super::fit::{Fit, Problem};
use super::heldout::{HeldOut, gain, half_widths, held_out, mean};
use super::nuisance::Data;
use super::optics::PixelGrid;
use super::placebo::placebo_gain;
use super::rivals::{Alternative, prune, rivals};
use super::signature::screen;
use crate::error::Result;
use crate::progress::Progress;

/// Candidates that are fitted in full at each step.
const LEADERS: usize = 6;

/// Most effects that one session is taken to show at once.
const MOST_EFFECTS: usize = 4;

/// Less than this of chi-square a pixel is what the forward model itself may err by.
pub const LEAST_GAIN: f64 = 0.02;

/// Share of the error above noise that a step must take away to be worth a name.
const LEAST_SHARE: f64 = 0.15;

/// Above this, chi-square a pixel says that something is there.
pub const RESIDUAL: f64 = 1.2;

/// Exact simulations that a final fit is brought to rest with.
const EXACT_STEPS: usize = 3;

/// A candidate as it was tried.
#[derive(Clone, Debug)]
pub struct Tried {
    pub effect: usize,
    /// Share of the residual that its signature explains on its own, nuisances projected out.
    pub score: f64,
    /// What a full fit gains on captures left out, with its interval; none where it did not come so far.
    pub gain: Option<(f64, [f64; 2])>,
    /// Its numbers.
    pub values: Vec<f64>,
    /// Why it was not taken; empty for what was.
    pub rejected: String,
}

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
    /// Who else was fitted at each step.
    runners: Vec<Vec<usize>>,
    /// 95 % half-widths of the numbers of `after`.
    pub half_widths: Vec<f64>,
    /// What the exact simulation adds to the atlas at the end.
    pub exact: Option<Vec<PixelGrid>>,
}

impl Finding {
    /// The same finding, its exact part counted from another atlas than the one that it was made with.
    pub fn against(mut self, to: &Atlas, from: &Atlas) -> Self {
        let theta = &self.after.theta;
        let exact = (0..to.base.len())
            .map(|c| {
                let (made, looked_up) = (from.grid(theta, c), to.grid(theta, c));
                let mut parts = vec![(&made, 1.0), (&looked_up, -1.0)];
                parts.extend(self.exact.as_ref().map(|e| (&e[c], 1.0)));
                PixelGrid::combine(&parts)
            })
            .collect();
        self.exact = Some(exact);
        self
    }
}

/// Attribute the residual of a set. With `earlier`, go on from there, on an atlas about it. With `exact`, what was found is brought to rest on exact simulations.
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
        atlas,
        data,
        used: used.to_vec(),
        exact: None,
    };
    let nothing = problem.nothing();
    let (mut chosen, mut ranking, mut runners) = (Vec::new(), Vec::new(), Vec::new());
    let (before, held_before, mut now, mut held_now, mut placebo_held_out);
    if let Some(earlier) = earlier {
        // What was found is kept and fitted again from the atlas about it.
        chosen.clone_from(&earlier.chosen);
        ranking.clone_from(&earlier.ranking);
        runners = earlier.runners.clone();
        let active: Vec<usize> = chosen.iter().flat_map(|&e| simulator.slots_of(e)).collect();
        now = problem.fit(&active, &nothing);
        held_now = held_out(&problem, &now.forms, &now);
        (before, held_before) = (earlier.before.clone(), earlier.held_before.clone());
        placebo_held_out = earlier.placebo_held_out;
    } else {
        held_now = held_out(&problem, &nothing.forms, &nothing);
        placebo_held_out = mean(&held_now);
        (before, held_before) = (nothing.clone(), held_now.clone());
        now = nothing;
    }
    while chosen.len() < MOST_EFFECTS {
        let scores = screen(&problem, &now, &chosen);
        let mut tried: Vec<(Tried, Option<(Fit, HeldOut)>)> = Vec::new();
        for (rank, &(effect, score)) in scores.iter().enumerate() {
            let mut entry = Tried {
                effect,
                score,
                gain: None,
                values: Vec::new(),
                rejected: "explains less of the residual than others".into(),
            };
            if rank >= LEADERS {
                tried.push((entry, None));
                continue;
            }
            let active: Vec<usize> = chosen
                .iter()
                .chain([&effect])
                .flat_map(|&e| simulator.slots_of(e))
                .collect();
            let fit = problem.fit(&active, &now);
            let held = held_out(&problem, &fit.forms, &fit);
            entry.gain = Some(gain(&problem, &held_now, &held));
            entry.values = simulator.slots_of(effect).iter().map(|&s| fit.theta[s]).collect();
            tried.push((entry, Some((fit, held))));
        }
        tried.sort_by(|a, b| {
            let key = |t: &Tried| t.gain.map_or(f64::MIN, |g| g.0);
            key(&b.0).total_cmp(&key(&a.0)).then(b.0.score.total_cmp(&a.0.score))
        });
        let above_noise = (mean(&held_now) - 1.0).max(1e-6);
        let mut accepted = None;
        for (place, (entry, fitted)) in tried.iter_mut().enumerate() {
            let (Some((value, [low, _])), Some((fit, _))) = (entry.gain, fitted.as_ref()) else {
                continue;
            };
            let placebo = placebo_gain(&problem, &now, &held_now, entry.values.len());
            if place == 0 && chosen.is_empty() {
                placebo_held_out = mean(&held_now) - placebo;
            }
            let range = simulator.slots_of(entry.effect).into_iter().all(|s| {
                let (a, b) = simulator.slots[s].parameter.range;
                let room = 1e-6 * (b - a);
                fit.theta[s] > a + room && fit.theta[s] < b - room || fit.theta[s] == 0.0
            });
            entry.rejected = if value < LEAST_GAIN {
                format!("gains {value:.4} of chi-square a pixel on captures left out; the model itself errs by as much")
            } else if low <= 0.0 {
                "its gain on captures left out is not sure to be one".into()
            } else if value < LEAST_SHARE * above_noise {
                format!("explains {:.0} % of what is above noise", 100.0 * value / above_noise)
            } else if value <= placebo {
                "a random smooth term with as many numbers explains as much".into()
            } else if !range {
                "its value would lie at the end of what physics allows".into()
            } else if accepted.is_some() {
                "another explains more".into()
            } else {
                accepted = Some(place);
                String::new()
            };
        }
        if chosen.is_empty() {
            ranking = tried.iter().map(|t| t.0.clone()).collect();
        }
        let Some(place) = accepted else { break };
        runners.push(tried.iter().filter(|t| t.1.is_some()).map(|t| t.0.effect).collect());
        let (entry, fitted) = tried.swap_remove(place);
        let (fit, held) = fitted.expect("an accepted candidate was fitted");
        if let Some(known) = ranking.iter_mut().find(|t| t.effect == entry.effect) {
            *known = Tried {
                score: known.score,
                ..entry.clone()
            };
        }
        chosen.push(entry.effect);
        (now, held_now) = (fit, held);
        if mean(&held_now) < 1.0 + LEAST_GAIN {
            break;
        }
    }
    prune(&problem, &mut chosen, &mut now, &mut held_now, &before);
    let mut alternatives = rivals(&problem, &mut chosen, &runners, &mut now, &mut held_now);
    let mut exact_offset = None;
    if exact && !chosen.is_empty() {
        for _ in 0..EXACT_STEPS {
            let theta = now.theta.clone();
            let exposed = simulator.expose(&[simulator.departure(&theta)], progress)?.remove(0);
            let offset: Vec<PixelGrid> = exposed
                .iter()
                .enumerate()
                .map(|(c, g)| PixelGrid::combine(&[(g, 1.0), (&atlas.grid(&theta, c), -1.0)]))
                .collect();
            problem.exact = Some(offset);
            let active = now.active.clone();
            now = problem.fit(&active, &now);
            let moved = active
                .iter()
                .map(|&s| (now.theta[s] - theta[s]).abs() / simulator.slots[s].parameter.typical);
            if moved.fold(0.0, f64::max) < 2e-3 {
                break;
            }
        }
        held_now = held_out(&problem, &now.forms, &now);
        exact_offset = problem.exact.take();
        problem.exact = None;
    }
    problem.exact = exact_offset;
    let mut widths = half_widths(&problem, &now);
    for (w, &s) in widths.iter_mut().zip(&now.active) {
        *w = w.max(MODEL_SHARE * simulator.slots[s].parameter.typical);
    }
    for list in &mut alternatives {
        for a in list.iter_mut() {
            for (w, s) in a.half_widths.iter_mut().zip(simulator.slots_of(a.effect)) {
                *w = w.max(MODEL_SHARE * simulator.slots[s].parameter.typical);
            }
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
        runners,
        half_widths: widths,
        exact: problem.exact,
    })
}

/// No interval is narrower than this share of a typical size on each side: what two forward models that are
/// both right differ by.
const MODEL_SHARE: f64 = 0.03;
