//! Errors of measurements that are left out of a fit, and the intervals that leaving out gives.

use rayon::prelude::*;

use super::finding::RefitErrors;
use super::fit::State;
use super::model::LeaveOut;
use super::selection::Selection;
use crate::fit::normal_equations::hold;
use crate::fit::{Gain, minimise};

/// Information on a parameter, relative to that of all measurements, below which others do not predict it.
pub(super) const UNINFORMED: f64 = 1e-3;

/// Groups up to which each is left out of a fit in full. One of more moves a fit so little that the linear model holds.
const FEW_GROUPS: usize = 12;

/// Steps of a fit without a group, which starts from the linear model.
const LEFT_OUT_STEPS: usize = 6;

impl Selection<'_> {
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

    /// Steps of the active parameters by a full fit without one group: a step of the linear model from the fit of all is too short where the model bends.
    fn refitted_without(&self, now: &State, way: &LeaveOut, group: usize) -> Vec<(usize, f64)> {
        let mut plan = self.plan.clone();
        for (fitted, own) in plan.fitted.iter_mut().zip(&way.groups) {
            *fitted &= *own != group;
        }
        let (mut theta, parameters) = (now.theta.clone(), self.model.parameters());
        for (k, step) in self.without(now, way, group) {
            theta[now.active[k]] += step;
        }
        let informed = |slot: &usize| theta[*slot] != parameters[*slot].neutral;
        let active = now.active.iter().copied().filter(informed).collect();
        let others = Selection {
            model: self.model,
            plan: &plan,
        };
        let found = others.fit(others.at(active, theta), LEFT_OUT_STEPS).theta;
        let steps = now.active.iter().map(|&slot| found[slot] - now.theta[slot]);
        steps.enumerate().collect()
    }

    /// Groups of fitted measurements in a way.
    pub(super) fn groups(&self, way: &LeaveOut) -> Vec<usize> {
        let fitted = way.groups.iter().zip(&self.plan.fitted).filter(|(_, f)| **f);
        let mut groups: Vec<usize> = fitted.map(|(g, _)| *g).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }

    pub(super) fn errors(&self, now: &State) -> RefitErrors {
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

    /// Group of a way that an effect predicts worse than before, and most so; none if it predicts none worse.
    pub(super) fn worse_group(&self, way: usize, before: &RefitErrors, after: &RefitErrors) -> Option<String> {
        let groups = &self.plan.ways[way].groups;
        let change = |&group: &usize| -> f64 {
            let own = (0..groups.len()).filter(|&m| groups[m] == group);
            own.filter_map(|m| Some(after.own[way][m]? - before.own[way][m]?)).sum()
        };
        let fitted = self.groups(&self.plan.ways[way]);
        let worst = fitted.into_iter().max_by(|a, b| change(a).total_cmp(&change(b)))?;
        (change(&worst) > 0.0).then(|| self.model.group_name(way, worst))
    }

    /// 95 % intervals by leaving out each group in turn (jackknife): the widest of all ways that tell of a parameter. Groups, if
    /// there are few, are left out of a fit in full if so asked, and otherwise of the linear model.
    pub(super) fn intervals(&self, now: &State, in_full: bool) -> Vec<Option<[f64; 2]>> {
        let mut out = vec![None; now.theta.len()];
        let mut widths = vec![0.0_f64; now.active.len()];
        for way in &self.plan.ways {
            let groups = self.groups(way);
            if groups.len() < 3 {
                continue;
            }
            let steps = groups.iter().map(|&g| {
                if in_full && groups.len() <= FEW_GROUPS {
                    self.refitted_without(now, way, g)
                } else {
                    self.without(now, way, g)
                }
            });
            let steps: Vec<_> = steps.collect();
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
pub(super) fn gain(before: &[Option<f64>], after: &[Option<f64>]) -> Gain {
    let pairs = before.iter().zip(after).filter_map(|(b, a)| Some((*b)? - (*a)?));
    let gains: Vec<f64> = pairs.collect();
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let half = student_95(gains.len() - 1) * (variance / n).sqrt();
    Gain {
        value: mean,
        interval: [mean - half, mean + half],
    }
}

/// Half of a 95 % interval in standard deviations that were estimated with some degrees of freedom (Student).
pub(super) fn student_95(degrees: usize) -> f64 {
    const FEW: [f64; 9] = [12.71, 12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31];
    FEW.get(degrees).copied().unwrap_or(1.96 + 2.6 / degrees as f64)
}

fn root_mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    (n > 0.0).then(|| (sum / n).sqrt())
}
