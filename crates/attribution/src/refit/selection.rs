//! The course of a selection: which effect is taken next, and why the others are refused.

use metalith_core::{Progress, Result};

use super::finding::{RefitErrors, RefitFinding, RefitRejection, RefitTried};
use super::fit::State;
use super::held_out::gain;
use super::model::{RefitModel, RefitPlan, RefitScope};
use crate::fit::Gain;

/// A figure of measurements that were never fitted may grow by this share: rounding, and steps of a fit that end early.
pub(super) const MAY_GROW: f64 = 0.002;

/// Two effects are taken at once if they gain by this share more than the best one alone.
const PAIR_SHARE: f64 = 0.1;

/// Candidates that are fitted in each step where a fit is costly and one of them is taken.
const MOST_TRIED: usize = 4;

/// Share of the least gain that the linear model promises of a candidate that is fitted where a fit is costly.
const HOPELESS: f64 = 0.5;

/// Steps of the fit of a candidate.
pub(super) const TRIAL_STEPS: usize = 5;

/// Steps of the fit of what was taken.
pub(super) const TAKEN_STEPS: usize = 12;

/// A model and the roles of its measurements.
pub(super) struct Selection<'a> {
    pub(super) model: &'a dyn RefitModel,
    pub(super) plan: &'a RefitPlan,
}

/// State of a selection between two steps.
pub(super) struct Course {
    pub(super) now: State,
    /// Effects in the order in which they were taken.
    pub(super) chosen: Vec<usize>,
    /// Errors before, and after each of them.
    pub(super) ladder: Vec<RefitErrors>,
    /// Each effect as it was tried last.
    pub(super) last: Vec<Option<RefitTried>>,
    /// True if several effects together were tried and did not help.
    pub(super) is_alone: bool,
}

/// Errors of a fit, and the 95 % interval of each parameter.
struct Judged {
    errors: RefitErrors,
    intervals: Vec<Option<[f64; 2]>>,
}

impl Selection<'_> {
    /// The whole selection.
    ///
    /// # Errors
    /// If the user stopped it.
    pub(super) fn run(&self, progress: &dyn Progress) -> Result<RefitFinding> {
        let neutral = self.model.parameters().iter().map(|p| p.neutral).collect();
        let now = self.at(Vec::new(), neutral);
        let mut course = Course {
            ladder: vec![self.errors(&now)],
            now,
            chosen: Vec::new(),
            last: vec![None; self.model.effects().len()],
            is_alone: false,
        };
        while self.step(&mut course, progress)? {}
        if self.take_for_groups(&mut course, progress)? {
            while self.step(&mut course, progress)? {}
        }
        self.drop_denied(&mut course, progress)?;
        let mut intervals = self.drop_redundant(&mut course);
        let by_group = self.values_by_group(&course.now);
        let mut worse = self.worse_with_each(&course);
        self.add_values_of_groups(&mut course, &mut intervals);
        let mut found = RefitFinding {
            by_group,
            ..self.finding(course, intervals)
        };
        found.belongings = self.belongings(&found);
        // Effects with a value for each group make none worse.
        worse.resize(found.chosen.len(), Vec::new());
        found.worse = worse;
        Ok(found)
    }

    /// Take the effect, or the two, that predict most of what was left out; false if none is taken.
    fn step(&self, course: &mut Course, progress: &dyn Progress) -> Result<bool> {
        let effects = self.model.effects();
        let open: Vec<usize> = (0..effects.len())
            .filter(|e| effects[*e].across.is_none() && !course.chosen.contains(e) && self.has_base(*e, &course.chosen))
            .collect();
        progress.begin(&format!("effects, step {}", course.chosen.len() + 1), open.len() as u64);
        let before = course.ladder[course.ladder.len() - 1].clone();
        let mut good: Vec<(State, RefitTried)> = Vec::new();
        // Effects of one group are tried where no other helps.
        let (common, own): (Vec<usize>, Vec<usize>) =
            { open.iter() }.partition(|&&e| !matches!(self.model.scope(e), RefitScope::One { .. }));
        for (pass, open) in [common.clone(), own].into_iter().enumerate() {
            if !good.is_empty() {
                break;
            }
            if pass == 1 && self.model.is_costly() && !course.is_alone {
                if self.take_together(course, &common, progress)? {
                    return Ok(true);
                }
                // Effects of one group come between; what did not help together will not with those.
                course.is_alone = true;
            }
            for (k, (effect, start)) in { self.promising(&course.now, open, progress)?.into_iter() }.enumerate() {
                if self.model.is_costly() && k >= MOST_TRIED && !good.is_empty() {
                    break;
                }
                progress.check_stopped()?;
                progress.note(&effects[effect].name);
                let start = start.unwrap_or_else(|| self.with(&course.now, effect));
                if let Some(tried) = self.hopeless(effect, &start, &course.now, &before) {
                    self.note(course, tried);
                    progress.advance(1);
                    continue;
                }
                let state = self.fit(start, TRIAL_STEPS);
                let tried = self.try_last(effect, &state, &before);
                progress.advance(1);
                if tried.rejected.is_none() {
                    good.push((state, tried.clone()));
                }
                self.note(course, tried);
            }
        }
        good.sort_by(|(_, a), (_, b)| b.gain.value.total_cmp(&a.gain.value));
        let pairs = course.chosen.is_empty() && !self.model.is_costly();
        if pairs || good.is_empty() && self.model.tries_pairs() {
            let least = good.first().map_or(0.0, |(_, tried)| tried.gain.value);
            if let Some((pair, state)) = self.pair(&course.now, &open, &before, least, progress)? {
                let first = self.fit(self.with(&course.now, pair[0]), TAKEN_STEPS);
                let both = self.fit(state, TAKEN_STEPS);
                for (effect, state) in [(pair[0], &first), (pair[1], &both)] {
                    let tried = self.try_last(effect, state, &before);
                    course.chosen.push(effect);
                    course.ladder.push(tried.errors.clone());
                    course.last[effect] = Some(RefitTried {
                        rejected: None,
                        ..tried
                    });
                }
                course.now = both;
                return Ok(true);
            }
        }
        for (state, tried) in good {
            // A fit that goes on may predict worse than one that ended early.
            let state = self.fit(state, TAKEN_STEPS);
            let tried = self.try_last(tried.effect, &state, &before);
            let is_taken = tried.rejected.is_none();
            if is_taken {
                course.now = state;
                course.chosen.push(tried.effect);
                course.ladder.push(tried.errors.clone());
            }
            let effect = tried.effect;
            course.last[effect] = Some(tried);
            if is_taken {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Candidates, each with the state that its fit starts from if that is known; where a fit is costly, those that promise most
    /// come first.
    pub(super) fn promising(
        &self,
        now: &State,
        open: Vec<usize>,
        progress: &dyn Progress,
    ) -> Result<Vec<(usize, Option<State>)>> {
        if !self.model.is_costly() {
            return Ok(open.into_iter().map(|effect| (effect, None)).collect());
        }
        let mut out = Vec::new();
        for effect in open {
            progress.check_stopped()?;
            let start = self.with(now, effect);
            out.push((start.promised(), effect, start));
        }
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(out
            .into_iter()
            .map(|(_, effect, start)| (effect, Some(start)))
            .collect())
    }

    /// Keep how an effect was tried last. Where effects of one group come later, those explain what the effect would: it is then
    /// still the groups that it predicts worse which refuse it.
    fn note(&self, course: &mut Course, tried: RefitTried) {
        let kept = &mut course.last[tried.effect];
        let was_worse = { kept.as_ref() }.is_some_and(|k| matches!(k.rejected, Some(RefitRejection::Worse { .. })));
        let is_little = matches!(tried.rejected, Some(RefitRejection::Little(_)));
        if !(self.model.is_costly() && was_worse && is_little) {
            *kept = Some(tried);
        }
    }

    /// An effect of which the linear model promises so little that a fit, where it is costly, is not needed to refuse it.
    fn hopeless(&self, effect: usize, start: &State, now: &State, before: &RefitErrors) -> Option<RefitTried> {
        let share = 1.0 - start.promised() / now.promised().max(f64::MIN_POSITIVE);
        let is_little = self.model.is_costly() && share < HOPELESS * self.model.least_share();
        is_little.then(|| RefitTried {
            effect,
            // It was not fitted.
            score: 0.0,
            gain: NO_GAIN,
            values: self.values(effect, &start.theta),
            errors: before.clone(),
            rejected: Some(RefitRejection::Little(share.max(0.0))),
        })
    }

    /// The two effects that predict most together what was left out, with their fit; none that gain less than `least` by so much
    /// that one of them suffices, or that are refused.
    fn pair(
        &self,
        now: &State,
        open: &[usize],
        before: &RefitErrors,
        least: f64,
        progress: &dyn Progress,
    ) -> Result<Option<([usize; 2], State)>> {
        let pairs: Vec<[usize; 2]> = { open.iter().enumerate() }
            .flat_map(|(k, &b)| open[..k].iter().map(move |&a| [a, b]))
            .collect();
        progress.begin("pairs of effects", pairs.len() as u64);
        let mut best: Option<(f64, [usize; 2], State)> = None;
        for pair in pairs {
            progress.check_stopped()?;
            let state = self.fit(self.with(&self.with(now, pair[0]), pair[1]), TRIAL_STEPS);
            progress.advance(1);
            // Each of both must hold as if it were tried last.
            let judged = self.judge(&state);
            if pair
                .iter()
                .any(|&e| self.rejection(e, &state, &judged, before).is_some())
            {
                continue;
            }
            let gain = self
                .gains(pair[0], &judged.errors, before)
                .first()
                .map_or(0.0, |(_, gain)| gain.value);
            if gain > best.as_ref().map_or((1.0 + PAIR_SHARE) * least, |(most, ..)| *most) {
                best = Some((gain, pair, state));
            }
        }
        Ok(best.map(|(_, pair, state)| (pair, state)))
    }

    /// Drop effects that a group in which they have to hold denies now that others were taken, one after the other, where a fit is
    /// costly: few were tried in the order in which they would be best.
    fn drop_denied(&self, course: &mut Course, progress: &dyn Progress) -> Result<()> {
        if !self.model.is_costly() || course.chosen.len() < 2 {
            return Ok(());
        }
        let every = |e: usize| matches!(self.model.scope(e), RefitScope::Every { .. });
        let mut place = 0;
        progress.begin("effects again", course.chosen.len() as u64);
        while let Some(&effect) = course.chosen.get(place) {
            progress.check_stopped()?;
            progress.advance(1);
            if every(effect) {
                let without = self.fit(self.dropped(&course.now, effect), TRIAL_STEPS);
                let tried = self.try_last(effect, &course.now, &self.errors(&without));
                if tried.rejected.is_some() {
                    course.chosen.remove(place);
                    course.ladder.remove(place + 1);
                    course.now = self.fit(without, TAKEN_STEPS);
                    *course.ladder.last_mut().expect("the errors without effects") = self.errors(&course.now);
                    course.last[effect] = Some(tried);
                    continue;
                }
            }
            place += 1;
        }
        Ok(())
    }

    /// Drop effects that others made needless, one after the other; intervals of the parameters of the others.
    fn drop_redundant(&self, course: &mut Course) -> Vec<Option<[f64; 2]>> {
        let effects = self.model.effects();
        loop {
            let intervals = self.intervals(&course.now, !self.model.is_costly());
            let Some(place) = self.redundant(&intervals, &course.chosen) else {
                return intervals;
            };
            let effect = course.chosen.remove(place);
            course.ladder.remove(place + 1);
            let (mut active, mut theta) = (course.now.active.clone(), course.now.theta.clone());
            active.retain(|slot| !effects[effect].slots.contains(slot));
            for &slot in &effects[effect].slots {
                theta[slot] = self.model.parameters()[slot].neutral;
            }
            course.now = self.fit(self.at(active, theta), TAKEN_STEPS);
            *course.ladder.last_mut().expect("the errors without effects") = self.errors(&course.now);
            if let Some(tried) = &mut course.last[effect] {
                tried.rejected = Some(RefitRejection::Nothing);
            }
        }
    }

    /// Place of an effect that others made needless: the intervals of its values include no effect, and none changes it.
    fn redundant(&self, intervals: &[Option<[f64; 2]>], chosen: &[usize]) -> Option<usize> {
        let effects = self.model.effects();
        chosen.iter().position(|&e| {
            let is_base = chosen.iter().any(|&other| effects[other].after.contains(&e));
            !is_base
                && effects[e]
                    .slots
                    .iter()
                    .all(|&slot| self.includes_neutral(slot, intervals))
        })
    }

    /// Take effects that have a value for each group.
    fn add_values_of_groups(&self, course: &mut Course, intervals: &mut [Option<[f64; 2]>]) {
        let effects = self.model.effects();
        let across: Vec<usize> = (0..effects.len())
            .filter(|&e| effects[e].across.is_some() && self.has_base(e, &course.chosen))
            .collect();
        for effect in across {
            let (tried, theta, own) = self.by_group(effect, &course.now);
            if tried.rejected.is_none() {
                course.chosen.push(effect);
                course.now = self.at(std::mem::take(&mut course.now.active), theta);
                course.ladder.push(self.errors(&course.now));
                effects[effect].slots.iter().for_each(|&s| intervals[s] = own[s]);
            }
            course.last[effect] = Some(tried);
        }
    }

    /// An effect with a value for each group, fitted to all measurements with all else as it was found: no group predicts the
    /// value of another, so those that were not fitted have theirs too. Single measurements of a group predict the others. With
    /// the values of all parameters and their intervals.
    fn by_group(&self, effect: usize, now: &State) -> (RefitTried, Vec<f64>, Vec<Option<[f64; 2]>>) {
        let plan = RefitPlan {
            fitted: vec![true; self.model.count()],
            ways: self.plan.ways.clone(),
        };
        let all = Selection {
            model: self.model,
            plan: &plan,
        };
        let before = all.at(Vec::new(), now.theta.clone());
        let after = all.fit(all.with(&before, effect), TRIAL_STEPS);
        let judged = all.judge(&after);
        let intervals = judged.intervals.clone();
        let tried = all.tried(effect, &after, judged, &all.errors(&before));
        (tried, after.theta, intervals)
    }

    /// Effects as each explains what a selection leaves.
    ///
    /// # Errors
    /// If the user stopped it.
    pub(super) fn beside(
        &self,
        found: &RefitFinding,
        effects: &[usize],
        progress: &dyn Progress,
    ) -> Result<Vec<RefitTried>> {
        let (all, mut theta) = (self.model.effects(), found.theta.clone());
        theta.extend(self.model.parameters().iter().skip(theta.len()).map(|p| p.neutral));
        let of_bench = found.chosen.iter().filter(|e| all[**e].across.is_none());
        let active = of_bench.flat_map(|&e| all[e].slots.clone()).collect();
        let now = self.at(active, theta);
        let before = self.errors(&now);
        progress.begin("patterns of the residual", effects.len() as u64);
        let try_one = |&effect: &usize| {
            progress.check_stopped()?;
            progress.advance(1);
            Ok(if all[effect].across.is_some() {
                self.by_group(effect, &now).0
            } else {
                let state = self.fit(self.with(&now, effect), TRIAL_STEPS);
                self.try_last(effect, &state, &before)
            })
        };
        effects.iter().map(try_one).collect()
    }

    fn finding(&self, course: Course, intervals: Vec<Option<[f64; 2]>>) -> RefitFinding {
        let effects = self.model.effects();
        let Course {
            now,
            chosen,
            ladder,
            mut last,
            ..
        } = course;
        let before = ladder.last().expect("the errors without effects");
        let mut order = chosen.clone();
        order.extend((0..effects.len()).filter(|e| !chosen.contains(e)));
        let tried = order.into_iter().map(|e| {
            let missing = effects[e].after.iter().find(|b| !chosen.contains(b));
            last[e].take().unwrap_or_else(|| RefitTried {
                effect: e,
                score: 0.0,
                gain: NO_GAIN,
                values: self.values(e, &now.theta),
                errors: before.clone(),
                rejected: missing.map(|&b| RefitRejection::NoBase(effects[b].name.clone())),
            })
        });
        RefitFinding {
            tried: tried.collect(),
            chosen,
            ladder,
            theta: now.theta,
            intervals,
            by_group: Vec::new(),
            belongings: Vec::new(),
            worse: Vec::new(),
        }
    }

    fn judge(&self, state: &State) -> Judged {
        Judged {
            errors: self.errors(state),
            intervals: self.intervals(state, false),
        }
    }

    /// An effect as if it were tried last.
    pub(super) fn try_last(&self, effect: usize, after: &State, before: &RefitErrors) -> RefitTried {
        self.tried(effect, after, self.judge(after), before)
    }

    fn tried(&self, effect: usize, after: &State, judged: Judged, before: &RefitErrors) -> RefitTried {
        let gains = self.gains(effect, &judged.errors, before);
        RefitTried {
            effect,
            score: share_removed(before, &judged.errors),
            gain: gains.first().map_or(NO_GAIN, |(_, gain)| *gain),
            values: self.values(effect, &after.theta),
            rejected: self.rejection(effect, after, &judged, before),
            errors: judged.errors,
        }
    }

    /// Gains in each way of leaving out that judges an effect.
    fn gains(&self, effect: usize, errors: &RefitErrors, before: &RefitErrors) -> Vec<(usize, Gain)> {
        let across = match self.model.scope(effect) {
            RefitScope::One { way, .. } => Some(way),
            _ => self.model.effects()[effect].across,
        };
        (0..self.plan.ways.len())
            .filter(|&w| Some(w) != across && errors.held_out[w].is_some())
            .map(|w| (w, gain(&before.own[w], &errors.own[w])))
            .collect()
    }

    fn rejection(&self, effect: usize, after: &State, judged: &Judged, before: &RefitErrors) -> Option<RefitRejection> {
        let (slots, parameters) = (&self.model.effects()[effect].slots, self.model.parameters());
        let Judged { errors, intervals } = judged;
        let gains = self.gains(effect, errors, before);
        let score = share_removed(before, errors);
        let at_end = |&slot: &usize| {
            let (p, v) = (&parameters[slot], after.theta[slot]);
            (v == p.range.0 || v == p.range.1) && v != p.neutral
        };
        let way = |w: usize| &self.plan.ways[w].name;
        // A figure that is no number explains nothing.
        if score.is_nan() || score < self.model.least_share() {
            Some(RefitRejection::Little(score))
        } else if let Some((w, _)) = gains.iter().find(|(_, gain)| gain.value < 0.0) {
            let worst = self
                .worse_group(*w, before, errors)
                .map(|group| format!(", most for {group}"));
            Some(RefitRejection::Worse {
                what: format!("rms where each {} is left out{}", way(*w), worst.unwrap_or_default()),
                before: before.held_out[*w].unwrap_or(0.0),
                after: errors.held_out[*w].unwrap_or(0.0),
            })
        } else if let Some(worse) = self.worse_in_a_group(effect, before, errors) {
            Some(worse)
        } else if let Some(worse) = self.worse(before, errors) {
            Some(worse)
        } else if let Some((w, _)) = gains.iter().find(|(_, gain)| gain.interval[0] <= 0.0) {
            Some(RefitRejection::Unsure {
                way: way(*w).clone(),
                worse: self.worse_group(*w, before, errors),
            })
        } else if slots.iter().any(at_end) {
            Some(RefitRejection::Unphysical)
        } else if slots.iter().all(|&slot| self.includes_neutral(slot, intervals)) {
            Some(RefitRejection::Nothing)
        } else {
            None
        }
    }

    /// Rejection by one of the groups that an effect has to hold in: its measurements, as they are left out in the first way.
    fn worse_in_a_group(&self, effect: usize, before: &RefitErrors, after: &RefitErrors) -> Option<RefitRejection> {
        let RefitScope::Every { way } = self.model.scope(effect) else {
            return None;
        };
        let own = &self.plan.ways[way];
        let mut groups = self.groups(own);
        groups.sort_by_key(|&group| self.model.group_order(way, group));
        let rms = |errors: &RefitErrors, group: usize| {
            let left = errors.own[0].iter().zip(&own.groups).filter(|(_, g)| **g == group);
            let (sum, n) = left
                .filter_map(|(v, _)| *v)
                .fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            (sum / f64::max(n, 1.0)).sqrt()
        };
        let worse = |&group: &usize| rms(after, group) > (1.0 + MAY_GROW) * rms(before, group);
        let group = groups.into_iter().find(worse)?;
        Some(RefitRejection::Worse {
            what: format!(
                "{} `{}` where each {} is left out",
                own.name,
                self.model.group_name(way, group),
                self.plan.ways[0].name
            ),
            before: rms(before, group),
            after: rms(after, group),
        })
    }

    /// Rejection by a figure of measurements that were never fitted.
    fn worse(&self, before: &RefitErrors, after: &RefitErrors) -> Option<RefitRejection> {
        let names = self.model.figure_names();
        let pairs = before.figures[1].iter().zip(&after.figures[1]).enumerate();
        let (k, (before, after)) =
            { pairs }.find(|(k, (b, a))| self.model.decides(*k) && **a > (1.0 + MAY_GROW) * **b)?;
        Some(RefitRejection::Worse {
            what: format!("{} of measurements that were not fitted", names[k].0),
            before: *before,
            after: *after,
        })
    }

    /// True if the effects that an effect changes were taken.
    fn has_base(&self, effect: usize, chosen: &[usize]) -> bool {
        let mut after = self.model.effects()[effect].after.iter();
        after.all(|base| chosen.contains(base))
    }

    /// True if the interval of a parameter includes its value without an effect.
    fn includes_neutral(&self, slot: usize, intervals: &[Option<[f64; 2]>]) -> bool {
        intervals[slot].is_some_and(|[low, high]| (low..=high).contains(&self.model.parameters()[slot].neutral))
    }

    fn values(&self, effect: usize, theta: &[f64]) -> Vec<f64> {
        self.model.effects()[effect].slots.iter().map(|&s| theta[s]).collect()
    }
}

const NO_GAIN: Gain = Gain {
    value: 0.0,
    interval: [0.0; 2],
};

/// Share of the fitted mean square that is gone.
pub(super) fn share_removed(before: &RefitErrors, after: &RefitErrors) -> f64 {
    1.0 - (after.fitted / before.fitted.max(f64::MIN_POSITIVE)).powi(2)
}
