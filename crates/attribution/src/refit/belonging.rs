//! Scope of an effect: the bench, a kind of group or one group. The value of each group alone, with its interval.

use super::finding::{Belonging, GroupValue, RefitErrors, RefitFinding};
use super::fit::State;
use super::held_out::{UNINFORMED, student_95};
use super::selection::{Course, MAY_GROW, Selection, TRIAL_STEPS};

/// Half of a 95 % interval in standard deviations.
const HALF_95: f64 = 1.96;

/// Fewest measurements of a group that are left out in turn.
const FEWEST_LEFT_OUT: usize = 3;

impl Selection<'_> {
    /// Value of each active parameter in each group alone, with all else as it was found.
    pub(super) fn values_by_group(&self, now: &State) -> Vec<(usize, Vec<GroupValue>)> {
        let Some(way) = self.plan.ways.get(self.model.objects()) else {
            return Vec::new();
        };
        let last = now.active.len();
        let of_slot = |(k, &slot): (usize, &usize)| {
            let (low, high) = self.model.parameters()[slot].range;
            let own = self.groups(way).into_iter().filter_map(|group| {
                let members = (0..now.equations.len()).filter(|&m| self.plan.fitted[m] && way.groups[m] == group);
                let members: Vec<usize> = members.collect();
                let of = |m: usize| {
                    let form = &now.equations[m].fit;
                    [form[(k, k)], form[(k, last)]]
                };
                let [information, slope] = sum(members.iter().map(|&m| of(m)));
                if information <= UNINFORMED * now.total[(k, k)] {
                    return None;
                }
                let step = slope / information;
                // Residuals that err together count once.
                let scores = members.iter().map(|&m| {
                    let left = now.equations[m].fit[(last, last)] / self.model.points(m);
                    left * self.model.correlated_points(m, &now.theta) * of(m)[0]
                });
                let by_residual = HALF_95 * scores.sum::<f64>().sqrt() / information;
                let half = by_residual.max(jackknife(
                    &members.iter().map(|&m| of(m)).collect::<Vec<_>>(),
                    [information, slope],
                ));
                let at = |step: f64| (now.theta[slot] + step).clamp(low, high);
                Some(GroupValue {
                    group,
                    value: at(step),
                    interval: [at(step - half), at(step + half)],
                })
            });
            (slot, own.collect())
        };
        now.active.iter().enumerate().map(of_slot).collect()
    }

    /// Scope of each effect of a finding.
    pub(super) fn belongings(&self, found: &RefitFinding) -> Vec<Belonging> {
        let parameters = self.model.parameters();
        let of = |&effect: &usize| {
            let slots = &self.model.effects()[effect].slots;
            let of_slot = |slot: &usize| {
                let (_, values) = found.by_group.iter().find(|(own, _)| own == slot)?;
                Some(belonging(values, parameters[*slot].neutral))
            };
            // Effects of several parameters belong to what all of these belong to.
            let each: Vec<Belonging> = slots.iter().filter_map(of_slot).collect();
            let differs = |b: &&Belonging| !matches!(b, Belonging::Bench);
            let different: Vec<&Belonging> = each.iter().filter(differs).collect();
            match different.as_slice() {
                [] => Belonging::Bench,
                [first, others @ ..] if others.iter().all(|o| o == first) => (*first).clone(),
                _ => Belonging::Groups,
            }
        };
        found.chosen.iter().map(of).collect()
    }

    /// Groups that each effect predicts worse, when they are left out, than all other effects without it; none where a fit is costly.
    pub(super) fn worse_with_each(&self, course: &Course) -> Vec<Vec<usize>> {
        let after = self.errors(&course.now);
        let of = |&effect: &usize| {
            if self.model.is_costly() {
                return Vec::new();
            }
            let without = self.fit(self.dropped(&course.now, effect), TRIAL_STEPS);
            self.worse_groups(&self.errors(&without), &after)
        };
        course.chosen.iter().map(of).collect()
    }

    /// Groups whose errors grow from one fit to another, when they are left out.
    fn worse_groups(&self, before: &RefitErrors, after: &RefitErrors) -> Vec<usize> {
        let objects = self.model.objects();
        let (Some(way), true) = (
            self.plan.ways.get(objects),
            after.held_out.get(objects).is_some_and(Option::is_some),
        ) else {
            return Vec::new();
        };
        let error = |errors: &RefitErrors, group: usize| -> f64 {
            let own = errors.own[objects]
                .iter()
                .zip(&way.groups)
                .filter(|(_, g)| **g == group);
            own.filter_map(|(v, _)| *v).sum()
        };
        let worse = |&group: &usize| error(after, group) > (1.0 + MAY_GROW).powi(2) * error(before, group);
        self.groups(way).into_iter().filter(worse).collect()
    }
}

fn sum(parts: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    parts.fold([0.0, 0.0], |[a, b], [x, y]| [a + x, b + y])
}

/// Half of the 95 % interval of a step by leaving out each measurement of a group in turn; zero if there are few.
fn jackknife(each: &[[f64; 2]], [information, slope]: [f64; 2]) -> f64 {
    let n = each.len() as f64;
    if each.len() < FEWEST_LEFT_OUT {
        return 0.0;
    }
    let steps: Vec<f64> = { each.iter() }
        .map(|[i, s]| (slope - s) / (information - i).max(f64::MIN_POSITIVE))
        .collect();
    let mean = steps.iter().sum::<f64>() / n;
    let squares: f64 = steps.iter().map(|s| (s - mean).powi(2)).sum();
    student_95(each.len() - 1) * ((n - 1.0) / n * squares).sqrt()
}

/// Scope of a parameter, by its values in groups.
fn belonging(values: &[GroupValue], neutral: f64) -> Belonging {
    let all: Vec<&GroupValue> = values.iter().collect();
    if agree(&all) {
        return Belonging::Bench;
    }
    let others = |k: usize| -> Vec<&GroupValue> {
        let own = values.iter().enumerate().filter(|(j, _)| *j != k);
        own.map(|(_, v)| v).collect()
    };
    // Two others that agree could as well be wrong themselves where there are three.
    let mut single = (0..values.len()).filter(|&k| values.len() > 2 && agree(&others(k)));
    match (single.next(), single.next()) {
        (Some(k), None) => {
            let (mean, variance) = mean(&others(k));
            if (mean - neutral).abs() <= HALF_95 * variance.sqrt() {
                Belonging::One(values[k].group)
            } else {
                Belonging::AllBut(values[k].group)
            }
        }
        _ => Belonging::Groups,
    }
}

/// Mean of the values of groups by their inverse variances, and its variance.
fn mean(values: &[&GroupValue]) -> (f64, f64) {
    let weight = |v: &GroupValue| (HALF_95 / v.half()).powi(2);
    let total: f64 = values.iter().map(|v| weight(v)).sum();
    (
        values.iter().map(|v| weight(v) * v.value).sum::<f64>() / total,
        1.0 / total,
    )
}

/// True if values of groups agree within their intervals: chi-square below its 95 % quantile (Wilson and Hilferty).
fn agree(values: &[&GroupValue]) -> bool {
    let degrees = values.len() as f64 - 1.0;
    if degrees < 1.0 {
        return true;
    }
    let (mean, _) = mean(values);
    let chi2: f64 = values
        .iter()
        .map(|v| ((v.value - mean) / v.half() * HALF_95).powi(2))
        .sum();
    let part = 2.0 / (9.0 * degrees);
    chi2 <= degrees * (1.0 - part + 1.645 * part.sqrt()).powi(3)
}

impl GroupValue {
    /// Half of the interval, never zero.
    fn half(&self) -> f64 {
        (0.5 * (self.interval[1] - self.interval[0])).max(f64::MIN_POSITIVE.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Belonging {
        let groups = values.iter().enumerate().map(|(group, &value)| GroupValue {
            group,
            value,
            interval: [value - 0.2, value + 0.2],
        });
        belonging(&groups.collect::<Vec<_>>(), 0.0)
    }

    #[test]
    fn groups_agree_or_differ_or_one_does() {
        assert_eq!(of(&[1.0, 1.1, 0.95, 1.05]), Belonging::Bench);
        assert_eq!(of(&[0.02, -0.05, 1.3, 0.04]), Belonging::One(2));
        assert_eq!(of(&[1.0, 1.1, 2.4, 0.95]), Belonging::AllBut(2));
        assert_eq!(of(&[1.0, 2.0, 3.0, 4.0]), Belonging::Groups);
        assert_eq!(of(&[1.0]), Belonging::Bench);
    }
}
