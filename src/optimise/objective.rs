//! What a gradient climbs.

use super::field::FieldProblem;

/// A merit of the phases of the rings; larger is better.
pub trait Objective: Sync {
    /// The merit at phases [turns].
    fn merit(&self, turns: &[f64]) -> f64;

    /// The merit that step `step` climbs, with its gradient [1/turn] added to `gradient`. Parts that are
    /// drawn afresh for each step depend on the seed and the step alone.
    fn climb(&self, turns: &[f64], seed: u64, step: u32, gradient: &mut [f64]) -> f64;
}

impl Objective for FieldProblem {
    fn merit(&self, turns: &[f64]) -> f64 {
        self.merit_of_phases(turns, None)
    }

    fn climb(&self, turns: &[f64], _seed: u64, _step: u32, gradient: &mut [f64]) -> f64 {
        self.merit_of_phases(turns, Some(gradient))
    }
}

/// A weighted sum of merits.
pub struct Sum<'o>(pub Vec<(f64, &'o dyn Objective)>);

impl Objective for Sum<'_> {
    fn merit(&self, turns: &[f64]) -> f64 {
        self.0.iter().map(|(weight, part)| weight * part.merit(turns)).sum()
    }

    fn climb(&self, turns: &[f64], seed: u64, step: u32, gradient: &mut [f64]) -> f64 {
        let mut merit = 0.0;
        for (weight, part) in &self.0 {
            let mut own = vec![0.0; gradient.len()];
            merit += weight * part.climb(turns, seed, step, &mut own);
            gradient.iter_mut().zip(own).for_each(|(g, o)| *g += weight * o);
        }
        merit
    }
}
