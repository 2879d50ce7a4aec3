//! State of a search.

use metalith_core::{Progress, Result};

use super::residual::{LEAST_GAIN, may_leave};
use crate::fit::{Fit, FitProblem, Gain, HeldOutErrors, gain, held_out, mean_error};
use crate::measurements::Measurements;

/// Scatter of the residual of noise alone: this many standard deviations of the mean square of a number of points.
const CHANCE_SIGMAS: f64 = 2.0;

/// Reduced chi-square per point beyond noise above which the search continues about what was found: what is found in full leaves
/// 0.002 to 0.006. A residual of 1.1 can hide an effect of its typical size, which looks small and unsure on a surrogate
/// that is centred elsewhere.
pub(crate) const MORE_IS_LEFT: f64 = 0.01;

/// Times that a search continues about a fit, and the share of the error above noise that each may leave for the next to be worth its
/// simulations.
const RECENTRINGS: usize = 3;
const WORTH_AGAIN: f64 = 0.5;

/// Asked where a residual is left that no single effect explains most of: whether the search ends there, because something that is not
/// tried explains much of it.
pub type EndsSearch<'f, M> = dyn Fn(&SearchState<'_, M>) -> Result<bool> + 'f;

/// A fit with the problem that it solves.
#[derive(Clone)]
pub struct SearchState<'a, M: Measurements> {
    pub problem: FitProblem<'a, M>,
    pub fit: Fit<M>,
    /// The error of the fit on measurements left out.
    pub held_out: HeldOutErrors,
}

impl<'a, M: Measurements> SearchState<'a, M> {
    /// State at a fit.
    pub fn new(problem: FitProblem<'a, M>, fit: Fit<M>) -> Self {
        let held_out = held_out(&problem, &fit.equations, &fit);
        Self { problem, fit, held_out }
    }

    /// Reduced chi-square per point on measurements left out; noise alone gives 1.
    pub fn error(&self) -> f64 {
        mean_error(&self.held_out)
    }

    /// True if more is left on measurements left out than `share` of the noise, and than that noise varies by.
    pub fn leaves_more_than(&self, share: f64) -> bool {
        self.error() > 1.0 + share.max(CHANCE_SIGMAS * (2.0 / self.problem.points().max(1.0)).sqrt())
    }

    /// True if more is left than the search stops at.
    pub fn leaves_a_residual(&self) -> bool {
        self.error() > may_leave(&self.problem, &self.fit)
    }

    /// True if less is left on measurements left out than by `other`: by more than the model errs by, and the 95 % confidence interval
    /// excludes none.
    pub fn surely_leaves_less_than(&self, other: &Self) -> bool {
        let Gain {
            value,
            interval: [low, _],
        } = gain(&self.problem, &other.held_out, &self.held_out);
        value >= LEAST_GAIN && low > 0.0
    }

    /// Move to another fit.
    pub fn move_to(&mut self, fit: Fit<M>) {
        self.held_out = held_out(&self.problem, &fit.equations, &fit);
        self.fit = fit;
    }

    /// Continue about the fit: its parameters are simulated anew.
    ///
    /// # Errors
    /// As [`Surrogate::recentred`](crate::surrogate::Surrogate::recentred).
    pub fn recentre(&mut self, progress: &dyn Progress) -> Result<()> {
        let Fit { theta, active, .. } = &self.fit;
        let FitProblem { model, surrogate, .. } = &self.problem;
        self.problem.surrogate = surrogate.recentred(*model, theta, active, progress)?;
        self.problem.correction = None;
        let fit = self.problem.fit(&self.fit.active, &self.fit);
        self.move_to(fit);
        Ok(())
    }

    /// Continue about the fit, and again as long as this explains most of what was left: numbers that act in steps are not found from
    /// afar (a boundary of write fields is between two columns of pillars).
    ///
    /// # Errors
    /// As [`SearchState::recentre`].
    pub fn settle(&mut self, progress: &dyn Progress) -> Result<()> {
        for _ in 0..RECENTRINGS {
            let before = self.error() - 1.0;
            self.recentre(progress)?;
            if !self.leaves_more_than(MORE_IS_LEFT) || self.error() - 1.0 > WORTH_AGAIN * before {
                break;
            }
        }
        Ok(())
    }

    /// Simulate anew what all others change beside the fit, where the surrogate is centred on it already.
    ///
    /// # Errors
    /// As [`Surrogate::renew_others`](crate::surrogate::Surrogate::renew_others).
    pub fn renew_others(&mut self, progress: &dyn Progress) -> Result<()> {
        let FitProblem { model, surrogate, .. } = &mut self.problem;
        surrogate.renew_others(*model, &self.fit.active, progress)
    }

    /// Refine the fit with full simulations.
    ///
    /// # Errors
    /// As [`FitProblem::refine`].
    pub fn refine(&mut self, progress: &dyn Progress) -> Result<()> {
        let fit = self.problem.refine(self.fit.clone(), progress)?;
        self.move_to(fit);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_model::{LinearModel, Product, Term, setups};
    use metalith_core::Silent;

    /// Two numbers of an effect of which one acts by the other: about a fit from afar something is left, about what is found there
    /// nothing is.
    #[test]
    fn numbers_that_do_not_add_are_found_in_several_turns() {
        const TRUTH: [f64; 2] = [0.1, 0.1];
        let own = Product {
            periods: [2, 3],
            factor: 17.0,
        };
        let terms = [[2, 3], [5, 4]].map(Term::linear).to_vec();
        let model = LinearModel::new(terms, setups(2, 2, 2)).with_first_two_joined(own);
        let data = model.data(|_| TRUTH.to_vec(), Some(3));
        let problem = model.problem(&data);
        let fit = problem.fit(&[0, 1], &problem.nuisance_fit());
        let mut once = SearchState::new(problem, fit);
        let mut settled = once.clone();
        once.recentre(&Silent).unwrap();
        assert!(once.leaves_more_than(0.5), "{}", once.error());
        settled.settle(&Silent).unwrap();
        assert!(!settled.leaves_more_than(MORE_IS_LEFT), "{}", settled.error());
        for (found, truth) in settled.fit.theta.iter().zip(TRUTH) {
            assert!((found / truth - 1.0).abs() < 2e-3, "{:?}", settled.fit.theta);
        }
    }

    /// Sets that leave more than noise varies by: of noise alone one in forty, of an effect all.
    #[test]
    fn what_noise_varies_by_is_not_left_over() {
        const SETS: u64 = 20;
        let model = LinearModel::new(vec![Term::linear([2, 3])], setups(2, 2, 1));
        let sets_with_more = |theta: f64| {
            let leaves_more = |seed: &u64| {
                let data = model.data(|_| vec![theta], Some(*seed));
                let problem = model.problem(&data);
                let nothing = problem.nuisance_fit();
                SearchState::new(problem, nothing).leaves_more_than(0.0)
            };
            (0..SETS).filter(leaves_more).count() as u64
        };
        assert!(sets_with_more(0.0) <= 2, "{}", sets_with_more(0.0));
        assert_eq!(sets_with_more(0.03), SETS);
    }
}
