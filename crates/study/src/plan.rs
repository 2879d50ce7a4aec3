//! The folder of a study: what it is, cut into shards.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use metalith_cell::kept::solver_of;
use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result, WholeFile};
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_layout::write_pillars;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::bench::{Bench, Quiet};
use crate::record::LimitStatement;
use crate::tolerance::Tolerance;

/// Version of the format of the manifest.
const SCHEMA: u32 = 1;

/// Time that a shard shall take (s): long enough for a queue to be worth it, short enough to lose one.
const SHARD_SECONDS: f64 = 600.0;

/// Name of the manifest within the folder.
pub(crate) const MANIFEST: &str = "plan.json";

/// Name of the tables of cells.
pub(crate) const CELLS: &str = "cells.bank";

/// Longest manifest.
const LONGEST: u64 = 64 << 20;

/// Where the pillars of a study are read from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// A file that the tolerance names.
    Given(PathBuf),
    /// The file that was written from the design, by its name in the folder of the study.
    Written(String),
}

/// One part of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    pub number: u64,
    /// Its draws: from the first up to the one before `end`.
    pub first: u64,
    pub end: u64,
}

/// The manifest of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    schema: u32,
    /// SHA-256 of all that decides the answers, in hexadecimal: key of the random numbers.
    pub key: String,
    /// The file of the study, absolute.
    pub tolerance: PathBuf,
    pub layout: Layout,
    /// Name and unit of what varies; those of a grid first.
    pub quantities: Vec<(String, String)>,
    pub limits: Vec<LimitStatement>,
    /// All draws, at all points of the grid.
    pub draws: u64,
    pub draws_per_shard: u64,
    /// Wall time of the first draw on the machine and threads of the plan (s).
    pub seconds_per_draw: f64,
    /// Pillars whose tables were solved, for every width and wavelength.
    pub stacks: usize,
    /// The folder of the study.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// How a study is planned.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlanSettings {
    /// Draws of a shard; as many as take ten minutes if left out.
    pub draws_per_shard: Option<u64>,
}

impl Plan {
    /// The study in a folder.
    ///
    /// # Errors
    /// If there is none, or its manifest cannot be read.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(MANIFEST);
        let bytes = read_at_most(&path, LONGEST, "the manifest of a study")?;
        let fault = |what: String| Error::Table {
            path: path.clone(),
            line: None,
            what,
            hint: "plan the study with `metalith study plan`".into(),
        };
        let mut plan: Self = serde_json::from_slice(&bytes).map_err(|e| fault(e.to_string()))?;
        if plan.schema != SCHEMA || plan.draws_per_shard == 0 {
            return Err(fault(format!(
                "a manifest of schema {}, {SCHEMA} is known",
                plan.schema
            )));
        }
        plan.folder = folder.to_owned();
        Ok(plan)
    }

    /// Number of shards.
    pub fn shards(&self) -> u64 {
        self.draws.div_ceil(self.draws_per_shard)
    }

    /// One shard.
    ///
    /// # Errors
    /// If there is none of this number.
    pub fn shard(&self, number: u64) -> Result<Shard> {
        if number >= self.shards() {
            return Err(Error::invalid(
                format!("there is no shard {number}"),
                format!("this study has shards 0 to {}", self.shards() - 1),
            ));
        }
        let first = number * self.draws_per_shard;
        Ok(Shard {
            number,
            first,
            end: (first + self.draws_per_shard).min(self.draws),
        })
    }

    /// Where the pillars are.
    pub(crate) fn layout_path(&self) -> PathBuf {
        layout_path(&self.layout, &self.folder)
    }
}

fn layout_path(layout: &Layout, folder: &Path) -> PathBuf {
    match layout {
        Layout::Given(path) => path.clone(),
        Layout::Written(name) => folder.join(name),
    }
}

/// Plan a study into a folder: layout, tables of cells, the first draw to know its time, manifest. A folder that holds
/// the plan of the same study keeps it.
///
/// # Errors
/// If a file cannot be used, the folder holds another study, or the user stopped it.
pub fn plan(tolerance_path: &Path, folder: &Path, settings: PlanSettings, progress: &dyn Progress) -> Result<Plan> {
    let tolerance_path = absolute(tolerance_path)?;
    let tolerance = Tolerance::read(&tolerance_path)?;
    let design = Design::read(&tolerance.design)?;
    let array = PillarArray::build(&design, progress)?;
    fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
    let layout = match &tolerance.layout {
        Some(path) => Layout::Given(absolute(path)?),
        None => {
            let name = "layout.gds".to_owned();
            let path = folder.join(&name);
            if !folder.join(MANIFEST).is_file() {
                write_pillars(&design, &array, design.layout.hierarchy, &path, progress)?;
            }
            Layout::Written(name)
        }
    };
    let key = key(&tolerance, &design, &layout_path(&layout, folder))?;
    if folder.join(MANIFEST).is_file() {
        let known = Plan::open(folder)?;
        if known.key == hex(&key) {
            return Ok(known);
        }
        return Err(Error::invalid(
            format!(
                "{} holds another study, or one whose files have changed since",
                folder.display()
            ),
            "name another folder with --out, or remove this one",
        ));
    }
    let bench = Bench::make(tolerance, design, array, &layout_path(&layout, folder), key, progress)?;
    bench.bank.write(&folder.join(CELLS))?;
    progress.begin("timing the first draw", 1);
    let begun = Instant::now();
    let (first, found) = bench.draw(0, &Quiet(progress))?;
    let seconds_per_draw = begun.elapsed().as_secs_f64();
    for limit in &bench.tolerance.limits {
        if !first.figures.contains_key(&limit.figure) {
            let known: Vec<&str> = first.figures.keys().map(String::as_str).collect();
            return Err(Error::invalid(
                format!("there is no figure `{}` to limit", limit.figure),
                format!("this design has: {}", known.join(", ")),
            ));
        }
    }
    let draws = bench.drawer.count();
    let by_time = (SHARD_SECONDS / seconds_per_draw.max(1e-3)).floor().max(1.0) as u64;
    let plan = Plan {
        schema: SCHEMA,
        key: hex(&key),
        tolerance: tolerance_path,
        layout,
        quantities: bench.drawer.names(),
        limits: bench.limits(&found),
        draws,
        draws_per_shard: settings.draws_per_shard.unwrap_or(by_time).clamp(1, draws),
        seconds_per_draw,
        stacks: bench.bank.stacks(),
        folder: folder.to_owned(),
    };
    let mut text = serde_json::to_string_pretty(&plan).expect("plain data serialises");
    text.push('\n');
    WholeFile::write(&folder.join(MANIFEST), text.as_bytes())?;
    Ok(plan)
}

/// SHA-256 of everything that decides the answers; how a study is cut is no part of it.
pub(crate) fn key(tolerance: &Tolerance, design: &Design, layout: &Path) -> Result<[u8; 32]> {
    let mut hash = Sha256::new();
    let mut add = |what: &str, bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(what);
        hash.update(bytes);
    };
    let solver = solver_of(design.cell.shape);
    add("version", format!("{} {solver}", env!("CARGO_PKG_VERSION")).as_bytes());
    // A design names further files: its digest covers what they say.
    add("design", design.digest().as_bytes());
    let mut files = vec![tolerance.path.clone(), tolerance.design.clone(), layout.to_owned()];
    files.extend(tolerance.model.clone());
    if let Some(camera) = &design.verify.camera {
        files.extend(metalith_verify::camera_files(camera)?);
    }
    for path in files {
        let mut one = Sha256::new();
        let mut file = fs::File::open(&path).map_err(Error::io("read", &path))?;
        std::io::copy(&mut file, &mut one).map_err(Error::io("read", &path))?;
        add("file", &one.finalize());
    }
    Ok(hash.finalize().into())
}

fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).map_err(Error::io("find", path))
}

/// A plan of nothing, for tests of what is done with plans.
#[cfg(test)]
pub(crate) fn test_plan(folder: &Path, layout: Layout, draws: u64, draws_per_shard: u64) -> Plan {
    Plan {
        schema: SCHEMA,
        key: hex(&[0; 32]),
        tolerance: "tolerance.toml".into(),
        layout,
        quantities: Vec::new(),
        limits: Vec::new(),
        draws,
        draws_per_shard,
        seconds_per_draw: 1.0,
        stacks: 1,
        folder: folder.to_owned(),
    }
}
