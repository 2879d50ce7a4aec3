//! The folder of a plan, whatever the work is.

use std::path::Path;

use metalith_core::{Progress, Result};

#[cfg(feature = "baselines")]
use crate::comparison::ComparisonPlan;
use crate::manifest;
use crate::pairs::PairsPlan;
use crate::plan::Plan;
use crate::shard::Run;
use crate::sharding::Sharding;
use crate::starts::StartsPlan;

/// Work that was planned into a folder.
pub enum Work {
    /// Draws of a tolerance.
    Study(Plan),
    /// Frames and scenes for learning.
    Pairs(PairsPlan),
    /// Cameras side by side.
    #[cfg(feature = "baselines")]
    Comparison(ComparisonPlan),
    /// Starts of the optimiser.
    Starts(StartsPlan),
}

impl Work {
    /// The work in a folder.
    ///
    /// # Errors
    /// If there is none, or its manifest cannot be read.
    pub fn open(folder: &Path) -> Result<Self> {
        let known: serde_json::Value = manifest::read(folder)?;
        match known.get("work").and_then(|w| w.as_str()) {
            Some(PairsPlan::WORK) => Ok(Self::Pairs(PairsPlan::open(folder)?)),
            #[cfg(feature = "baselines")]
            Some(ComparisonPlan::WORK) => Ok(Self::Comparison(ComparisonPlan::open(folder)?)),
            #[cfg(not(feature = "baselines"))]
            Some("compare") => Err(metalith_core::Error::refused(
                "study/no-baselines",
                format!(
                    "{} holds a comparison, which this program was built without",
                    folder.display()
                ),
                "build it with the feature `baselines`",
            )),
            Some(StartsPlan::WORK) => Ok(Self::Starts(StartsPlan::open(folder)?)),
            _ => Ok(Self::Study(Plan::open(folder)?)),
        }
    }

    /// Division of the work into shards.
    pub fn cut(&self) -> Sharding {
        match self {
            Self::Study(plan) => plan.cut(),
            Self::Pairs(plan) => plan.cut(),
            #[cfg(feature = "baselines")]
            Self::Comparison(plan) => plan.cut(),
            Self::Starts(plan) => plan.cut(),
        }
    }

    /// Make some shards, one after the other; those that are there whole are left as they are, and nothing else is read
    /// if all are. Shards that another run makes are passed over, and waited for at the end.
    ///
    /// # Errors
    /// If a file of the plan has changed, a part cannot be made, a file cannot be written or is of another plan, or the user
    /// stopped it.
    pub fn run(&self, shards: &[u64], progress: &dyn Progress) -> Result<()> {
        let cut = self.cut();
        let mut missing = Vec::new();
        for number in shards {
            if !cut.finished(*number)? {
                missing.push(*number);
            }
        }
        if missing.is_empty() {
            return Ok(());
        }
        match self {
            Self::Study(plan) => {
                let run = Run::open(plan, progress)?;
                run.shards(&missing, progress)
            }
            Self::Pairs(plan) => plan.run(&missing, progress),
            #[cfg(feature = "baselines")]
            Self::Comparison(plan) => plan.run(&missing, progress),
            Self::Starts(plan) => plan.run(&missing, progress),
        }
    }
}
