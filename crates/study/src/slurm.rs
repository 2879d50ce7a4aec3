//! Job arrays of what is missing: Slurm does the scheduling, this writes what it is given.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use metalith_core::document::{Document, Section, load};
use metalith_core::{AtomicFile, Result};

use crate::manifest::absolute;
use crate::sharding::Sharding;

/// Requirements of the jobs of a cluster.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slurm {
    /// The program as the nodes see it.
    pub program: String,
    pub partition: Option<String>,
    pub account: Option<String>,
    /// Time limit as `--time` takes it.
    pub time: String,
    pub cpus_per_task: u64,
    pub memory_mb: Option<u64>,
    /// `MaxArraySize` of the cluster: indices of an array are below it.
    pub max_array_size: u64,
    /// Further lines for `#SBATCH`.
    pub options: Vec<String>,
}

/// One array to submit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Submission {
    /// The job script.
    pub script: PathBuf,
    /// Shards that it makes.
    pub shards: Vec<u64>,
}

impl Slurm {
    /// Read the file at `path`.
    ///
    /// # Errors
    /// Every mistake of the file at once, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, Self::section)
    }

    fn section(s: &Section<'_, '_>) -> Self {
        let whole = |key: &str, most: i64, unit| s.optional_integer(key, 1..=most, unit).map(|v| v as u64);
        Self {
            program: s.optional_text("program").unwrap_or_else(|| "metalith".into()),
            partition: s.optional_text("partition"),
            account: s.optional_text("account"),
            time: s.optional_text("time").unwrap_or_else(|| "01:00:00".into()),
            cpus_per_task: whole("cpus_per_task", 1024, "threads").unwrap_or(1),
            memory_mb: whole("memory_mb", 1 << 24, "MB"),
            max_array_size: whole("max_array_size", 1 << 24, "").unwrap_or(1001),
            options: s.texts("options"),
        }
    }
}

/// Write job scripts for some shards into the folder of a plan, each an array below `max_array_size`. A task takes the
/// number of its shard from a list beside the script: numbers of shards may be larger than indices of an array.
///
/// # Errors
/// If a file cannot be written.
pub fn submissions(plan: &Sharding, slurm: &Slurm, shards: &[u64]) -> Result<Vec<Submission>> {
    let folder = absolute(&plan.folder.join("slurm"))?;
    let study = absolute(&plan.folder)?;
    // Indices run from zero to below the size.
    let most = slurm.max_array_size as usize;
    let mut all = Vec::new();
    for (k, chunk) in shards.chunks(most).enumerate() {
        let list = folder.join(format!("array_{k:03}.txt"));
        let numbers: String = chunk.iter().map(|n| format!("{n}\n")).collect();
        AtomicFile::write(&list, numbers.as_bytes())?;
        let script = folder.join(format!("array_{k:03}.sh"));
        AtomicFile::write(&script, job(slurm, &study, &folder, &list, chunk.len()).as_bytes())?;
        all.push(Submission {
            script,
            shards: chunk.to_vec(),
        });
    }
    Ok(all)
}

fn job(slurm: &Slurm, study: &Path, folder: &Path, list: &Path, tasks: usize) -> String {
    let mut text = String::from("#!/bin/bash\n");
    let mut option = |line: String| {
        let _ = writeln!(text, "#SBATCH {line}");
    };
    option("--job-name=metalith-study".into());
    option(format!("--array=0-{}", tasks - 1));
    option(format!("--cpus-per-task={}", slurm.cpus_per_task));
    option(format!("--time={}", slurm.time));
    option(format!("--output=\"{}\"", folder.join("%A_%a.log").display()));
    for (name, value) in [("partition", &slurm.partition), ("account", &slurm.account)] {
        if let Some(value) = value {
            option(format!("--{name}={value}"));
        }
    }
    if let Some(mb) = slurm.memory_mb {
        option(format!("--mem={mb}M"));
    }
    for line in &slurm.options {
        option(line.clone());
    }
    let _ = write!(
        text,
        "set -euo pipefail\nshard=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {})\nexec {} study run {} --shard \"$shard\" --threads {} --quiet\n",
        quoted(list),
        slurm.program,
        quoted(study),
        slurm.cpus_per_task
    );
    text
}

/// A path for a shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Layout;
    use crate::plan::test_plan;

    #[test]
    fn arrays_stay_below_the_size_and_make_the_shards_of_their_lists() {
        let folder = tempfile::tempdir().unwrap();
        let plan = test_plan(
            &folder.path().join("it's"),
            Layout::Written("layout.gds".into()),
            5000,
            1,
        );
        let file = folder.path().join("slurm.toml");
        std::fs::write(&file, "partition = \"cpu\"\ncpus_per_task = 4\nmax_array_size = 1001\n").unwrap();
        let slurm = Slurm::read(&file).unwrap();
        let missing: Vec<u64> = (0..5000).filter(|k| k % 2 == 1).collect();
        let all = submissions(&plan.cut(), &slurm, &missing).unwrap();
        assert_eq!(
            all.iter().map(|s| s.shards.len()).collect::<Vec<_>>(),
            [1001, 1001, 498]
        );
        let script = std::fs::read_to_string(&all[2].script).unwrap();
        for line in [
            "#SBATCH --array=0-497",
            "#SBATCH --partition=cpu",
            "#SBATCH --cpus-per-task=4",
            "it'\\''s' --shard \"$shard\" --threads 4",
        ] {
            assert!(script.contains(line), "{line} is not in {script}");
        }
        let list = std::fs::read_to_string(all[1].script.with_extension("txt")).unwrap();
        assert_eq!(list.lines().next(), Some("2003"));
        std::fs::write(&file, "cpus_per_task = 0\npartitio = \"cpu\"\n").unwrap();
        let error = Slurm::read(&file).unwrap_err().to_string();
        assert!(error.contains("cpus_per_task") && error.contains("partitio"), "{error}");
    }
}
