//! Where a search for what a set shows stands.

use crate::fit::cross_validation::{HeldOutErrors, held_out, mean};
use crate::fit::problem::{Fit, Problem};
use metalith_core::{Progress, Result};

/// A fit with the problem that it is at rest in.
#[derive(Clone)]
pub struct SearchState<'a> {
    pub problem: Problem<'a>,
    pub fit: Fit,
    /// The error of the fit on captures left out.
    pub held: HeldOutErrors,
}

impl<'a> SearchState<'a> {
    /// At a fit.
    pub fn new(problem: Problem<'a>, fit: Fit) -> Self {
        let held = held_out(&problem, &fit.forms, &fit);
        Self { problem, fit, held }
    }

    /// Chi-square a pixel on captures left out; 1 is noise alone.
    pub fn error(&self) -> f64 {
        mean(&self.held)
    }

    /// Stand at another fit.
    pub fn go(&mut self, fit: Fit) {
        self.held = held_out(&self.problem, &fit.forms, &fit);
        self.fit = fit;
    }

    /// Bring the fit to rest on exact simulations.
    ///
    /// # Errors
    /// As [`Problem::refine`].
    pub fn refine(&mut self, progress: &dyn Progress) -> Result<()> {
        let fit = self.problem.refine(self.fit.clone(), progress)?;
        self.go(fit);
        Ok(())
    }
}
