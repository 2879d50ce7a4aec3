//! Pairs for learning: frames, and the scenes that they are of.
//!
//! The noise of an image follows from its own bytes and the seed of the set, so that its frame is the same whatever the
//! order, the number of threads or the machine. Files appear whole; what is there already is kept, so that a set that was
//! stopped goes on where it was.

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
    for (i, image) in images.iter().enumerate() {
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        manifest
            .pairs
            .push(write_pair(studio, operator, image, i, read, seed, folder)?);
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

/// Write the frame and the scene of image number `i`, if they are not there. `read` gives the scene of an image.
///
/// # Errors
/// If the image cannot be read or is not of the size that the studio was opened for, or a file cannot be written.
pub fn write_pair(
    studio: &Studio,
    operator: &FrameOperator<'_>,
    image: &Path,
    i: usize,
    read: &dyn Fn(&Path) -> Result<SceneImage>,
    seed: u64,
    folder: &Path,
) -> Result<DatasetPair> {
    let bytes = read_at_most(image, LONGEST, "an image")?;
    let mut hasher = Sha256::new();
    hasher.update(&bytes);
    let image_digest = hasher.clone().finalize();
    hasher.update(seed.to_le_bytes());
    let own = hasher.finalize();
    let own_seed = u64::from_le_bytes(own[..8].try_into().expect("eight bytes"));
    let name = format!("{}/{i:06}", shard(i));
    let (frame, truth) = (format!("{name}.frame.png"), format!("{name}.truth.png"));
    if !folder.join(&frame).exists() || !folder.join(&truth).exists() {
        let scene = read(image)?;
        let recorded = studio.record(operator, &scene, own_seed)?;
        WholeFile::write(&folder.join(&frame), &png16::grey(&recorded.planes))?;
        WholeFile::write(
            &folder.join(&truth),
            &png16::colour(&studio.truth(&scene).mapv(srgb::encoded)),
        )?;
    }
    let digest = |file: &str| {
        let bytes = read_at_most(&folder.join(file), LONGEST, "a picture of the set")?;
        Ok::<_, Error>(hex(&Sha256::digest(bytes)))
    };
    Ok(DatasetPair {
        image: image
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
        image_sha256: hex(&image_digest),
        frame_sha256: digest(&frame)?,
        truth_sha256: digest(&truth)?,
        frame,
        truth,
    })
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
