//! Least squares over the parameters of some effects.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::model::RefitEquations;
use super::selection::{Selection, TRIAL_STEPS};
use crate::fit::minimise;

/// A fit ends when a step lowers the mean square by less than this share.
const CONVERGED: f64 = 1e-5;

/// Variant of [`CONVERGED`] for candidates where a fit is costly: they differ by much more.
const COMPARED: f64 = 1e-3;

/// A fit: values, and the equations of all fitted measurements about them.
pub(super) struct State {
    pub(super) active: Vec<usize>,
    pub(super) theta: Vec<f64>,
    pub(super) equations: Vec<RefitEquations>,
    /// Sum over what is fitted.
    pub(super) total: DMatrix<f64>,
}

impl State {
    pub(super) fn sum_of_squares(&self) -> f64 {
        let last = self.total.nrows() - 1;
        self.total[(last, last)]
    }

    /// Sum of squares that the equations promise after one step.
    pub(super) fn promised(&self) -> f64 {
        let free: Vec<usize> = (0..self.active.len()).collect();
        minimise(&self.total, &free).1
    }
}

impl Selection<'_> {
    /// Equations of all fitted measurements about some values.
    pub(super) fn at(&self, active: Vec<usize>, theta: Vec<f64>) -> State {
        let equations: Vec<_> = (0..self.model.count())
            .into_par_iter()
            .map(|m| {
                if self.plan.fitted[m] {
                    self.model.equations(m, &active, &theta)
                } else {
                    RefitEquations::alike(DMatrix::zeros(0, 0))
                }
            })
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
    pub(super) fn with(&self, now: &State, effect: usize) -> State {
        let (mut active, mut theta) = (now.active.clone(), now.theta.clone());
        let start = self.model.start(effect, &theta);
        for (&slot, start) in self.model.effects()[effect].slots.iter().zip(start) {
            active.push(slot);
            theta[slot] = start;
        }
        self.at(active, theta)
    }

    /// Least squares by Levenberg and Marquardt.
    pub(super) fn fit(&self, mut now: State, steps: usize) -> State {
        let size = now.active.len();
        let free: Vec<usize> = (0..size).collect();
        let is_trial = self.model.is_costly() && steps <= TRIAL_STEPS;
        let enough = if is_trial { COMPARED } else { CONVERGED };
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
                let small = gain < enough * now.sum_of_squares();
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
}
