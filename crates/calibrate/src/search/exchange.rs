//! Exchange: another effect in the place of one that was found, where with it one more explains what is left.
//!
//! Of two effects that are much alike, such as a wavefront as a path and as a phase, the wrong one can be taken while a third
//! is still hidden. Alone, the right one is no better in its place; with the third it is.

use metalith_core::{Progress, Result};

use super::alternatives::Substitute;
use super::state::SearchState;
use super::stepwise::{SelectionStep, TriedEffect, step_forward};
use crate::fit::mean_error;

/// Substitutes that are followed.
const FOLLOWED: usize = 3;

/// Share of the error above noise that an exchange may leave: less would trade one half-truth for another.
const MAY_LEAVE: f64 = 0.25;

/// An exchange that explains what was left.
pub struct Exchange<'a> {
    /// Which of the effects found is replaced, and by which.
    pub place: usize,
    pub effect: usize,
    /// What was tried beside it, and the one that was taken.
    pub tried: Vec<TriedEffect>,
    pub taken: TriedEffect,
    pub leaders: Vec<usize>,
    pub null_gain: f64,
    pub state: SearchState<'a>,
}

/// The exchange that leaves least, if one explains what effects in `chosen` leave. `runners_up` were fitted when each was taken;
/// `before` is the error when nothing was found. With `full`, all is refined with full simulations.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub fn find_exchange<'a>(
    now: &SearchState<'a>,
    chosen: &[usize],
    runners_up: &[Vec<usize>],
    before: f64,
    full: bool,
    progress: &dyn Progress,
) -> Result<Option<Exchange<'a>>> {
    let mut substitutes = Vec::new();
    for (place, others) in runners_up.iter().enumerate() {
        for &effect in others.iter().filter(|o| !chosen.contains(o)) {
            let mut set = chosen.to_vec();
            set[place] = effect;
            let substitute = Substitute::new(now, chosen[place], effect, &set);
            if substitute.is_worth_refining(now, before) {
                substitutes.push((place, set, substitute));
            }
        }
    }
    substitutes.sort_by(|a, b| a.2.state.error().total_cmp(&b.2.state.error()));
    let mut best: Option<Exchange<'a>> = None;
    for (place, set, Substitute { effect, mut state }) in substitutes.into_iter().take(FOLLOWED) {
        if full {
            state.refine(progress)?;
            state.recentre(progress)?;
        }
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
        let least = best
            .as_ref()
            .map_or(1.0 + MAY_LEAVE * (now.error() - 1.0), |b| b.state.error());
        if mean_error(&state.held_out) < least {
            best = Some(Exchange {
                place,
                effect,
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
