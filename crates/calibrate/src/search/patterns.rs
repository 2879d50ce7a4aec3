//! Patterns: one quantity, fitted free for each element, colour, distance or angle.
//!
//! What no effect explains may be a known quantity that is not the same everywhere. Each parameter is fitted with a value
//! of its own in each group of captures, on top of what was found, linear about it; the best patterns are then fitted
//! with the surrogate itself. Where one removes much of the residual, its values say which effect is missing: a gap that
//! is linear in the place of the element is a tilted sensor.

use nalgebra::DMatrix;

use super::course::Course;
use crate::fit::{CaptureSetup, Fit, FitProblem, covariance, minimise};
use crate::set::{CaptureIndex, MeasuredSet, PerCapture};

/// A pattern is reported if it removes this share of the chi-square above noise.
const WORTH_SAYING: f64 = 0.5;

/// Most patterns that are reported, and that are fitted with the surrogate.
const REPORTED: usize = 3;

/// Gauss-Newton steps of a pattern.
const STEPS: usize = 6;

/// What captures have in common that share a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grouping {
    Element,
    Colour,
    Distance,
    Angle,
}

impl Grouping {
    const ALL: [Self; 4] = [Self::Element, Self::Colour, Self::Distance, Self::Angle];

    /// As a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Element => "element",
            Self::Colour => "colour",
            Self::Distance => "distance",
            Self::Angle => "angle",
        }
    }

    fn same(self, a: &CaptureSetup, b: &CaptureSetup) -> bool {
        match self {
            Self::Element => a.element == b.element,
            Self::Colour => a.led == b.led,
            Self::Distance => a.distance_um == b.distance_um,
            Self::Angle => a.aoi_rad == b.aoi_rad,
        }
    }
}

/// A quantity with a value of its own in each group.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// Its parameter.
    pub slot: usize,
    pub by: Grouping,
    /// One capture of each group.
    pub groups: Vec<CaptureIndex>,
    /// Value and standard deviation in each.
    pub values: Vec<(f64, f64)>,
    /// Reduced chi-square per pixel with and without it.
    pub chi2: (f64, f64),
}

impl Pattern {
    /// What its values are like over what its groups differ in; none where that is a single place.
    pub fn course(&self, set: &MeasuredSet) -> Option<Course> {
        let at: Vec<[f64; 2]> = self.groups.iter().map(|&c| self.by.coordinates(set, c)).collect();
        Course::new(&at, &self.values)
    }
}

/// Patterns that remove most of what a fit leaves, the best first.
pub fn patterns(problem: &FitProblem<'_>, fit: &Fit) -> Vec<Pattern> {
    let slots: Vec<usize> = (0..problem.model.slots().len()).collect();
    let wide = problem.at(&slots, fit.theta.clone(), fit.nuisances.clone());
    let pixels = problem.pixels();
    let shared = problem.shared();
    let mut found: Vec<(f64, usize, Grouping)> = Vec::new();
    for by in Grouping::ALL {
        let group = groups(problem, by);
        let count = group.iter().flatten().max().map_or(0, |m| m + 1);
        if count < 2 {
            continue;
        }
        for &slot in &slots {
            // Shared nuisances, what was found, the quantity in each group, the residual.
            let kept: Vec<usize> = (0..shared).chain(fit.active.iter().map(|s| shared + s)).collect();
            let size = kept.len() + count + 1;
            let mut form = DMatrix::zeros(size, size);
            for (c, own) in group.iter_enumerated() {
                let Some(own) = own else { continue };
                let from = &wide.equations.captures[c];
                let columns: Vec<(usize, usize)> = kept
                    .iter()
                    .copied()
                    .enumerate()
                    .chain([(kept.len() + own, shared + slot), (size - 1, from.nrows() - 1)])
                    .collect();
                for &(i, a) in &columns {
                    for &(j, b) in &columns {
                        form[(i, j)] += from[(a, b)];
                    }
                }
            }
            form += fit.nuisances.prior(problem.data, size);
            let (_, chi2) = minimise(&form, &(0..size - 1).collect::<Vec<_>>());
            found.push((chi2, slot, by));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let above = |chi2: f64| (chi2 / pixels - 1.0).max(0.0);
    let mut out: Vec<Pattern> = Vec::new();
    for (_, slot, by) in found.into_iter().take(REPORTED) {
        let pattern = fitted(problem, fit, slot, by);
        if above(pattern.chi2.0 * pixels) <= (1.0 - WORTH_SAYING) * above(fit.chi2) {
            out.push(pattern);
        }
    }
    out.sort_by(|a, b| a.chi2.0.total_cmp(&b.chi2.0));
    out
}

/// The group of each capture that counts.
fn groups(problem: &FitProblem<'_>, by: Grouping) -> PerCapture<Option<usize>> {
    let beam = &problem.data.beam;
    let mut firsts: Vec<CaptureIndex> = Vec::new();
    problem
        .data
        .captures()
        .map(|c| {
            if !problem.used[c] {
                return None;
            }
            let known = firsts.iter().position(|f| by.same(&beam[*f], &beam[c]));
            Some(known.unwrap_or_else(|| {
                firsts.push(c);
                firsts.len() - 1
            }))
        })
        .collect()
}

/// A pattern fitted with the surrogate; what was found stays as it is.
fn fitted(problem: &FitProblem<'_>, fit: &Fit, slot: usize, by: Grouping) -> Pattern {
    let group = groups(problem, by);
    let count = group.iter().flatten().max().map_or(0, |m| m + 1);
    let (shared, pixels) = (problem.shared(), problem.pixels());
    let (low, high) = problem.surrogate.search_range(slot);
    let mut values = vec![fit.theta[slot]; count];
    let mut nuisances = fit.nuisances.clone();
    let mut sigmas = vec![0.0; count];
    let mut chi2 = fit.chi2;
    let mut best = values.clone();
    for step in 0..=STEPS {
        let (of_captures, after) = problem.with_own_values(fit, slot, &nuisances, |c| group[c].map(|g| values[g]));
        let size = shared + count + 1;
        let mut form = fit.nuisances.prior(problem.data, size);
        for (c, own) in group.iter_enumerated() {
            let Some(own) = own else { continue };
            let columns: Vec<(usize, usize)> = (0..shared)
                .map(|k| (k, k))
                .chain([(shared + own, shared), (size - 1, shared + 1)])
                .collect();
            for &(i, a) in &columns {
                for &(j, b) in &columns {
                    form[(i, j)] += of_captures[c][(a, b)];
                }
            }
        }
        let free: Vec<usize> = (0..shared).collect();
        let (_, here) = minimise(&form, &free);
        if here < chi2 {
            chi2 = here;
            best.clone_from(&values);
            let all: Vec<usize> = (0..size - 1).collect();
            let covariance = covariance(&form, &all);
            let excess = (here / pixels).max(1.0);
            for (k, s) in sigmas.iter_mut().enumerate() {
                *s = (covariance[(shared + k, shared + k)] * excess).sqrt();
            }
        }
        if step < STEPS {
            let (move_by, _) = minimise(&form, &(0..size - 1).collect::<Vec<_>>());
            for (k, v) in values.iter_mut().enumerate() {
                *v = (*v + move_by[shared + k]).clamp(low, high);
            }
            nuisances = after;
        }
    }
    let firsts = (0..count).filter_map(|g| group.iter_enumerated().find(|(_, own)| **own == Some(g)).map(|f| f.0));
    Pattern {
        slot,
        by,
        groups: firsts.collect(),
        values: best.into_iter().zip(sigmas).collect(),
        chi2: (chi2 / pixels, fit.chi2 / pixels),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_model::{LinearModel, PARAMETER, Term, beams};

    /// One pattern of another size in each element: no single value explains it, and the free values are those of the
    /// elements.
    #[test]
    fn a_quantity_that_differs_by_element_is_read_in_each() {
        let truth = [0.6, -1.2, 1.0].map(|size| size * PARAMETER.typical);
        let model = LinearModel::new(
            vec![Term::linear([2, 3]), Term::linear([5, 4])],
            beams(2, truth.len(), 2),
        );
        // Captures are by LED, element and distance.
        let data = model.data(|c| vec![truth[(c / 2) % truth.len()], 0.0], Some(3));
        let problem = model.problem(&data);
        let fit = problem.nuisance_fit();
        let found = patterns(&problem, &fit);
        let best = found.first().expect("it explains all that is left");
        assert_eq!((best.slot, best.by), (0, Grouping::Element));
        assert!(best.chi2.0 < 1.01, "{:?}", best.chi2);
        for ((value, sigma), truth) in best.values.iter().zip(truth) {
            // Five standard deviations: three draws.
            assert!((value - truth).abs() < 5.0 * sigma, "{value} {sigma} {truth}");
        }
    }
}
