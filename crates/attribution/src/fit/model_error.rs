//! Effect of the model's own error on the numbers that are found.
//!
//! Two correct programs do not predict the same. They differ by smooth functions, and in what an effect changes, by a small
//! share of it. A fit takes such a difference for its parameters, the more so the more alike these are: it makes some of
//! two effects of it that almost cancel. The difference is therefore added to the intervals: the smooth terms of the model,
//! each kind with its own standard deviation, are propagated through the fit; and a share of what was found.

use metalith_core::{Progress, Result};
use nalgebra::DVector;

use super::normal_equations::{SIGMAS_95, covariance, projected};
use super::problem::{Fit, FitProblem};
use crate::effect::Slot;
use crate::forward_model::{Coarser, ModelError};
use crate::index::PerMeasurement;
use crate::measurements::Measurements;

/// Parts of a 95 % half-width: its size by each cause alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IntervalParts {
    /// Noise, and that clusters of measurements do not agree.
    pub noise: f64,
    /// The error of the model, by the kinds that [`ModelError::sizes`] lists.
    pub model: Vec<f64>,
    /// Change by the effects that were found.
    pub change: f64,
    /// Known error of values of this effect.
    pub value: f64,
    /// Finite samples of the model: orders of a cell, samples of a spectrum, steps of a table.
    pub sampling: f64,
    /// How far another estimate of the same number is, where there is one: no half-width is less.
    pub least: f64,
}

impl IntervalParts {
    /// All of them together; no number where measurements tell nothing.
    pub fn half_width(&self) -> f64 {
        let all = self.noise.hypot(self.of_model());
        if all.is_nan() { all } else { all.max(self.least) }
    }

    /// Error of the model.
    pub fn of_model(&self) -> f64 {
        let all = self
            .model
            .iter()
            .copied()
            .chain([self.change, self.value, self.sampling]);
        all.fold(0.0, f64::hypot)
    }

    /// No wider than `most` together.
    #[must_use]
    pub fn at_most(self, most: f64) -> Self {
        let whole = self.half_width();
        if whole <= most {
            return self;
        }
        if !whole.is_finite() {
            // Measurements tell nothing of it.
            return Self {
                noise: most,
                ..Self::default()
            };
        }
        let share = most / whole;
        Self {
            noise: share * self.noise,
            model: self.model.iter().map(|own| share * own).collect(),
            change: share * self.change,
            value: share * self.value,
            sampling: share * self.sampling,
            least: self.least.min(most),
        }
    }
}

/// 95 % half-widths of the active parameters of a fit by the error of the model alone; zero where no smooth terms were
/// simulated.
pub(crate) fn model_half_widths<M: Measurements>(
    problem: &FitProblem<'_, M>,
    fit: &Fit<M>,
    error: &ModelError,
) -> Vec<IntervalParts> {
    let surrogate = &problem.surrogate;
    let (terms, kinds) = (surrogate.smooth_terms(), error.sizes.len());
    if terms == 0 {
        let none = IntervalParts {
            model: vec![0.0; kinds],
            ..IntervalParts::default()
        };
        return vec![none; fit.active.len()];
    }
    let with_terms = |problem: &FitProblem<'_, M>, fit: &Fit<M>| {
        let equations = problem.equations_with(fit, |c, prediction| {
            (0..terms).map(|t| surrogate.smooth_term(t, c, prediction)).collect()
        });
        problem.total(&equations, &fit.nuisances)
    };
    let slots = problem.model.slots();
    // Where nothing is there, some parameters change nothing.
    let sleeps = |s: &usize| problem.model.dormant(slots[*s].effect);
    let form = if error.by_effect && !fit.active.iter().any(sleeps) {
        let stated = FitProblem {
            surrogate: surrogate.stated(),
            correction: None,
            ..problem.clone()
        };
        let about = stated.surrogate.about.clone();
        with_terms(&stated, &stated.at(&fit.active, about, fit.nuisances.clone()))
    } else {
        with_terms(problem, fit)
    };
    let (shared, first) = (problem.shared(), form.nrows() - 1 - terms);
    let inverse = covariance(&form, &(0..first).collect::<Vec<_>>());
    let cross = form.view((0, first), (first, terms)).into_owned();
    // What a fit makes of a unit of each term, and the energy of a unit that no nuisance takes.
    let taken = &inverse * &cross;
    let free = projected(&form, shared);
    let energy = change_energy(problem, fit);
    let shapes = error.shapes.max(terms as f64);
    (0..fit.active.len())
        .map(|k| {
            let (mut model, mut change) = (vec![0.0; kinds], 0.0);
            for t in 0..terms {
                let place = first - shared + t;
                let own = free[(place, place)];
                // A term that shows in no measurement is no error.
                if own < VISIBLE {
                    continue;
                }
                let of_unit = taken[(shared + k, t)].powi(2);
                change += of_unit * energy / (shapes * own);
                if let Some(kind) = surrogate.kind_of_term(t) {
                    model[kind] += of_unit * (error.likeness * error.sizes[kind]).powi(2);
                }
            }
            let slot = fit.active[k];
            let Slot { effect, parameter, .. } = slots[slot];
            // Numbers along two axes are of one effect: what the larger one errs by, the smaller one may.
            let sizes = problem.model.slots_of(effect).into_iter();
            let sizes = sizes.map(|s| fit.theta[s].abs() / slots[s].parameter.typical);
            let value = if error.by_effect {
                problem
                    .model
                    .value_error(effect)
                    .sigma(sizes.fold(0.0, f64::max) * parameter.typical, parameter.typical)
            } else {
                0.0
            };
            IntervalParts {
                model: model.into_iter().map(|v: f64| SIGMAS_95 * v.sqrt()).collect(),
                change: SIGMAS_95 * change.sqrt(),
                value: SIGMAS_95 * value,
                ..IntervalParts::default()
            }
        })
        .collect()
}

/// Part of 95 % half-widths that the finite samples of the model give each active parameter of a fit: what the fit would make of
/// the difference to coarser samples, times the share of it that is left with those of the model. None where these are not known.
///
/// # Errors
/// Predictions with coarser samples, see [`ForwardModel::coarser`](crate::ForwardModel::coarser).
pub(crate) fn sampling_half_widths<M: Measurements>(
    problem: &FitProblem<'_, M>,
    fit: &Fit<M>,
    progress: &dyn Progress,
) -> Result<Option<Vec<f64>>> {
    if fit.active.is_empty() {
        return Ok(None);
    }
    let Some(Coarser { fine, coarse }) = problem.model.coarser(&fit.theta, progress)? else {
        return Ok(None);
    };
    let equations = problem.equations_with(fit, |c, _| {
        let change = |(share, to): &(f64, PerMeasurement<M::Prediction>)| {
            M::combine(&[(&to[c], *share as f32), (&fine[c], -*share as f32)])
        };
        coarse.iter().map(change).collect()
    });
    let form = problem.total(&equations, &fit.nuisances);
    let (shared, first) = (problem.shared(), form.nrows() - 1 - coarse.len());
    let inverse = covariance(&form, &(0..first).collect::<Vec<_>>());
    let taken = inverse * form.view((0, first), (first, coarse.len()));
    let width = |k| SIGMAS_95 * taken.row(shared + k).norm();
    Ok(Some((0..fit.active.len()).map(width).collect()))
}

/// Least energy of a unit of a term, as a share of the noise of one point, that shows at all.
const VISIBLE: f64 = 1e-6;

/// Energy (chi-square) that the model may err by in what the effects of a fit change.
pub fn change_energy<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>) -> f64 {
    let form = problem.total(&fit.equations, &fit.nuisances);
    let free = projected(&form, problem.shared());
    (0..problem.model.effects())
        .map(|effect| {
            let slots = problem.model.slots_of(effect);
            let mut theta = DVector::zeros(free.nrows());
            for s in slots {
                if let Some(k) = fit.position(s) {
                    theta[k] = fit.theta[s];
                }
            }
            let energy = (&free * &theta).dot(&theta);
            problem.model.error_share(effect).powi(2) * energy.max(0.0)
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forward_model::ForwardModel;
    use crate::test_model::{ERROR_PERIODS, ERROR_SIZE, ERROR_STEP, LIKENESS, LinearModel, SMOOTH_STEP, Term, setups};

    /// An effect that changes a prediction as an error of the model does is not distinguished from it: two groups, each with an
    /// separate error and half of the measurements, make an error of the effect of one over the root of two.
    #[test]
    fn an_effect_like_an_error_of_the_model_has_the_interval_of_that_error() {
        /// Relative: the place of a window follows the pattern a little.
        const TOLERANCE: f64 = 1e-2;
        let terms = vec![Term::linear(ERROR_PERIODS), Term::linear([2, 3])];
        let model = LinearModel::new(terms, setups(2, 2, 2));
        let data = model.data(|_| vec![0.01, 0.02], None);
        let problem = model.problem(&data);
        let fit = problem.fit(&[0, 1], &problem.nuisance_fit());
        let [like, unlike] = &model_half_widths(&problem, &fit, &model.model_error())[..] else {
            panic!("two parameters are active")
        };
        let [like, unlike] = [like, unlike].map(|parts| parts.half_width());
        let of_a_unit = SMOOTH_STEP / ERROR_STEP;
        let expected = SIGMAS_95 * LIKENESS * ERROR_SIZE * of_a_unit / 2f64.sqrt();
        assert!((like / expected - 1.0).abs() < TOLERANCE, "{like} {expected}");
        assert!(unlike < TOLERANCE * expected, "{unlike}");
    }

    /// The smooth terms were simulated at the stated parameters: the effect is seen there beside them, however it changes
    /// predictions where it was found. Claims see it where it was found.
    #[test]
    fn an_error_of_the_model_is_seen_beside_the_effect_as_stated() {
        /// Relative: the place of a window follows the pattern a little.
        const TOLERANCE: f64 = 2e-2;
        const TRUTH: f64 = 0.02;
        // Twice as steep where it was found as at the stated parameters.
        let bent = Term {
            amplitude: |theta| theta + 25.0 * theta * theta,
            patterns: vec![(ERROR_PERIODS, 1.0)],
        };
        let model = LinearModel::new(vec![bent], setups(2, 2, 2));
        let data = model.data(|_| vec![TRUTH], None);
        let problem = model.problem(&data);
        let fit = problem.fit(&[0], &problem.nuisance_fit());
        let width = |error: &ModelError| model_half_widths(&problem, &fit, error)[0].model[1];
        let where_found = ModelError {
            by_effect: false,
            ..model.model_error()
        };
        let ratio = width(&model.model_error()) / width(&where_found);
        assert!((ratio / 2.0 - 1.0).abs() < TOLERANCE, "{ratio}");
    }

    /// Parts add in squares, and none is left out.
    #[test]
    fn a_width_is_all_of_its_parts() {
        let parts = IntervalParts {
            noise: 1.0,
            model: vec![2.0, 4.0],
            change: 6.0,
            value: 8.0,
            sampling: 0.0,
            least: 0.5,
        };
        assert_eq!(parts.half_width(), 11.0);
        assert_eq!(
            IntervalParts {
                least: 12.0,
                ..parts.clone()
            }
            .half_width(),
            12.0
        );
        assert!((parts.clone().at_most(5.5).half_width() - 5.5).abs() < 1e-12);
        let unknown = IntervalParts {
            noise: f64::NAN,
            ..parts
        };
        assert_eq!(unknown.at_most(5.5).half_width(), 5.5);
    }
}
