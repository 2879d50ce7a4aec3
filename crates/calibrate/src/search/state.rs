//! Where a search stands.

use metalith_core::{Progress, Result};

use super::stepwise::fit_with;
use crate::fit::{Fit, FitProblem, HeldOutErrors, held_out, mean_error};

/// A fit with the problem that it solves.
#[derive(Clone)]
pub struct SearchState<'a> {
    pub problem: FitProblem<'a>,
    pub fit: Fit,
    /// The error of the fit on captures left out.
    pub held_out: HeldOutErrors,
}

/// Fit some effects and no others, all of which there is. With `full`, they are refined with full simulations, twice as often as in a
/// search: its surrogate is not centred on them.
///
/// # Errors
/// If a simulation fails, or the user stopped it.
pub fn fit_of<'a>(
    problem: FitProblem<'a>,
    effects: &[usize],
    full: bool,
    progress: &dyn Progress,
) -> Result<SearchState<'a>> {
    let nothing = problem.nuisance_fit();
    let fit = fit_with(&problem, &nothing, &[], effects).unwrap_or(nothing);
    let mut state = SearchState::new(problem, fit);
    if full {
        state.refine(progress)?;
        state.refine(progress)?;
    }
    Ok(state)
}

impl<'a> SearchState<'a> {
    /// At a fit.
    pub fn new(problem: FitProblem<'a>, fit: Fit) -> Self {
        let held_out = held_out(&problem, &fit.equations, &fit);
        Self { problem, fit, held_out }
    }

    /// Reduced chi-square per pixel on captures left out; noise alone gives 1.
    pub fn error(&self) -> f64 {
        mean_error(&self.held_out)
    }

    /// Move to another fit.
    pub fn move_to(&mut self, fit: Fit) {
        self.held_out = held_out(&self.problem, &fit.equations, &fit);
        self.fit = fit;
    }

    /// Continue about the fit: its parameters are simulated anew, and all others beside them.
    ///
    /// # Errors
    /// As [`Surrogate::recentred`](crate::surrogate::Surrogate::recentred).
    pub fn recentre(&mut self, progress: &dyn Progress) -> Result<()> {
        let Fit { theta, active, .. } = &self.fit;
        let surrogate = &self.problem.surrogate;
        self.problem.surrogate = surrogate.recentred(self.problem.model, theta, active, progress)?;
        self.problem.correction = None;
        let fit = self.problem.fit(&self.fit.active, &self.fit);
        self.move_to(fit);
        Ok(())
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
