//! Exchange: another effect in the place of one that was found, where with it one more explains the residual.
//!
//! Of two effects that are much alike, such as a wavefront as a path and as a phase, the wrong one can be taken while a third
//! is still hidden. Alone, the right one is no better in its place; with the third it is.

use metalith_core::{Progress, Result};

use super::state::SearchState;
use super::stepwise::{SelectionStep, TriedEffect, step_forward};
use crate::measurements::Measurements;

/// Substitutes that are followed.
const FOLLOWED: usize = 3;

/// Share of the gain of an effect that was taken by which another is much like it.
const ALIKE: f64 = 0.8;

/// Share of the error above noise that an exchange may leave: more would trade one half-truth for another.
const MAY_LEAVE: f64 = 0.25;

/// An exchange that explains what was left.
pub(crate) struct Exchange<'a, M: Measurements> {
    /// Effect that is replaced, and the one that replaces it.
    pub place: usize,
    pub effect: usize,
    /// Effects that were tried besides it, and the one that was taken.
    pub tried: Vec<TriedEffect>,
    pub taken: TriedEffect,
    pub leaders: Vec<usize>,
    pub null_gain: f64,
    pub state: SearchState<'a, M>,
}

/// Effects of a step that gained nearly as much as the one that was taken, best first.
pub(crate) fn much_alike(tried: &[TriedEffect], taken: &TriedEffect) -> Vec<TriedEffect> {
    let gain = |t: &TriedEffect| t.gain.map_or(0.0, |g| g.value);
    let alike = |t: &&TriedEffect| t.effect != taken.effect && gain(t) > ALIKE * gain(taken);
    let mut found: Vec<TriedEffect> = tried.iter().filter(alike).cloned().collect();
    found.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    found
}

/// The exchange that leaves least, if one explains what effects in `chosen` leave; `alike` are those that gained nearly as much
/// when each was taken. With `full`, all is refined with full simulations.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub(crate) fn find_exchange<'a, M: Measurements>(
    now: &SearchState<'a, M>,
    chosen: &[usize],
    alike: &[Vec<TriedEffect>],
    full: bool,
    progress: &dyn Progress,
) -> Result<Option<Exchange<'a, M>>> {
    let others = alike
        .iter()
        .enumerate()
        .flat_map(|(place, a)| a.iter().map(move |t| (place, t)));
    let mut best: Option<Exchange<'a, M>> = None;
    for (place, other) in others.filter(|(_, t)| !chosen.contains(&t.effect)).take(FOLLOWED) {
        if now.problem.model.is_spent() {
            break;
        }
        let mut set = chosen.to_vec();
        set[place] = other.effect;
        let mut state = replaced(now, chosen[place], other, &set, full, progress)?;
        let step = step_forward(&mut state, &set, full, progress)?;
        let SelectionStep {
            tried,
            leaders,
            taken: Some((taken, fit, held)),
            null_gain,
        } = step
        else {
            continue;
        };
        (state.fit, state.held_out) = (fit, held);
        if full {
            state.refine(progress)?;
        }
        let least = match &best {
            Some(best) => best.state.error(),
            None => 1.0 + MAY_LEAVE * (now.error() - 1.0),
        };
        if state.error() < least {
            best = Some(Exchange {
                place,
                effect: other.effect,
                tried,
                taken,
                leaders,
                null_gain,
                state,
            });
        }
    }
    Ok(best)
}

/// Fit with another effect in the place of one that is removed, simulated anew about the values that it had when it was tried: a
/// surrogate about the one that is removed says little of it.
fn replaced<'a, M: Measurements>(
    now: &SearchState<'a, M>,
    removed: usize,
    other: &TriedEffect,
    set: &[usize],
    full: bool,
    progress: &dyn Progress,
) -> Result<SearchState<'a, M>> {
    let (mut state, model) = (now.clone(), now.problem.model);
    for slot in model.slots_of(removed) {
        state.fit.theta[slot] = 0.0;
    }
    for (slot, value) in model.slots_of(other.effect).into_iter().zip(&other.values) {
        state.fit.theta[slot] = *value;
    }
    state.fit.active = model.slots_of_all(set);
    if full {
        state.recentre(progress)?;
        state.renew_others(progress)?;
        state.refine(progress)?;
    } else {
        let fit = state.problem.fit(&state.fit.active, &state.fit);
        state.move_to(fit);
    }
    Ok(state)
}
