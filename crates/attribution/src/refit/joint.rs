//! Several effects at once: those that help together only, and one of all groups in place of the same one of each group.

use metalith_core::{Progress, Result};

use super::finding::RefitTried;
use super::fit::State;
use super::selection::{Course, Selection, TAKEN_STEPS, TRIAL_STEPS, share_removed};

/// Most effects that are taken together.
const MOST: usize = 6;

/// Candidates that are fitted for each of them.
const FITTED: usize = 3;

/// Least share of the sum of squares that each removes while the others are sought.
const SHARE: f64 = 0.05;

/// Relative growth of the held-out error that is allowed if one common effect replaces effects of several groups.
const SIMPLER: f64 = 0.01;

impl Selection<'_> {
    /// Effects that are fitted together because none is surely right alone: each that removes most joins, then each is judged as
    /// if it were the last, and the worst that is refused goes. True if any is taken.
    pub(super) fn take_together(&self, course: &mut Course, open: &[usize], progress: &dyn Progress) -> Result<bool> {
        let mut found: Vec<usize> = Vec::new();
        let mut state: Option<State> = None;
        progress.begin("effects together", MOST as u64);
        while found.len() < MOST {
            let from = state.as_ref().unwrap_or(&course.now);
            let rest = open.iter().copied().filter(|e| !found.contains(e)).collect();
            let ranked = self.promising(from, rest, progress)?;
            let starts = ranked
                .into_iter()
                .take(FITTED)
                .filter_map(|(e, start)| Some((e, start?)));
            let fitted = starts.map(|(e, start)| (e, self.fit(start, TRIAL_STEPS)));
            let least = fitted.min_by(|a, b| a.1.sum_of_squares().total_cmp(&b.1.sum_of_squares()));
            progress.advance(1);
            match least {
                Some((e, next)) if next.sum_of_squares() < (1.0 - SHARE) * from.sum_of_squares() => {
                    found.push(e);
                    state = Some(next);
                }
                _ => break,
            }
        }
        let Some(state) = state.filter(|_| found.len() > 1) else {
            return Ok(false);
        };
        let state = self.without_refused(course, &mut found, state, progress)?;
        if found.is_empty() {
            return Ok(false);
        }
        for (k, &effect) in found.iter().enumerate() {
            let before = course.ladder[course.ladder.len() - 1].clone();
            let next = self.fit(self.with(&course.now, effect), TAKEN_STEPS);
            course.now = if k + 1 == found.len() {
                self.at(state.active.clone(), state.theta.clone())
            } else {
                next
            };
            let tried = self.try_last(effect, &course.now, &before);
            course.chosen.push(effect);
            course.ladder.push(tried.errors.clone());
            course.last[effect] = Some(RefitTried {
                rejected: None,
                ..tried
            });
        }
        Ok(true)
    }

    /// Drop effects that are refused as the last one, the one that removes least first.
    fn without_refused(
        &self,
        course: &mut Course,
        found: &mut Vec<usize>,
        state: State,
        progress: &dyn Progress,
    ) -> Result<State> {
        let mut state = self.fit(state, TAKEN_STEPS);
        loop {
            let mut worst: Option<(f64, usize, State, RefitTried)> = None;
            for (place, &effect) in found.iter().enumerate() {
                progress.check_stopped()?;
                let without = self.fit(self.dropped(&state, effect), TRIAL_STEPS);
                let before = self.errors(&without);
                let tried = self.try_last(effect, &state, &before);
                let share = share_removed(&before, &tried.errors);
                if tried.rejected.is_some() && worst.as_ref().is_none_or(|w| share < w.0) {
                    worst = Some((share, place, without, tried));
                }
            }
            let Some((_, place, without, tried)) = worst else {
                return Ok(state);
            };
            course.last[found.remove(place)] = Some(tried);
            state = self.fit(without, TAKEN_STEPS);
        }
    }

    /// A state with the parameters of an effect at their neutral values.
    pub(super) fn dropped(&self, state: &State, effect: usize) -> State {
        let slots = &self.model.effects()[effect].slots;
        let mut theta = state.theta.clone();
        slots
            .iter()
            .for_each(|&s| theta[s] = self.model.parameters()[s].neutral);
        let active = state.active.iter().copied().filter(|s| !slots.contains(s)).collect();
        self.at(active, theta)
    }

    /// Take one effect in place of the same effect of several groups, where it predicts as well. True if one was taken.
    pub(super) fn take_for_groups(&self, course: &mut Course, progress: &dyn Progress) -> Result<bool> {
        let mut any = false;
        for effect in 0..self.model.effects().len() {
            progress.check_stopped()?;
            let own: Vec<usize> = course
                .chosen
                .iter()
                .copied()
                .filter(|&e| self.model.common(e) == Some(effect))
                .collect();
            if own.len() < 2 || course.chosen.contains(&effect) {
                continue;
            }
            let first = self.dropped(&course.now, own[0]);
            let without = own[1..].iter().fold(first, |state, &e| self.dropped(&state, e));
            let without = self.fit(without, TRIAL_STEPS);
            let state = self.fit(self.with(&without, effect), TAKEN_STEPS);
            let tried = self.try_last(effect, &state, &self.errors(&without));
            let now = course.ladder[course.ladder.len() - 1].held_out[0];
            let as_well = now
                .zip(tried.errors.held_out[0])
                .is_some_and(|(now, then)| then <= (1.0 + SIMPLER) * now);
            if tried.rejected.is_none() && as_well {
                for e in own {
                    if let Some(place) = course.chosen.iter().position(|c| *c == e) {
                        course.chosen.remove(place);
                        course.ladder.remove(place + 1);
                        course.last[e] = None;
                    }
                }
                course.chosen.push(effect);
                course.ladder.push(tried.errors.clone());
                course.last[effect] = Some(tried);
                course.now = state;
                any = true;
            }
        }
        Ok(any)
    }
}
