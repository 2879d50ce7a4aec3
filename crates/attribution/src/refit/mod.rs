//! Selection of effects for forward models that cost so little that every candidate is fitted in full.
//!
//! A candidate is fitted beside the effects that were taken, and judged by measurements that were left out: groups and
//! objects in turn, and measurements that were never fitted. It is taken if it predicts them better in each way of leaving out.
//! One that fits better and predicts worse is refused by name.

mod belonging;
mod finding;
mod fit;
mod held_out;
mod joint;
mod model;
mod selection;
#[cfg(test)]
mod tests;

use metalith_core::{Progress, Result};

pub use finding::{Belonging, GroupValue, RefitErrors, RefitFinding, RefitRejection, RefitTried};
pub use model::{LeaveOut, RefitEffect, RefitEquations, RefitModel, RefitParameter, RefitPlan, RefitScope};

/// Select the effects that explain measurements.
///
/// # Errors
/// If the user stopped it.
pub fn select(model: &dyn RefitModel, plan: &RefitPlan, progress: &dyn Progress) -> Result<RefitFinding> {
    selection::Selection { model, plan }.run(progress)
}

/// Effects as each explains what a selection leaves, beside the effects that were taken: in full, without taking any.
///
/// # Errors
/// If the user stopped it.
pub fn try_beside(
    model: &dyn RefitModel,
    plan: &RefitPlan,
    found: &RefitFinding,
    effects: &[usize],
    progress: &dyn Progress,
) -> Result<Vec<RefitTried>> {
    selection::Selection { model, plan }.beside(found, effects, progress)
}
