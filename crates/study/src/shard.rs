//! Shards of a study: its draws, judged one after the other.

use metalith_core::{Error, Progress, Quiet, Result};

use crate::bench::{JudgedDraw, StudyBench};
use crate::plan::Plan;
use crate::record::DrawRecord;
use crate::sharding::ranges;

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

    /// Make shards, if they are not there whole; those that another run makes come last.
    ///
    /// # Errors
    /// If tables of cells cannot be used (none are made here), a draw cannot be simulated, the file cannot be written or is of another plan, or the user stopped it.
    pub fn shards(&self, numbers: &[u64], progress: &dyn Progress) -> Result<()> {
        let draw = |k| Ok(self.bench.draw(k, &Quiet(progress))?.record);
        self.plan.cut().make_all(numbers, &draw, progress)
    }

    /// Check that draws of shards are the draws of the plan.
    ///
    /// # Errors
    /// If some are not, with the shards that hold them.
    pub(crate) fn check(&self, draws: &[DrawRecord]) -> Result<()> {
        let mut others = Vec::new();
        for draw in draws {
            if !self.bench.is_drawn(draw, &self.plan.limits)? {
                others.push(draw.draw);
            }
        }
        if others.is_empty() {
            return Ok(());
        }
        let mut shards: Vec<u64> = others.iter().map(|k| k / self.plan.draws_per_shard).collect();
        shards.dedup();
        Err(Error::refused(
            "study/draws-differ",
            format!(
                "{} draws have other amounts, values or verdicts than the plan gives: {}",
                others.len(),
                ranges(&others)
            ),
            format!(
                "remove the files of their shards ({}) from {}, and make them again by `metalith study run FOLDER --missing`",
                ranges(&shards),
                self.plan.cut().shards_folder().display()
            ),
        ))
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
