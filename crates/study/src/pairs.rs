//! Frames and scenes for learning, in shards: the same files as `metalith dataset` writes alone.

use std::path::{Path, PathBuf};
use std::time::Instant;

use metalith_core::file::{InputFiles, file_digest, read_at_most};
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_imaging::scene::{SceneImage, read_far_scene};
use metalith_imaging::{
    DatasetManifest, DatasetOrigin, DatasetPair, ImagingSystem, KernelCache, PairWriter, check_images,
    check_pairs_apart, write_dataset_manifest,
};
use metalith_optics::CalibratedModel;
use metalith_sensor::{Camera, StatedExposure};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::manifest::{Manifest, absolute, another_plan, manifest};
use crate::sharding::{Sharding, parts_per_shard};

/// Version of the format of the manifest. Frames of version 1 have no black level.
const SCHEMA: u32 = 2;
/// Longest image (bytes).
const LONGEST: u64 = 1 << 30;

/// Request for a data set for learning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairsRequest {
    pub design: PathBuf,
    pub layout: PathBuf,
    pub camera: PathBuf,
    /// The chip as fabricated; as drawn if left out.
    pub model: Option<PathBuf>,
    /// Angle from the left to the right edge of a scene (degrees).
    pub field_deg: f64,
    /// Light and time, in place of what the camera file states.
    #[serde(default, skip_serializing_if = "StatedExposure::is_none")]
    pub exposure: StatedExposure,
    /// Seed of the noise.
    pub seed: u64,
    /// Paths in the order of the pairs.
    pub images: Vec<PathBuf>,
}

/// The manifest of such a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairsPlan {
    schema: u32,
    work: String,
    /// SHA-256 of all that decides the pairs, in hexadecimal.
    pub key: String,
    pub request: PairsRequest,
    /// SHA-256 of each image.
    pub digests: Vec<String>,
    pub images_per_shard: u64,
    /// Wall time of the first pair on the machine and threads of the plan (s).
    pub seconds_per_image: f64,
    /// The manifest of the set, but for its pairs.
    head: DatasetManifest,
    /// Folder of the plan and of the pairs.
    #[serde(skip)]
    pub folder: PathBuf,
}

fn image_digest(image: &Path) -> Result<String> {
    Ok(hex(&Sha256::digest(read_at_most(image, LONGEST, "an image")?)))
}

manifest!(PairsPlan, |plan| plan.images_per_shard > 0
    && plan.digests.len() == plan.request.images.len());

impl PairsPlan {
    /// Value of `work` in the manifest.
    pub(crate) const WORK: &'static str = "dataset";

    /// Division of the work into shards.
    pub fn cut(&self) -> Sharding {
        Sharding {
            key: self.key.clone(),
            part: "pair",
            parts: self.digests.len() as u64,
            per_shard: self.images_per_shard,
            folder: self.folder.clone(),
            files_of: Some(files_of_pair),
        }
    }

    /// Make shards with their pairs. Kernels are those of the plan: none are made here.
    ///
    /// # Errors
    /// If a file has changed since it was planned, kernels are not there, a pair cannot be made, or the user stopped it.
    pub fn run(&self, shards: &[u64], progress: &dyn Progress) -> Result<()> {
        if hex(&self.request.key(&self.digests, progress)?) != self.key {
            return Err(another_plan(&self.folder));
        }
        let system = self.request.system(&KernelCache::only(&self.folder), progress)?;
        let operator = system.simulation();
        let writer = PairWriter::new(&system, &operator, self.request.seed, &self.folder);
        let pair = |k: u64| {
            let k = k as usize;
            let image = &self.request.images[k];
            // Before anything of another image is written.
            if image_digest(image)? != self.digests[k] {
                return Err(Error::refused(
                    "study/input-changed",
                    format!("{} has changed since the set was planned", image.display()),
                    "plan it again into another folder",
                ));
            }
            writer.write(image, k, &|p| self.request.scene(p))
        };
        self.cut().make_all(shards, &pair, progress)
    }

    /// Write the manifest of the set when all pairs are there.
    ///
    /// # Errors
    /// If pairs are missing, or one of their files is not what its shard wrote, all named; if the manifest cannot be
    /// written, or the user stopped it.
    pub fn merge(&self, progress: &dyn Progress) -> Result<DatasetManifest> {
        let pairs: Vec<DatasetPair> = self.cut().whole(&|_| None, progress)?;
        let manifest = DatasetManifest {
            pairs,
            ..self.head.clone()
        };
        write_dataset_manifest(&self.folder, &manifest)?;
        Ok(manifest)
    }
}

/// Files of the pair of a line.
fn files_of_pair(line: &str) -> Option<Vec<(String, String)>> {
    let pair: DatasetPair = serde_json::from_str(line).ok()?;
    Some(vec![(pair.frame, pair.frame_sha256), (pair.truth, pair.truth_sha256)])
}

impl PairsRequest {
    /// SHA-256 of everything that decides the pairs.
    fn key(&self, digests: &[String], progress: &dyn Progress) -> Result<[u8; 32]> {
        let design = Design::read_with(&self.design, progress)?;
        let mut hash = Sha256::new();
        let solver = metalith_cell::cache_file::solver_of(design.cell.shape);
        hash.update(format!(
            "{} {solver} {} {} {}",
            env!("CARGO_PKG_VERSION"),
            design.optics_digest()?,
            self.field_deg,
            self.seed
        ));
        if !self.exposure.is_none() {
            hash.update(format!("{:?}", self.exposure));
        }
        // The file itself for what it verifies: by which cell, at which wavelengths.
        let mut files = vec![self.design.clone(), self.layout.clone()];
        files.extend(Camera::read(&self.camera)?.files);
        files.extend(self.model.clone());
        for path in files {
            hash.update(file_digest(&path)?);
        }
        for (image, digest) in self.images.iter().zip(digests) {
            hash.update(image.file_name().unwrap_or_default().as_encoded_bytes());
            hash.update(digest);
        }
        Ok(hash.finalize().into())
    }

    fn scene(&self, image: &Path) -> Result<SceneImage> {
        read_far_scene(image, self.field_deg)
    }

    fn system(&self, cache: &KernelCache, progress: &dyn Progress) -> Result<ImagingSystem> {
        let design = Design::read_with(&self.design, progress)?;
        let camera = Camera::read(&self.camera)?.stated(&self.exposure)?;
        let model = self.model.as_deref().map(CalibratedModel::read).transpose()?;
        let first = self.images.first();
        let first = first.ok_or_else(|| {
            Error::refused(
                "scene/no-images",
                "the folder has no images",
                "give a folder with at least one image",
            )
        })?;
        ImagingSystem::open_cached(
            &design,
            &self.layout,
            &camera,
            model.as_ref(),
            &self.scene(first)?,
            cache,
            progress,
        )
    }
}

/// Plan a set for learning into a folder: all images read, kernels, the first pair to know its time, manifest. A folder that holds
/// the plan of the same set keeps it.
///
/// # Errors
/// If files cannot be used, all images among them named, the folder holds another plan, or the user stopped it.
pub fn plan_pairs(
    request: &PairsRequest,
    folder: &Path,
    images_per_shard: Option<u64>,
    progress: &dyn Progress,
) -> Result<PairsPlan> {
    let request = request.placed()?;
    check_pairs_apart(
        request.images.len(),
        folder,
        &InputFiles::of(request.images.iter().map(PathBuf::as_path)),
    )?;
    progress.begin("digests of the images", request.images.len() as u64);
    let mut digests = Vec::new();
    for image in &request.images {
        progress.check_stopped()?;
        digests.push(image_digest(image)?);
        progress.advance(1);
    }
    let key = hex(&request.key(&digests, progress)?);
    if let Some(known) = PairsPlan::known_in(folder, &key)? {
        return Ok(known);
    }
    check_images(&request.images, progress)?;
    let system = request.system(&KernelCache::made(folder), progress)?;
    let origin = DatasetOrigin::of(
        &system.design,
        &request.layout,
        &system.camera,
        request.model.as_deref(),
    )?;
    let begun = Instant::now();
    let operator = system.simulation();
    let writer = PairWriter::new(&system, &operator, request.seed, folder);
    writer.write(&request.images[0], 0, &|p| request.scene(p))?;
    let seconds_per_image = begun.elapsed().as_secs_f64();
    let plan = PairsPlan {
        schema: SCHEMA,
        work: PairsPlan::WORK.into(),
        key,
        images_per_shard: parts_per_shard(images_per_shard, seconds_per_image, digests.len() as u64),
        seconds_per_image,
        head: DatasetManifest::of(&system, origin, request.seed),
        request,
        digests,
        folder: folder.to_owned(),
    };
    plan.write_in(folder)?;
    Ok(plan)
}

impl PairsRequest {
    /// Copy with paths that hold wherever a shard is made.
    fn placed(&self) -> Result<Self> {
        Ok(Self {
            design: absolute(&self.design)?,
            layout: absolute(&self.layout)?,
            camera: absolute(&self.camera)?,
            model: self.model.as_deref().map(absolute).transpose()?,
            images: self.images.iter().map(|i| absolute(i)).collect::<Result<_>>()?,
            ..self.clone()
        })
    }
}
