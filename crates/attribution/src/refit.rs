//! Selection of effects for forward models that cost so little that every candidate is fitted in full.
//!
//! A candidate is fitted beside the effects that were taken, and judged by measurements that were left out: groups and
//! objects in turn, and measurements that were never fitted. It is taken if it predicts them better in each way of leaving out.
//! One that fits better and predicts worse is refused by name.

use metalith_core::{Error, Progress, Result};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::fit::minimise;
use crate::fit::normal_equations::hold;

/// A parameter of an effect.
#[derive(Clone, Debug)]
pub struct RefitParameter {
    pub name: String,
    pub unit: &'static str,
    /// Value without an effect.
    pub neutral: f64,
    /// Value that a fit starts from.
    pub start: f64,
    /// Physical limits.
    pub range: (f64, f64),
    /// Number that is shown for a value, rising with it: the width of a blur for its variance.
    pub shown: fn(f64) -> f64,
}

/// An effect that may explain a residual.
#[derive(Clone, Debug)]
pub struct RefitEffect {
    pub name: String,
    /// Parameters, as slots of the model.
    pub slots: Vec<usize>,
    /// Effects that it changes, which must have been taken before.
    pub after: Vec<usize>,
    /// Way of leaving out whose groups have a value each, also those that are not fitted. It is tried after all others.
    pub across: Option<usize>,
}

/// Normal equations of one measurement over active parameters and the residual, nuisances eliminated.
pub struct RefitEquations {
    /// Sums of squares that a fit minimises.
    pub fit: DMatrix<f64>,
    /// Sums of squares that a prediction is judged by.
    pub judged: DMatrix<f64>,
}

impl RefitEquations {
    /// Equations by which a prediction is fitted and judged alike.
    pub fn alike(form: DMatrix<f64>) -> Self {
        Self {
            judged: form.clone(),
            fit: form,
        }
    }
}

/// A forward model of measurements that is fitted in full for each candidate.
pub trait RefitModel: Sync {
    /// Parameters of all effects, by slot.
    fn parameters(&self) -> &[RefitParameter];

    /// Effects that are tried.
    fn effects(&self) -> &[RefitEffect];

    /// Number of measurements.
    fn count(&self) -> usize;

    /// Number of points of a measurement.
    fn points(&self, measurement: usize) -> f64;

    /// Normal equations of a measurement about parameter values.
    fn equations(&self, measurement: usize, active: &[usize], theta: &[f64]) -> RefitEquations;

    /// Names of the figures of merit that judge a prediction, each with its unit; smaller is better.
    fn figure_names(&self) -> Vec<(&'static str, &'static str)>;

    /// Whether two effects at once are tried where none alone helps any more, and not only at the start: a fit must cost next to
    /// nothing.
    fn tries_pairs(&self) -> bool {
        false
    }

    /// Whether the figure of several measurements is the mean; the root of the mean square if not.
    fn is_mean(&self, _figure: usize) -> bool {
        false
    }

    /// Figures of merit of a measurement.
    fn figures(&self, measurement: usize, theta: &[f64]) -> Vec<f64>;

    /// Whether an effect is refused that makes a figure of measurements worse that were never fitted.
    fn decides(&self, figure: usize) -> bool;
}

/// A way of leaving measurements out.
#[derive(Clone, Debug)]
pub struct LeaveOut {
    /// Common noun of a group: plate, field, height.
    pub name: String,
    /// Group of each measurement.
    pub groups: Vec<usize>,
}

/// Roles of measurements.
#[derive(Clone, Debug)]
pub struct RefitPlan {
    /// Whether each measurement is fitted; the others judge.
    pub fitted: Vec<bool>,
    pub ways: Vec<LeaveOut>,
}

/// Errors with some effects: what was fitted, what was left out, what was never fitted.
#[derive(Clone, Debug)]
pub struct RefitErrors {
    /// Root mean square of the fitted residual.
    pub fitted: f64,
    /// Root mean square of the residual of measurements left out, in each way; none where nothing is predicted.
    pub held_out: Vec<Option<f64>>,
    /// Figures of merit of what was fitted, and of what was never fitted.
    pub figures: [Vec<f64>; 2],
    /// Mean square of each measurement when it was left out, in each way.
    own: Vec<Vec<Option<f64>>>,
}

/// Reason why an effect is not taken.
#[derive(Clone, Debug, PartialEq)]
pub enum RefitRejection {
    /// It lowers the mean square by so small a share.
    Little(f64),
    /// Measurements that were left out, in this way, are not surely predicted better.
    Unsure(String),
    /// It fits better, and predicts measurements worse that were left out: what they are, the error before and after.
    Worse { what: String, before: f64, after: f64 },
    /// The 95 % interval of its values includes those without it.
    Nothing,
    /// Its value is at the end of the physical range.
    Unphysical,
    /// It changes an effect that was not taken.
    NoBase(String),
}

impl RefitRejection {
    /// One clause for a person.
    pub fn sentence(&self) -> String {
        match self {
            Self::Little(share) => format!("lowers the fitted mean square by {:.1} % only", 100.0 * share),
            Self::Unsure(way) => format!("the 95 % interval of its gain includes zero where each {way} is left out"),
            Self::Worse { what, before, after } => {
                format!("fits better and predicts worse: {what} {before:.4} before, {after:.4} with it")
            }
            Self::Nothing => "the 95 % interval of its value includes no effect".into(),
            Self::Unphysical => "its fitted value is at the end of its physical range".into(),
            Self::NoBase(name) => format!("it changes `{name}`, which was not found"),
        }
    }
}

/// An effect as it was tried last.
#[derive(Clone, Debug)]
pub struct RefitTried {
    pub effect: usize,
    /// Share of the fitted mean square that it removes.
    pub score: f64,
    /// Gain in mean square of measurements left out, with the ends of its 95 % interval.
    pub gain: (f64, [f64; 2]),
    /// Values of its parameters.
    pub values: Vec<f64>,
    pub errors: RefitErrors,
    /// None if it was taken.
    pub rejected: Option<RefitRejection>,
}

/// Outcome of a selection.
#[derive(Clone, Debug)]
pub struct RefitFinding {
    /// Effects in the order in which they were taken.
    pub chosen: Vec<usize>,
    /// Errors before, and after each of them.
    pub ladder: Vec<RefitErrors>,
    /// All effects as they were tried last, those taken first.
    pub tried: Vec<RefitTried>,
    /// Values of all parameters.
    pub theta: Vec<f64>,
    /// 95 % interval of each parameter; none of one that was not fitted.
    pub intervals: Vec<Option<[f64; 2]>>,
}

/// Least share of the fitted mean square that an effect removes.
const LEAST_SHARE: f64 = 0.004;

/// A figure of measurements that were never fitted may grow by this share: rounding, and steps of a fit that end early.
const MAY_GROW: f64 = 0.002;

/// Two effects are taken at once if they gain by this share more than the best one alone.
const PAIR_SHARE: f64 = 0.1;

/// Steps of a fit: of a candidate, and of what was taken.
const STEPS: [usize; 2] = [5, 12];

/// A fit ends when a step lowers the mean square by less than this share.
const CONVERGED: f64 = 1e-5;

/// Information on a parameter, relative to that of all measurements, below which others do not predict it.
const UNINFORMED: f64 = 1e-3;

/// Select the effects that explain measurements.
///
/// # Errors
/// If the user stopped it.
pub fn select(model: &dyn RefitModel, plan: &RefitPlan, progress: &dyn Progress) -> Result<RefitFinding> {
    Selection { model, plan }.run(progress)
}

/// A fit: values, and the equations of all measurements about them.
struct State {
    active: Vec<usize>,
    theta: Vec<f64>,
    equations: Vec<RefitEquations>,
    /// Sum over what is fitted.
    total: DMatrix<f64>,
}

impl State {
    fn sum_of_squares(&self) -> f64 {
        let last = self.total.nrows() - 1;
        self.total[(last, last)]
    }
}

struct Selection<'a> {
    model: &'a dyn RefitModel,
    plan: &'a RefitPlan,
}

impl Selection<'_> {
    fn run(&self, progress: &dyn Progress) -> Result<RefitFinding> {
        let effects = self.model.effects();
        let neutral = self.model.parameters().iter().map(|p| p.neutral).collect();
        let mut now = self.at(Vec::new(), neutral);
        let mut ladder = vec![self.errors(&now)];
        let mut chosen: Vec<usize> = Vec::new();
        let mut last: Vec<Option<RefitTried>> = vec![None; effects.len()];
        loop {
            let open: Vec<usize> = (0..effects.len())
                .filter(|&e| effects[e].across.is_none() && !chosen.contains(&e) && self.has_base(e, &chosen))
                .collect();
            progress.begin(&format!("effects, step {}", chosen.len() + 1), open.len() as u64);
            let before = &ladder[ladder.len() - 1].clone();
            let mut best: Option<(f64, State, RefitTried)> = None;
            for &effect in &open {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                progress.note(&effects[effect].name);
                let state = self.fit(self.with(&now, effect), STEPS[0]);
                let tried = self.judge(effect, &state, before);
                progress.advance(1);
                if tried.rejected.is_none() && best.as_ref().is_none_or(|(most, ..)| tried.gain.0 > *most) {
                    best = Some((tried.gain.0, state, tried.clone()));
                }
                last[effect] = Some(tried);
            }
            if chosen.is_empty() || best.is_none() && self.model.tries_pairs() {
                let least = best.as_ref().map_or(0.0, |(gain, ..)| *gain);
                if let Some((pair, state)) = self.pair(&now, &open, before, least, progress)? {
                    for (k, effect) in pair.into_iter().enumerate() {
                        let with = match k {
                            0 => self.fit(self.with(&now, effect), STEPS[1]),
                            _ => self.fit(self.at(state.active.clone(), state.theta.clone()), STEPS[1]),
                        };
                        let tried = self.judge(effect, &with, before);
                        chosen.push(effect);
                        ladder.push(tried.errors.clone());
                        last[effect] = Some(RefitTried {
                            rejected: None,
                            ..tried
                        });
                        if k == 1 {
                            now = with;
                        }
                    }
                    continue;
                }
            }
            let Some((_, state, tried)) = best else { break };
            now = self.fit(state, STEPS[1]);
            chosen.push(tried.effect);
            let errors = self.errors(&now);
            last[tried.effect] = Some(RefitTried {
                errors: errors.clone(),
                values: effects[tried.effect].slots.iter().map(|&s| now.theta[s]).collect(),
                ..tried
            });
            ladder.push(errors);
        }
        while let Some(place) = self.redundant(&now, &chosen) {
            let effect = chosen.remove(place);
            ladder.remove(place + 1);
            let (mut active, mut theta) = (now.active.clone(), now.theta.clone());
            active.retain(|slot| !effects[effect].slots.contains(slot));
            for &slot in &effects[effect].slots {
                theta[slot] = self.model.parameters()[slot].neutral;
            }
            now = self.fit(self.at(active, theta), STEPS[1]);
            *ladder.last_mut().expect("the errors without effects") = self.errors(&now);
            if let Some(tried) = &mut last[effect] {
                tried.rejected = Some(RefitRejection::Nothing);
            }
        }
        let mut intervals = self.intervals(&now);
        let across: Vec<usize> = (0..effects.len())
            .filter(|&e| effects[e].across.is_some() && self.has_base(e, &chosen))
            .collect();
        for effect in across {
            let (tried, state, own) = self.by_group(effect, &now);
            if tried.rejected.is_none() {
                chosen.push(effect);
                now = self.at(now.active, state.theta);
                ladder.push(self.errors(&now));
                effects[effect].slots.iter().for_each(|&s| intervals[s] = own[s]);
            }
            last[effect] = Some(tried);
        }
        let before = ladder.last().expect("the errors without effects");
        let mut order = chosen.clone();
        order.extend((0..effects.len()).filter(|e| !chosen.contains(e)));
        let tried = order.into_iter().map(|e| {
            let missing = effects[e].after.iter().find(|b| !chosen.contains(b));
            last[e].take().unwrap_or_else(|| RefitTried {
                effect: e,
                score: 0.0,
                gain: (0.0, [0.0; 2]),
                values: effects[e].slots.iter().map(|&s| now.theta[s]).collect(),
                errors: before.clone(),
                rejected: missing.map(|&b| RefitRejection::NoBase(effects[b].name.clone())),
            })
        });
        Ok(RefitFinding {
            tried: tried.collect(),
            chosen,
            ladder,
            theta: now.theta,
            intervals,
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
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let state = self.fit(self.with(&self.with(now, pair[0]), pair[1]), STEPS[0]);
            progress.advance(1);
            // Each of both must hold as if it were tried last.
            let tried = pair.map(|effect| self.judge(effect, &state, before));
            if tried.iter().any(|t| t.rejected.is_some()) {
                continue;
            }
            let gain = tried[0].gain.0;
            if gain > best.as_ref().map_or((1.0 + PAIR_SHARE) * least, |(most, ..)| *most) {
                best = Some((gain, pair, state));
            }
        }
        Ok(best.map(|(_, pair, state)| (pair, state)))
    }

    /// Place of an effect that others made needless: the intervals of its values include no effect, and none changes it.
    fn redundant(&self, now: &State, chosen: &[usize]) -> Option<usize> {
        let (effects, intervals) = (self.model.effects(), self.intervals(now));
        let neutral = |&slot: &usize| {
            let value = self.model.parameters()[slot].neutral;
            intervals[slot].is_some_and(|[low, high]| (low..=high).contains(&value))
        };
        chosen.iter().position(|&e| {
            let is_base = chosen.iter().any(|&other| effects[other].after.contains(&e));
            !is_base && effects[e].slots.iter().all(neutral)
        })
    }

    /// Whether the effects that an effect changes were taken.
    fn has_base(&self, effect: usize, chosen: &[usize]) -> bool {
        self.model.effects()[effect]
            .after
            .iter()
            .all(|base| chosen.contains(base))
    }

    /// An effect with a value for each group, fitted to all measurements with all else as it was found: no group predicts the
    /// value of another, so those that were not fitted have theirs too. Single measurements of a group predict the others.
    fn by_group(&self, effect: usize, now: &State) -> (RefitTried, State, Vec<Option<[f64; 2]>>) {
        let plan = RefitPlan {
            fitted: vec![true; self.model.count()],
            ways: self.plan.ways.clone(),
        };
        let all = Selection {
            model: self.model,
            plan: &plan,
        };
        let before = all.at(Vec::new(), now.theta.clone());
        let after = all.fit(all.with(&before, effect), STEPS[0]);
        let tried = all.judge(effect, &after, &all.errors(&before));
        let intervals = all.intervals(&after);
        (tried, after, intervals)
    }

    /// Equations of all measurements about some values.
    fn at(&self, active: Vec<usize>, theta: Vec<f64>) -> State {
        let equations: Vec<_> = (0..self.model.count())
            .into_par_iter()
            .map(|m| self.model.equations(m, &active, &theta))
            .collect();
        let size = active.len() + 1;
        let mut total = DMatrix::zeros(size, size);
        for (form, _) in equations.iter().zip(&self.plan.fitted).filter(|(_, fitted)| **fitted) {
            total += &form.fit;
        }
        State {
            active,
            theta,
            equations,
            total,
        }
    }

    /// A state with one effect more, where its fit begins.
    fn with(&self, now: &State, effect: usize) -> State {
        let (mut active, mut theta) = (now.active.clone(), now.theta.clone());
        for &slot in &self.model.effects()[effect].slots {
            active.push(slot);
            theta[slot] = self.model.parameters()[slot].start;
        }
        self.at(active, theta)
    }

    /// Least squares by Levenberg and Marquardt.
    fn fit(&self, mut now: State, steps: usize) -> State {
        let size = now.active.len();
        let free: Vec<usize> = (0..size).collect();
        let mut damping = 1e-6;
        for _ in 0..steps {
            let mut form = now.total.clone();
            for k in 0..size {
                form[(k, k)] *= 1.0 + damping;
            }
            let (step, _) = minimise(&form, &free);
            let mut theta = now.theta.clone();
            for (&slot, step) in now.active.iter().zip(step.iter()) {
                let (low, high) = self.model.parameters()[slot].range;
                theta[slot] = (theta[slot] + step).clamp(low, high);
            }
            let next = self.at(now.active.clone(), theta);
            let gain = now.sum_of_squares() - next.sum_of_squares();
            if gain > 0.0 {
                let small = gain < CONVERGED * now.sum_of_squares();
                now = next;
                damping = (damping * 0.1).max(1e-9);
                if small {
                    break;
                }
            } else {
                damping = (damping * 100.0).max(1e-2);
            }
        }
        now
    }

    /// Steps of the active parameters that all fitted measurements but those of one group ask for. A parameter of which these
    /// tell nothing has no effect.
    fn without(&self, now: &State, way: &LeaveOut, group: usize) -> Vec<(usize, f64)> {
        let mut train = now.total.clone();
        for (m, form) in now.equations.iter().enumerate() {
            if self.plan.fitted[m] && way.groups[m] == group {
                train -= &form.fit;
            }
        }
        let parameters = self.model.parameters();
        let mut at: Vec<(usize, f64)> = Vec::new();
        for (k, &slot) in now.active.iter().enumerate() {
            if train[(k, k)] < UNINFORMED * now.total[(k, k)] {
                at.push((k, parameters[slot].neutral - now.theta[slot]));
            }
        }
        let free: Vec<usize> = (0..now.active.len())
            .filter(|k| at.iter().all(|(h, _)| h != k))
            .collect();
        let (step, _) = minimise(&hold(&train, &at), &free);
        for (&k, step) in free.iter().zip(step.iter()) {
            let (slot, (low, high)) = (now.active[k], parameters[now.active[k]].range);
            at.push((k, (now.theta[slot] + step).clamp(low, high) - now.theta[slot]));
        }
        at.sort_by_key(|(k, _)| *k);
        at
    }

    /// Number of groups of fitted measurements in a way.
    fn groups(&self, way: &LeaveOut) -> Vec<usize> {
        let fitted = way.groups.iter().zip(&self.plan.fitted).filter(|(_, f)| **f);
        let mut groups: Vec<usize> = fitted.map(|(g, _)| *g).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }

    fn errors(&self, now: &State) -> RefitErrors {
        let count = self.model.count();
        let mut own = vec![vec![None; count]; self.plan.ways.len()];
        for (way, own) in self.plan.ways.iter().zip(&mut own) {
            let groups = self.groups(way);
            if groups.len() < 2 {
                continue;
            }
            for group in groups {
                let at = self.without(now, way, group);
                let last = now.active.len();
                for m in (0..count).filter(|&m| self.plan.fitted[m] && way.groups[m] == group) {
                    let left = hold(&now.equations[m].judged, &at)[(last, last)];
                    own[m] = Some(left / self.model.points(m));
                }
            }
        }
        let fitted = || (0..count).filter(|&m| self.plan.fitted[m]);
        let last = now.active.len();
        let judged = fitted().map(|m| now.equations[m].judged[(last, last)] / self.model.points(m));
        let figures: Vec<Vec<f64>> = (0..count)
            .into_par_iter()
            .map(|m| self.model.figures(m, &now.theta))
            .collect();
        let of = |fitted: bool, k: usize| {
            let own = (0..count)
                .filter(|&m| self.plan.fitted[m] == fitted)
                .map(|m| figures[m][k]);
            if self.model.is_mean(k) {
                root_mean(own).map(|mean| mean.powi(2))
            } else {
                root_mean(own.map(|v| v * v))
            }
        };
        let names = self.model.figure_names().len();
        RefitErrors {
            fitted: root_mean(judged).unwrap_or(0.0),
            held_out: own.iter().map(|own| root_mean(own.iter().flatten().copied())).collect(),
            figures: [true, false].map(|fitted| (0..names).filter_map(|k| of(fitted, k)).collect()),
            own,
        }
    }

    fn judge(&self, effect: usize, after: &State, errors_before: &RefitErrors) -> RefitTried {
        let own = &self.model.effects()[effect];
        let errors = self.errors(after);
        let score = 1.0 - (errors.fitted / errors_before.fitted.max(f64::MIN_POSITIVE)).powi(2);
        let ways = (0..self.plan.ways.len()).filter(|w| Some(*w) != own.across);
        let gains: Vec<(usize, (f64, [f64; 2]))> = ways
            .filter(|&w| errors.held_out[w].is_some())
            .map(|w| (w, gain(&errors_before.own[w], &errors.own[w])))
            .collect();
        let intervals = self.intervals(after);
        let parameters = self.model.parameters();
        let at_end = |&slot: &usize| {
            let (p, v) = (&parameters[slot], after.theta[slot]);
            (v == p.range.0 || v == p.range.1) && v != p.neutral
        };
        let includes =
            |&slot: &usize| intervals[slot].is_some_and(|[low, high]| (low..=high).contains(&parameters[slot].neutral));
        let way = |w: usize| &self.plan.ways[w].name;
        let rejected = if score < LEAST_SHARE {
            Some(RefitRejection::Little(score))
        } else if let Some((w, _)) = gains.iter().find(|(_, (value, _))| *value < 0.0) {
            Some(RefitRejection::Worse {
                what: format!("rms where each {} is left out", way(*w)),
                before: errors_before.held_out[*w].unwrap_or(0.0),
                after: errors.held_out[*w].unwrap_or(0.0),
            })
        } else if let Some(worse) = self.worse(errors_before, &errors) {
            Some(worse)
        } else if let Some((w, _)) = gains.iter().find(|(_, (_, interval))| interval[0] <= 0.0) {
            Some(RefitRejection::Unsure(way(*w).clone()))
        } else if own.slots.iter().any(at_end) {
            Some(RefitRejection::Unphysical)
        } else if own.slots.iter().all(includes) {
            Some(RefitRejection::Nothing)
        } else {
            None
        };
        RefitTried {
            effect,
            score,
            gain: gains.first().map_or((0.0, [0.0; 2]), |(_, gain)| *gain),
            values: own.slots.iter().map(|&s| after.theta[s]).collect(),
            errors,
            rejected,
        }
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

    /// 95 % intervals by leaving out each group in turn (jackknife): the widest of all ways that tell of a parameter.
    fn intervals(&self, now: &State) -> Vec<Option<[f64; 2]>> {
        let mut out = vec![None; now.theta.len()];
        let mut widths = vec![0.0_f64; now.active.len()];
        for way in &self.plan.ways {
            let groups = self.groups(way);
            if groups.len() < 3 {
                continue;
            }
            let steps: Vec<_> = groups.iter().map(|&g| self.without(now, way, g)).collect();
            for (k, width) in widths.iter_mut().enumerate() {
                let informed = |&g: &usize| {
                    let members = (0..now.equations.len()).filter(|&m| self.plan.fitted[m] && way.groups[m] == g);
                    let own: f64 = members.map(|m| now.equations[m].fit[(k, k)]).sum();
                    own < (1.0 - UNINFORMED) * now.total[(k, k)]
                };
                if !groups.iter().all(informed) {
                    continue;
                }
                let n = groups.len() as f64;
                let mean = steps.iter().map(|s| s[k].1).sum::<f64>() / n;
                let squares: f64 = steps.iter().map(|s| (s[k].1 - mean).powi(2)).sum();
                *width = width.max(student_95(groups.len() - 1) * ((n - 1.0) / n * squares).sqrt());
            }
        }
        for (k, &slot) in now.active.iter().enumerate() {
            let (low, high) = self.model.parameters()[slot].range;
            let ends = [now.theta[slot] - widths[k], now.theta[slot] + widths[k]];
            out[slot] = Some(ends.map(|v| v.clamp(low, high)));
        }
        out
    }
}

/// Mean gain of some mean squares over others, with the ends of its 95 % interval.
fn gain(before: &[Option<f64>], after: &[Option<f64>]) -> (f64, [f64; 2]) {
    let pairs = before.iter().zip(after).filter_map(|(b, a)| Some((*b)? - (*a)?));
    let gains: Vec<f64> = pairs.collect();
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let half = student_95(gains.len() - 1) * (variance / n).sqrt();
    (mean, [mean - half, mean + half])
}

/// Half of a 95 % interval in standard deviations that were estimated with some degrees of freedom (Student).
fn student_95(degrees: usize) -> f64 {
    const FEW: [f64; 9] = [12.71, 12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31];
    FEW.get(degrees).copied().unwrap_or(1.96 + 2.6 / degrees as f64)
}

fn root_mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    (n > 0.0).then(|| (sum / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const POINTS: usize = 40;
    const MEASUREMENTS: usize = 12;

    /// Straight lines of four groups: level, slope, curvature, and a level of each group.
    struct Lines {
        data: Vec<Vec<f64>>,
        parameters: Vec<RefitParameter>,
        effects: Vec<RefitEffect>,
    }

    fn x(i: usize) -> f64 {
        2.0 * i as f64 / (POINTS - 1) as f64 - 1.0
    }

    fn column(slot: usize, m: usize, i: usize) -> f64 {
        match slot {
            0 => 1.0,
            1 => x(i),
            2 => x(i).powi(2) - 1.0 / 3.0,
            group => f64::from(m % 4 == group - 3),
        }
    }

    impl Lines {
        fn new(truth: [f64; 7], seed: u64) -> Self {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut noise = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            let value = |m: usize, i: usize| (0..7).map(|s| truth[s] * column(s, m, i)).sum::<f64>();
            let data = (0..MEASUREMENTS).map(|m| (0..POINTS).map(|i| value(m, i) + 0.1 * noise()).collect());
            let parameter = |name: &str| RefitParameter {
                name: name.into(),
                unit: "nm",
                neutral: 0.0,
                start: 0.0,
                range: (-10.0, 10.0),
                shown: |v| v,
            };
            let effect = |name: &str, slots: &[usize], after: &[usize], across| RefitEffect {
                name: name.into(),
                slots: slots.to_vec(),
                after: after.to_vec(),
                across,
            };
            Self {
                data: data.collect(),
                parameters: ["level", "slope", "curvature", "a", "b", "c", "d"]
                    .map(parameter)
                    .to_vec(),
                effects: vec![
                    effect("level", &[0], &[], None),
                    effect("slope", &[1], &[], None),
                    effect("curvature", &[2], &[1], None),
                    effect("level_by_plate", &[3, 4, 5, 6], &[0], Some(0)),
                ],
            }
        }

        fn plan() -> RefitPlan {
            RefitPlan {
                fitted: (0..MEASUREMENTS).map(|m| m % 4 != 3).collect(),
                ways: vec![
                    LeaveOut {
                        name: "plate".into(),
                        groups: (0..MEASUREMENTS).map(|m| m % 4).collect(),
                    },
                    LeaveOut {
                        name: "field".into(),
                        groups: (0..MEASUREMENTS).collect(),
                    },
                ],
            }
        }
    }

    impl RefitModel for Lines {
        fn parameters(&self) -> &[RefitParameter] {
            &self.parameters
        }

        fn effects(&self) -> &[RefitEffect] {
            &self.effects
        }

        fn count(&self) -> usize {
            MEASUREMENTS
        }

        fn points(&self, _: usize) -> f64 {
            POINTS as f64
        }

        fn equations(&self, m: usize, active: &[usize], theta: &[f64]) -> RefitEquations {
            let columns = DMatrix::from_fn(POINTS, active.len() + 1, |i, k| match active.get(k) {
                Some(&slot) => column(slot, m, i),
                None => self.data[m][i] - (0..7).map(|s| theta[s] * column(s, m, i)).sum::<f64>(),
            });
            RefitEquations::alike(columns.transpose() * &columns)
        }

        fn figure_names(&self) -> Vec<(&'static str, &'static str)> {
            vec![("rms", "nm")]
        }

        fn figures(&self, m: usize, theta: &[f64]) -> Vec<f64> {
            let form = self.equations(m, &[], theta).fit;
            vec![(form[(0, 0)] / POINTS as f64).sqrt()]
        }

        fn decides(&self, _: usize) -> bool {
            true
        }
    }

    #[test]
    fn nothing_is_taken_of_pure_noise() {
        for seed in 0..20 {
            let found = select(&Lines::new([0.0; 7], seed), &Lines::plan(), &Silent).unwrap();
            assert!(found.chosen.is_empty(), "{seed}: {:?}", found.chosen);
        }
    }

    #[test]
    fn values_lie_in_their_intervals_and_groups_have_theirs() {
        let truth = [0.5, 0.3, 0.0, 0.2, 0.0, -0.2, 0.0];
        let found = select(&Lines::new(truth, 1), &Lines::plan(), &Silent).unwrap();
        let mut chosen = found.chosen.clone();
        chosen.sort_unstable();
        assert_eq!(chosen, [0, 1, 3]);
        for slot in [0, 1] {
            let [low, high] = found.intervals[slot].unwrap();
            assert!((low..=high).contains(&truth[slot]), "{slot}: {low} {high}");
        }
        let difference = found.theta[3] - found.theta[5];
        assert!((difference - 0.4).abs() < 0.05, "{difference}");
        assert!(found.ladder.last().unwrap().fitted < 0.11);
    }

    /// Measurements that were never fitted are bent the other way.
    #[test]
    fn an_effect_that_fits_better_and_predicts_worse_is_refused() {
        let mut model = Lines::new([0.5, 0.3, 0.2, 0.0, 0.0, 0.0, 0.0], 2);
        for m in (0..MEASUREMENTS).filter(|m| m % 4 == 3) {
            for i in 0..POINTS {
                model.data[m][i] -= 0.4 * column(2, m, i);
            }
        }
        let found = select(&model, &Lines::plan(), &Silent).unwrap();
        let tried = found.tried.iter().find(|t| t.effect == 2).unwrap();
        assert!(
            matches!(tried.rejected, Some(RefitRejection::Worse { .. })),
            "{tried:?}"
        );
        assert!(tried.score > 0.2, "{}", tried.score);
    }
}
