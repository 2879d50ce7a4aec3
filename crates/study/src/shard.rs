//! Shards of a study: its draws, judged one after the other.

use metalith_core::{Progress, Quiet, Result};

use crate::bench::{JudgedDraw, StudyBench};
use crate::plan::Plan;

/// Judges the draws of shards, one after the other.
pub struct Run<'p> {
    plan: &'p Plan,
    bench: StudyBench,
}

impl<'p> Run<'p> {
    /// Run for the draws of a plan; layouts and tables are read when a draw asks for them.
    ///
    /// # Errors
    /// If a file of the study has changed.
    pub fn open(plan: &'p Plan, progress: &dyn Progress) -> Result<Self> {
        Ok(Self {
            plan,
            bench: StudyBench::open(plan, progress)?,
        })
    }

    /// Make one shard, if it is not there.
    ///
    /// # Errors
    /// If tables of cells cannot be used (none are made here), a draw cannot be simulated, the file cannot be written or is of another plan, or the user stopped it.
    pub fn shard(&self, number: u64, progress: &dyn Progress) -> Result<()> {
        let draw = |k| Ok(self.bench.draw(k, &Quiet(progress))?.record);
        self.plan.cut().make(number, &draw, progress)
    }

    /// Full result of a draw.
    pub(crate) fn judged(&self, k: u64, progress: &dyn Progress) -> Result<JudgedDraw> {
        self.bench.draw(k, &Quiet(progress))
    }

    /// Sampler that makes the draws.
    pub(crate) fn drawer(&self) -> &crate::draw::Sampler {
        &self.bench.drawer
    }
}
