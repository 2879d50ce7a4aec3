//! Pairs for learning: frames, and the scenes that they are of.
//!
//! The noise of an image follows from its own bytes and the seed of the set, so that its frame is the same whatever the
//! order, the number of threads or the machine. Files appear whole and say what they were made from: a pair that is there is kept
//! if it is of this image, seed, chip and camera, so that a set that was stopped goes on where it was.

use std::path::{Path, PathBuf};

use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result, WholeFile, srgb};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::operator::FrameOperator;
use crate::png16;
use crate::scene::SceneImage;
use crate::studio::Studio;

/// Images of one shard: a folder named by the range of their numbers.
const SHARD: usize = 1000;
/// Longest file of a set (bytes).
const LONGEST: u64 = 1 << 30;

/// What stands in `manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetManifest {
    pub design: String,
    pub camera: String,
    pub seed: u64,
    pub field_deg: f64,
    /// Signal of a unit of light in each channel, of full scale: what a frame is to be divided by.
    pub gain: Vec<f64>,
    pub pairs: Vec<DatasetPair>,
}

/// One frame and its scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetPair {
    /// File name of the image that it is of.
    pub image: String,
    /// SHA-256 of the image.
    pub image_sha256: String,
    /// 16-bit PNG, full scale being 65535; with a colour filter array the mosaic, else channel by channel below one another.
    pub frame: String,
    pub frame_sha256: String,
    /// 16-bit PNG in sRGB: what an ideal camera of the same channels gives.
    pub truth: String,
    pub truth_sha256: String,
}

/// Folder of the shard that image number `i` is in.
fn shard(i: usize) -> String {
    let first = i / SHARD * SHARD;
    format!("{first:06}-{:06}", first + SHARD - 1)
}

impl DatasetManifest {
    /// Of a set that has no pairs yet.
    pub fn of(studio: &Studio, seed: u64) -> Self {
        Self {
            design: studio.design.name.clone(),
            camera: studio.camera.name.clone(),
            seed,
            field_deg: studio.view.field_deg,
            gain: studio.gain.clone(),
            pairs: Vec::new(),
        }
    }
}

/// Write one pair for each image into a folder, and the manifest when all are there. `read` gives the scene of an image.
///
/// # Errors
/// If an image cannot be read or is not of the size that the studio was opened for, a file cannot be written, or the user
/// stopped it; what is complete is kept.
pub fn write_dataset(
    studio: &Studio,
    operator: &FrameOperator<'_>,
    images: &[PathBuf],
    read: &dyn Fn(&Path) -> Result<SceneImage>,
    seed: u64,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<DatasetManifest> {
    progress.begin("recording frames", images.len() as u64);
    let mut manifest = DatasetManifest::of(studio, seed);
    let writer = PairWriter::new(studio, operator, seed, folder);
    for (i, image) in images.iter().enumerate() {
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        manifest.pairs.push(writer.write(image, i, read)?);
        progress.advance(1);
    }
    write_dataset_manifest(folder, &manifest)?;
    Ok(manifest)
}

/// Write `manifest.json` of a set.
///
/// # Errors
/// If the file cannot be written.
pub fn write_dataset_manifest(folder: &Path, manifest: &DatasetManifest) -> Result<()> {
    metalith_report::write_json(&folder.join("manifest.json"), "dataset", manifest)
}

/// What writes the pairs of a set.
pub struct PairWriter<'a> {
    studio: &'a Studio,
    operator: &'a FrameOperator<'a>,
    seed: u64,
    folder: &'a Path,
    /// Of chip and camera.
    studio_digest: [u8; 32],
}

impl<'a> PairWriter<'a> {
    /// For the simulation of a studio, noise of a seed, and a folder.
    pub fn new(studio: &'a Studio, operator: &'a FrameOperator<'a>, seed: u64, folder: &'a Path) -> Self {
        Self {
            studio,
            operator,
            seed,
            folder,
            studio_digest: studio.digest(),
        }
    }

    /// Write the frame and the scene of image number `i`, if they are not there. `read` gives the scene of an image.
    ///
    /// # Errors
    /// If the image cannot be read or is not of the size that the studio was opened for, or a file cannot be written.
    pub fn write(&self, image: &Path, i: usize, read: &dyn Fn(&Path) -> Result<SceneImage>) -> Result<DatasetPair> {
        let bytes = read_at_most(image, LONGEST, "an image")?;
        let mut hasher = Sha256::new();
        hasher.update(&bytes);
        let image_digest = hasher.clone().finalize();
        hasher.update(self.seed.to_le_bytes());
        let own = hasher.clone().finalize();
        let own_seed = u64::from_le_bytes(own[..8].try_into().expect("eight bytes"));
        hasher.update(self.studio_digest);
        let source = hex(&hasher.finalize());
        let name = format!("{}/{i:06}", shard(i));
        let (frame, truth) = (format!("{name}.frame.png"), format!("{name}.truth.png"));
        let (frame_file, truth_file) = (self.folder.join(&frame), self.folder.join(&truth));
        let is_there = |file: &Path| png16::source_of(file).is_some_and(|s| s == source);
        if !is_there(&frame_file) || !is_there(&truth_file) {
            let scene = read(image)?;
            let recorded = self.studio.record(self.operator, &scene, own_seed)?;
            let ideal = self.studio.truth(&scene).mapv(srgb::encoded);
            WholeFile::write(&frame_file, &png16::grey(&recorded.planes, &source))?;
            WholeFile::write(&truth_file, &png16::colour(&ideal, Some(&source)))?;
        }
        let digest = |file: &Path| {
            let bytes = read_at_most(file, LONGEST, "a picture of the set")?;
            Ok::<_, Error>(hex(&Sha256::digest(bytes)))
        };
        Ok(DatasetPair {
            image: image
                .file_name()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            image_sha256: hex(&image_digest),
            frame_sha256: digest(&frame_file)?,
            truth_sha256: digest(&truth_file)?,
            frame,
            truth,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_named_by_their_range() {
        assert_eq!(shard(0), "000000-000999");
        assert_eq!(shard(1999), "001000-001999");
    }
}
