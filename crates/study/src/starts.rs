//! Starts of the optimiser, in shards: the same design begun from other random numbers, and the best that was found.

use std::path::{Path, PathBuf};

use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, FolderLock, Progress, Quiet, Result};
use metalith_design::Design;
use metalith_optimise::{Checkpoint, OptimiseTask, TaskCells, write_phase_table};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::manifest::{Manifest, absolute, another_plan, manifest};
use crate::sharding::Sharding;

/// Version of the format of the manifest.
const SCHEMA: u32 = 1;
/// Folder of the tables of cells within that of the plan.
const CELLS: &str = "cells";

/// The manifest of such a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartsPlan {
    schema: u32,
    work: String,
    /// SHA-256 of all that decides the answers, in hexadecimal.
    pub key: String,
    /// The design file, absolute.
    pub design: PathBuf,
    pub starts: u64,
    pub starts_per_shard: u64,
    /// Files of tables of cells, in their folder.
    cells: Vec<String>,
    /// Folder of the plan.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Result of one start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartRecord {
    pub start: u64,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Name of the phases that it began from.
    pub from: String,
    /// Merit as it was optimised; larger is better.
    pub merit: f64,
    /// Phase of each ring (waves), in [0, 1).
    pub waves: Vec<f64>,
}

/// All starts.
#[derive(Clone, Debug, PartialEq)]
pub struct StartsResult {
    /// Starts in their order.
    pub starts: Vec<StartRecord>,
    /// Number of the best of them; the first of equals.
    pub best: usize,
    /// Path where its phase was written.
    pub phase: PathBuf,
}

manifest!(StartsPlan, |plan| plan.starts_per_shard > 0);

impl StartsPlan {
    /// Value of `work` in the manifest.
    pub(crate) const WORK: &'static str = "starts";

    /// Division of the work into shards.
    pub fn cut(&self) -> Sharding {
        Sharding {
            key: self.key.clone(),
            part: "start",
            parts: self.starts,
            per_shard: self.starts_per_shard,
            folder: self.folder.clone(),
            files_of: None,
        }
    }

    /// Make shards. Tables of cells are those of the plan: none are made here.
    ///
    /// # Errors
    /// If the design has changed since it was planned, tables are not there, or the user stopped it.
    pub fn run(&self, shards: &[u64], progress: &dyn Progress) -> Result<()> {
        let design = Design::read_with(&self.design, progress)?;
        if key(&self.design, &design, self.starts)? != self.key {
            return Err(another_plan(&self.folder));
        }
        let folder = self.folder.join(CELLS);
        if let Some(gone) = self.cells.iter().map(|name| folder.join(name)).find(|p| !p.is_file()) {
            return Err(Error::refused(
                "study/input-missing",
                format!("{} is missing", gone.display()),
                "plan the starts again; shards make no tables",
            ));
        }
        let cells = TaskCells::of(&design, false, Some(&folder), &Quiet(progress))?;
        let task = OptimiseTask::of(&design)?;
        let start = |k: u64| {
            let mut task = task.clone();
            // Chains of one start have seeds one after the other.
            task.spec.seed = task.spec.seed.wrapping_add(k.wrapping_mul(task.spec.seeds()));
            let found = task.solve(&cells.all(), Checkpoint::default(), &Quiet(progress))?;
            match found.interrupted {
                Some(_) => Err(Error::Interrupted),
                None => Ok(StartRecord {
                    start: k,
                    seed: task.spec.seed,
                    from: found.start.to_owned(),
                    merit: found.merit,
                    waves: found.waves,
                }),
            }
        };
        self.cut().make_all(shards, &start, progress)
    }

    /// The best of all starts: its phase in `phase.csv`, all merits in `starts.csv`.
    ///
    /// # Errors
    /// If starts are missing or there twice, none has a merit, or a file cannot be written.
    pub fn merge(&self, progress: &dyn Progress) -> Result<StartsResult> {
        let starts = self.cut().whole(&|s: &StartRecord| Some(s.start), progress)?;
        let design = Design::read(&self.design)?;
        let task = OptimiseTask::of(&design)?;
        let finite = starts.iter().enumerate().filter(|(_, s)| s.merit.is_finite());
        let best = finite.max_by(|(i, a), (j, b)| a.merit.total_cmp(&b.merit).then(j.cmp(i)));
        let (best, found) = best.ok_or_else(|| {
            Error::refused(
                "study/no-merit",
                "no start has a merit",
                "look at [optimise] of the design",
            )
        })?;
        let phase = self.folder.join("phase.csv");
        let remarks = [
            format!(
                "Phase of each ring of {}, in the middle of the ring; nearest row.",
                design.name
            ),
            format!(
                "The best of {} starts: number {best}, seed {}, merit {}.",
                starts.len(),
                found.seed,
                found.merit
            ),
        ];
        let mut table = String::from("start,seed,from,merit\n");
        for s in &starts {
            table.push_str(&format!("{},{},{},{}\n", s.start, s.seed, s.from, s.merit));
        }
        FolderLock::of(&self.folder)?.publish("starts", &[], |folder| {
            write_phase_table(&folder.join("phase.csv"), &task.lens.rings, &found.waves, &remarks)?;
            AtomicFile::write(&folder.join("starts.csv"), table.as_bytes())
        })?;
        Ok(StartsResult { starts, best, phase })
    }
}

/// SHA-256 of everything that decides the answers.
fn key(path: &Path, design: &Design, starts: u64) -> Result<String> {
    let solver = metalith_cell::cache_file::solver_of(design.cell.shape);
    let mut hash = Sha256::new();
    hash.update(format!(
        "{} {solver} {} {starts} ",
        env!("CARGO_PKG_VERSION"),
        design.optics_digest()?
    ));
    hash.update(file_digest(path)?);
    Ok(hex(&hash.finalize()))
}

/// Plan so many starts into a folder: tables of cells and manifest. A folder that holds the plan of the same starts keeps it.
///
/// # Errors
/// If the design cannot be read or optimised, the folder holds another plan, or the user stopped it.
pub fn plan_starts(
    design_path: &Path,
    starts: u64,
    starts_per_shard: u64,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<StartsPlan> {
    let path = absolute(design_path)?;
    let design = Design::read_with(&path, progress)?;
    OptimiseTask::of(&design)?;
    let key = key(&path, &design, starts)?;
    if let Some(known) = StartsPlan::known_in(folder, &key)? {
        return Ok(known);
    }
    let cells = folder.join(CELLS);
    std::fs::create_dir_all(&cells).map_err(Error::io("create the folder", &cells))?;
    TaskCells::of(&design, false, Some(&cells), progress)?;
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&cells).map_err(Error::io("read", &cells))? {
        let name = entry.map_err(Error::io("read", &cells))?.file_name();
        names.push(name.to_string_lossy().into_owned());
    }
    names.sort();
    let plan = StartsPlan {
        schema: SCHEMA,
        work: StartsPlan::WORK.into(),
        key,
        design: path,
        starts,
        starts_per_shard,
        cells: names,
        folder: folder.to_owned(),
    };
    plan.write_in(folder)?;
    Ok(plan)
}
