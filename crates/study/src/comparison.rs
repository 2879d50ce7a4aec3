//! Cameras side by side, in shards of one camera each.

use std::path::{Path, PathBuf};

use metalith_baselines::{ComparedCamera, Comparison, ComparisonResult, ListedDesign};
use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_imaging::KernelCache;
use metalith_sensor::Camera;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::manifest::{Manifest, absolute, another_plan, manifest};
use crate::sharding::Sharding;

/// Version of the format of the manifest.
const SCHEMA: u32 = 1;

/// The manifest of such a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComparisonPlan {
    schema: u32,
    work: String,
    /// SHA-256 of all that decides the answers, in hexadecimal.
    pub key: String,
    pub comparison: Comparison,
    /// Time that all cameras are exposed for (ms), if the program chose one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    equal_time_ms: Option<f64>,
    /// Folder of the plan.
    #[serde(skip)]
    pub folder: PathBuf,
}

manifest!(ComparisonPlan, |_| true);

impl ComparisonPlan {
    /// Value of `work` in the manifest.
    pub(crate) const WORK: &'static str = "compare";

    /// Division of the work: each camera for itself.
    pub fn cut(&self) -> Sharding {
        Sharding {
            key: self.key.clone(),
            part: "camera",
            parts: self.comparison.count() as u64,
            per_shard: 1,
            folder: self.folder.clone(),
            files_of: None,
        }
    }

    /// Let the cameras of some shards take all photographs. Kernels are those of the plan: none are made here.
    ///
    /// # Errors
    /// If a file has changed since it was planned, kernels are not there, or the user stopped it.
    pub fn run(&self, shards: &[u64], progress: &dyn Progress) -> Result<()> {
        if key(&self.comparison, progress)? != self.key {
            return Err(another_plan(&self.folder));
        }
        let open = self.comparison.open(progress)?.exposed_for(self.equal_time_ms)?;
        let cache = KernelCache::only(&self.folder);
        let camera = |k: u64| open.take(k as usize, &cache, progress);
        self.cut().make_all(shards, &camera, progress)
    }

    /// The table of all cameras. The first photograph is taken again, for the page.
    ///
    /// # Errors
    /// If cameras are missing or there twice; as [`ComparisonPlan::run`].
    pub fn merge(&self, progress: &dyn Progress) -> Result<ComparisonResult> {
        let mut cameras: Vec<ComparedCamera> = self.cut().whole(&|_| None, progress)?;
        if key(&self.comparison, progress)? != self.key {
            return Err(another_plan(&self.folder));
        }
        let open = self.comparison.open(progress)?.exposed_for(self.equal_time_ms)?;
        let cache = KernelCache::only(&self.folder);
        for (k, camera) in cameras.iter_mut().enumerate() {
            camera.shown = open.take_first(k, 1, &cache, progress)?.shown;
        }
        Ok(open.comparison(cameras))
    }
}

/// SHA-256 of everything that decides the answers.
fn key(comparison: &Comparison, progress: &dyn Progress) -> Result<String> {
    let mut hash = Sha256::new();
    hash.update(env!("CARGO_PKG_VERSION"));
    // What is asked for, with the names of the files; what they say follows.
    hash.update(
        serde_json::to_vec(comparison)
            .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?,
    );
    let mut files = Camera::read(&comparison.camera)?.files;
    for listed in &comparison.designs {
        let design = Design::read_with(&listed.design, progress)?;
        let solver = metalith_cell::cache_file::solver_of(design.cell.shape);
        hash.update(format!("{solver} {} ", design.optics_digest()?));
        // The file itself for what it verifies: by which cell, at which wavelengths.
        files.extend([listed.design.clone(), listed.layout.clone()]);
        if let Some(camera) = &listed.camera {
            files.extend(Camera::read(camera)?.files);
        }
    }
    files.extend(
        comparison
            .photographs
            .iter()
            .chain(&comparison.learnt)
            .chain(&comparison.lpips)
            .cloned(),
    );
    for path in files {
        hash.update(file_digest(&path)?);
    }
    Ok(hex(&hash.finalize()))
}

/// Plan a comparison into a folder: the kernels of all designs, manifest. A folder that holds the plan of the same
/// comparison keeps it.
///
/// # Errors
/// If a file cannot be used, the folder holds another plan, or the user stopped it.
pub fn plan_comparison(comparison: &Comparison, folder: &Path, progress: &dyn Progress) -> Result<ComparisonPlan> {
    let comparison = placed(comparison)?;
    let open = comparison.open(progress)?;
    open.notes().iter().for_each(|note| progress.warn(note));
    let key = key(&comparison, progress)?;
    if let Some(known) = ComparisonPlan::known_in(folder, &key)? {
        return Ok(known);
    }
    let cache = KernelCache::made(folder);
    let equal_time_ms = open.equal_time_ms(&cache, progress)?;
    // Cameras that were asked for their time have their kernels.
    if equal_time_ms.is_none() {
        for k in 0..comparison.count() {
            open.prepare(k, &cache, progress)?;
        }
    }
    let plan = ComparisonPlan {
        schema: SCHEMA,
        work: ComparisonPlan::WORK.into(),
        key,
        comparison: comparison.clone(),
        equal_time_ms,
        folder: folder.to_owned(),
    };
    plan.write_in(folder)?;
    Ok(plan)
}

/// Copy with paths that hold wherever a shard is made.
fn placed(comparison: &Comparison) -> Result<Comparison> {
    let design = |listed: &ListedDesign| {
        Ok(ListedDesign {
            design: absolute(&listed.design)?,
            layout: absolute(&listed.layout)?,
            camera: listed.camera.as_deref().map(absolute).transpose()?,
            ..listed.clone()
        })
    };
    Ok(Comparison {
        camera: absolute(&comparison.camera)?,
        designs: comparison.designs.iter().map(design).collect::<Result<_>>()?,
        photographs: comparison
            .photographs
            .iter()
            .map(|p| absolute(p))
            .collect::<Result<_>>()?,
        learnt: comparison.learnt.iter().map(|p| absolute(p)).collect::<Result<_>>()?,
        lpips: comparison.lpips.as_deref().map(absolute).transpose()?,
        ..comparison.clone()
    })
}
