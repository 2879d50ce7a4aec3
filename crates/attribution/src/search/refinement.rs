//! Refinement: fits that continue beyond the simulated range, and that converge on full simulations.

use metalith_core::{Progress, Result};

use crate::fit::{Fit, FitProblem};
use crate::measurements::Measurements;

/// Times that the surrogate is extended towards where a fit goes.
const EXTENSIONS: usize = 3;

/// A parameter that left the simulated range is simulated where it went, and so much farther from the base.
const FARTHER: f64 = 1.4;

/// Most full simulations of a refinement.
const FULL_SIMULATIONS: usize = 3;

/// A refinement has converged when no parameter moves by more than this share of its typical size.
const CONVERGED: f64 = 2e-2;

/// Room at the ends of a simulated range, relative to it: rounding.
const ROUNDING: f64 = 1e-9;

impl<M: Measurements> FitProblem<'_, M> {
    /// True if a fit left the simulated range.
    pub fn extrapolates(&self, fit: &Fit<M>) -> bool {
        fit.active.iter().any(|&s| self.is_beyond(s, fit.theta[s]))
    }

    fn is_beyond(&self, slot: usize, value: f64) -> bool {
        let (low, high) = self.surrogate.simulated_range(slot);
        let room = ROUNDING * (high - low);
        value < low - room || value > high + room
    }

    /// Follow a fit to where it goes: extend the surrogate and fit again.
    ///
    /// # Errors
    /// If a simulation fails, or the user stopped it.
    pub fn extend_and_fit(&mut self, mut fit: Fit<M>, progress: &dyn Progress) -> Result<Fit<M>> {
        for _ in 0..EXTENSIONS {
            let far: Vec<usize> = fit
                .active
                .iter()
                .copied()
                .filter(|&s| self.is_beyond(s, fit.theta[s]))
                .collect();
            if far.is_empty() {
                break;
            }
            for slot in far {
                self.extend(&fit, slot, progress)?;
            }
            let active = fit.active.clone();
            fit = self.fit(&active, &fit);
        }
        Ok(fit)
    }

    /// Simulate one parameter at the value of a fit, and farther on.
    fn extend(&mut self, fit: &Fit<M>, slot: usize, progress: &dyn Progress) -> Result<()> {
        let (low, high) = self.model.slots()[slot].parameter.range;
        let (value, about) = (fit.theta[slot], self.surrogate.about[slot]);
        let mut values = vec![value, (about + FARTHER * (value - about)).clamp(low, high)];
        values.dedup();
        let before = self
            .correction
            .is_some()
            .then(|| self.surrogate_predictions(&fit.theta));
        self.surrogate.extend(self.model, slot, &values, progress)?;
        // The correction is relative to the surrogate as it was.
        if let Some((correction, before)) = self.correction.take().zip(before) {
            let after = self.surrogate_predictions(&fit.theta);
            let parts = correction.iter().zip(before.iter().zip(&after));
            let moved = parts.map(|(c, (b, a))| M::combine(&[(c, 1.0), (b, 1.0), (a, -1.0)]));
            self.correction = Some(moved.collect());
        }
        Ok(())
    }

    /// Refine a fit with full simulations, at its parameters or close by, until it has converged.
    ///
    /// # Errors
    /// As [`FitProblem::extend_and_fit`].
    pub fn refine(&mut self, mut fit: Fit<M>, progress: &dyn Progress) -> Result<Fit<M>> {
        for _ in 0..FULL_SIMULATIONS {
            fit = self.extend_and_fit(fit, progress)?;
            self.correct_at(&self.cheap_point(&fit.theta), progress)?;
            let next = self.fit(&fit.active, &fit);
            let slots = self.model.slots();
            let moved = fit
                .active
                .iter()
                .map(|&s| (next.theta[s] - fit.theta[s]).abs() / slots[s].parameter.typical)
                .fold(0.0, f64::max);
            fit = next;
            if moved < CONVERGED {
                break;
            }
        }
        Ok(fit)
    }

    /// Parameters close by at which a full simulation is likely to be cheap.
    fn cheap_point(&self, theta: &[f64]) -> Vec<f64> {
        let slots = self.model.slots().iter().enumerate().zip(theta);
        slots
            .map(|((s, slot), value)| {
                let Some(step) = self.model.cheap_step(s) else {
                    return *value;
                };
                let (low, high) = slot.parameter.range;
                ((value / step).round() * step).clamp(low, high)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::CONVERGED;
    use crate::test_model::{LinearModel, PARAMETER, Term, setups};
    use metalith_core::Silent;

    /// Not a polynomial of the degree of the surrogate: the response saturates.
    fn saturating() -> LinearModel {
        let term = Term {
            amplitude: |theta| 0.05 * (theta / 0.03).tanh(),
            patterns: vec![([2, 3], 1.0)],
        };
        LinearModel::new(vec![term], setups(2, 2, 1))
    }

    /// The minimum of chi-square is where the data were made: refinement comes closer than its criterion of
    /// convergence, repeated refinement comes arbitrarily close, and the surrogate alone does not.
    #[test]
    fn refinement_converges_to_the_minimum() {
        /// In typical sizes: each full simulation shortens the distance by the relative error of the surrogate's
        /// slope, which is below 0.5 here; four more refinements at least by 16.
        const REPEATED: f64 = CONVERGED / 16.0;
        let model = saturating();
        for truth in [0.6, 1.7, -2.2].map(|size| size * PARAMETER.typical) {
            let data = model.data(|_| vec![truth], None);
            let mut problem = model.problem(&data);
            let plain = problem.fit(&[0], &problem.nuisance_fit());
            let mut refined = problem.refine(plain.clone(), &Silent).unwrap();
            let off = |theta: f64| (theta - truth).abs() / PARAMETER.typical;
            assert!(off(refined.theta[0]) < CONVERGED, "{truth}: {}", refined.theta[0]);
            assert!(off(refined.theta[0]) < off(plain.theta[0]), "{truth}");
            for _ in 0..4 {
                refined = problem.refine(refined, &Silent).unwrap();
            }
            assert!(off(refined.theta[0]) < REPEATED, "{truth}: {}", refined.theta[0]);
        }
    }

    /// A minimum far outside the simulated range is followed, and the surrogate knows its surroundings after.
    #[test]
    fn a_fit_that_leaves_the_simulated_range_is_followed() {
        let cubic = Term {
            amplitude: |theta| theta + 20.0 * theta.powi(3),
            patterns: vec![([2, 3], 1.0)],
        };
        let model = LinearModel::new(vec![cubic], setups(2, 2, 1));
        let truth = 7.0 * PARAMETER.typical;
        let data = model.data(|_| vec![truth], None);
        let mut problem = model.problem(&data);
        assert!(problem.surrogate.simulated_range(0).1 < truth);
        let plain = problem.fit(&[0], &problem.nuisance_fit());
        assert!(problem.extrapolates(&plain));
        let refined = problem.refine(plain, &Silent).unwrap();
        assert!(!problem.extrapolates(&refined));
        let off = (refined.theta[0] - truth).abs() / PARAMETER.typical;
        assert!(off < CONVERGED, "{}", refined.theta[0]);
    }
}
