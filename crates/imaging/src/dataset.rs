//! Pairs for learning: frames, and the scenes that they are of.
//!
//! The noise of an image follows from its own bytes and the seed of the set, so that its frame is the same whatever the
//! order, the number of threads or the machine. Files appear whole and say what they were made from: a pair that is there is kept
//! if it is of this image, seed, chip and camera, and undamaged, so that a set that was stopped goes on where it was.
//!
//! Numbers of a frame begin at a black level, as those of cameras do: what noise has made darker than nothing would be cut at
//! zero otherwise, and dark pixels brighter on average than they are.

use std::path::{Path, PathBuf};

use metalith_core::file::{InputFiles, file_digest, read_at_most};
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, FolderLock, Progress, Result, srgb};
use metalith_design::Design;
use metalith_sensor::Camera;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::imaging_system::ImagingSystem;
use crate::operator::FrameOperator;
use crate::png16::{self, FrameLevels};
use crate::scene::SceneImage;

/// Name of the file that lists the pairs.
const MANIFEST: &str = "manifest.json";
/// Images of one shard: a folder named by the range of their numbers.
const SHARD: usize = 1000;
/// Format of the files of a set, in words that change with it: files of an older format are made anew.
const FORMAT: &str = "frames with their levels";
/// Black level over the deviation of what reading adds: one dark pixel of a thousand million is cut at zero.
const DEVIATIONS: f64 = 6.0;
/// Least and largest black level (numbers of the file).
const BLACK: [f64; 2] = [64.0, 32_768.0];

/// Contents of `manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetManifest {
    pub design: String,
    pub camera: String,
    /// Origin of the frames; empty in sets that have no black level.
    #[serde(default)]
    pub made_from: DatasetOrigin,
    pub seed: u64,
    pub field_deg: f64,
    /// Number in a frame where there is no signal.
    #[serde(default)]
    pub black_level: u16,
    /// Number of full scale.
    #[serde(default)]
    pub white: u16,
    /// Signal of a unit of light in each channel, of full scale: light is (number - black_level) / (white - black_level) / gain.
    pub gain: Vec<f64>,
    pub pairs: Vec<DatasetPair>,
}

/// Digests of what frames were made with, each a SHA-256 in hexadecimal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DatasetOrigin {
    /// Digest of layout, materials and cell of the design ([`Design::simulation_digest`]).
    pub design_sha256: String,
    /// Digest of the layout file.
    pub layout_sha256: String,
    /// Digest of the camera file and its curves.
    pub camera_sha256: String,
    /// Digest of the model file, if the chip is taken as fabricated.
    pub model_sha256: Option<String>,
}

impl DatasetOrigin {
    /// Origin from a design, the file of its layout, a camera and the file of a model, if there is one.
    ///
    /// # Errors
    /// If a material is not known, or a file cannot be read.
    pub fn of(design: &Design, layout: &Path, camera: &Camera, model: Option<&Path>) -> Result<Self> {
        let digest = |file: &Path| file_digest(file).map(|d| hex(&d));
        let camera = serde_json::to_vec(camera)
            .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
        Ok(Self {
            design_sha256: design.simulation_digest()?,
            layout_sha256: digest(layout)?,
            camera_sha256: hex(&Sha256::digest(camera)),
            model_sha256: model.map(digest).transpose()?,
        })
    }
}

/// One frame and its scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetPair {
    /// File name of the image that it is of.
    pub image: String,
    /// SHA-256 of the image.
    pub image_sha256: String,
    /// 16-bit PNG, from `black_level` to `white`; with a colour filter array the mosaic, else channel by channel below one another.
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

/// Names of the frame and the scene of image number `i`, from the folder of the set.
fn pair_files(i: usize) -> [String; 2] {
    ["frame", "truth"].map(|kind| format!("{}/{i:06}.{kind}.png", shard(i)))
}

/// Number of a frame where there is no signal: reading does not bring it below zero, and neither do the steps of the sensor.
pub(crate) fn black_level(camera: &Camera) -> u16 {
    let read = camera.sensor.noise.of_exposure(camera.exposure.time_s).read;
    // Of what is between it and the number of full scale.
    let below = DEVIATIONS * read + 0.5 * camera.sensor.step();
    let level = f64::from(png16::WHITE) * below / (1.0 + below);
    level.ceil().clamp(BLACK[0], BLACK[1]) as u16
}

impl DatasetManifest {
    /// Manifest of a set that has no pairs yet.
    pub fn of(system: &ImagingSystem, made_from: DatasetOrigin, seed: u64) -> Self {
        Self {
            design: system.design.name.clone(),
            camera: system.camera.name.clone(),
            made_from,
            seed,
            field_deg: system.view.field_deg,
            black_level: black_level(&system.camera),
            white: png16::WHITE,
            gain: system.exposure.gain.clone(),
            pairs: Vec::new(),
        }
    }
}

/// Write one pair for each image into the folder of a turn, and the manifest when all are there: `manifest` with these pairs. Pairs
/// of an earlier set with more images are removed. `read`
/// gives the scene of an image. Ask [`check_images`](crate::check_images) first: here an image that cannot be used stops the work.
///
/// # Errors
/// If an image cannot be read or is not of the size that the imaging system was opened for, a pair would replace an input of the turn,
/// a file cannot be written, or the user stopped it; what is complete is kept. If another process without a lock wrote other pairs
/// meanwhile.
pub fn write_dataset(
    system: &ImagingSystem,
    operator: &FrameOperator<'_>,
    images: &[PathBuf],
    read: &dyn Fn(&Path) -> Result<SceneImage>,
    mut manifest: DatasetManifest,
    turn: &FolderLock,
    progress: &dyn Progress,
) -> Result<DatasetManifest> {
    check_pairs_apart(images.len(), turn.folder(), turn.inputs())?;
    clear_unfinished(turn);
    progress.begin("recording frames", images.len() as u64);
    let writer = PairWriter::new(system, operator, manifest.seed, turn.folder());
    for (i, image) in images.iter().enumerate() {
        progress.check_stopped()?;
        manifest.pairs.push(writer.write(image, i, read)?);
        progress.advance(1);
    }
    write_dataset_manifest(turn.folder(), &manifest)?;
    clear_beyond(turn, images.len())?;
    if !turn.is_held() {
        check_own(turn.folder(), &manifest)?;
    }
    Ok(manifest)
}

/// Refuse a folder in which the pairs of so many images would replace an input, such as frames of another set that are used as
/// images: asked before any work.
///
/// # Errors
/// With the path of the first such file.
pub fn check_pairs_apart(images: usize, folder: &Path, inputs: &InputFiles) -> Result<()> {
    inputs.check_output(&folder.join(MANIFEST))?;
    let mut files = (0..images).flat_map(pair_files);
    files.try_for_each(|name| inputs.check_output(&folder.join(name)))
}

/// Remove what killed runs left of files of pairs, those of images that this set has not among them.
fn clear_unfinished(turn: &FolderLock) {
    for path in files_in_shards(turn) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let finished = name.strip_prefix('.').and_then(|name| name.strip_suffix(".part"));
        if let Some(file) = finished.map(|name| path.with_file_name(name))
            && number_of(&file).is_some()
        {
            AtomicFile::clear(&file);
        }
    }
}

/// Remove the pairs that an earlier set in this folder had beyond so many images. Files that this program has not written stay.
fn clear_beyond(turn: &FolderLock, images: usize) -> Result<()> {
    for path in files_in_shards(turn) {
        let is_beyond = number_of(&path).is_some_and(|number| number >= images);
        let is_ours = || {
            let bytes = read_at_most(&path, png16::LONGEST, "a picture of the set");
            bytes.is_ok_and(|bytes| png16::source_of(&bytes).is_some())
        };
        if is_beyond && !turn.inputs().contains(&path) && is_ours() {
            AtomicFile::discard(&path)?;
        }
    }
    Ok(())
}

/// Files in the folders of shards; none without a lock, where they may be those of another run.
fn files_in_shards(turn: &FolderLock) -> Vec<PathBuf> {
    if !turn.is_held() {
        return Vec::new();
    }
    let entries = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    entries(turn.folder()).iter().flat_map(|shard| entries(shard)).collect()
}

/// Number of the image that a file with the path of one of a pair is of.
fn number_of(file: &Path) -> Option<usize> {
    let number = file.file_name()?.to_str()?.split('.').next()?.parse().ok()?;
    pair_files(number)
        .iter()
        .any(|own| file.ends_with(own))
        .then_some(number)
}

/// Succeeds if the pairs that are there are those of a manifest; else the manifest is removed.
fn check_own(folder: &Path, manifest: &DatasetManifest) -> Result<()> {
    let is = |name: &str, digest: &str| file_digest(&folder.join(name)).is_ok_and(|found| hex(&found) == digest);
    let is_own = |p: &DatasetPair| is(&p.frame, &p.frame_sha256) && is(&p.truth, &p.truth_sha256);
    if manifest.pairs.iter().all(is_own) {
        return Ok(());
    }
    AtomicFile::discard(&folder.join(MANIFEST))?;
    Err(Error::refused(
        "file/changed-meanwhile",
        format!("another process wrote pairs into {} at the same time", folder.display()),
        "let one program at a time write into this folder, and try again",
    ))
}

/// Write `manifest.json` of a set.
///
/// # Errors
/// If the file cannot be written.
pub fn write_dataset_manifest(folder: &Path, manifest: &DatasetManifest) -> Result<()> {
    metalith_report::write_json(&folder.join(MANIFEST), "dataset", manifest)
}

/// Writer of the pairs of a set.
pub struct PairWriter<'a, 'o> {
    system: &'a ImagingSystem,
    operator: &'a FrameOperator<'o>,
    seed: u64,
    folder: &'a Path,
    /// Digest of chip and camera.
    system_digest: [u8; 32],
    levels: FrameLevels,
}

impl<'a, 'o> PairWriter<'a, 'o> {
    /// Writer for the simulation of an imaging system, noise of a seed, and a folder.
    pub fn new(system: &'a ImagingSystem, operator: &'a FrameOperator<'o>, seed: u64, folder: &'a Path) -> Self {
        Self {
            system,
            operator,
            seed,
            folder,
            system_digest: system.digest(),
            levels: FrameLevels {
                black: black_level(&system.camera),
                camera: png16::camera_digest(&system.camera),
            },
        }
    }

    /// Write the frame and the scene of image number `i`, if they are not there undamaged. `read` gives the scene of an image.
    ///
    /// # Errors
    /// If the image cannot be read or is not of the size that the imaging system was opened for, or a file cannot be written.
    pub fn write(&self, image: &Path, i: usize, read: &dyn Fn(&Path) -> Result<SceneImage>) -> Result<DatasetPair> {
        let bytes = read_at_most(image, png16::LONGEST, "an image")?;
        let mut hasher = Sha256::new();
        hasher.update(&bytes);
        let image_digest = hasher.clone().finalize();
        hasher.update(self.seed.to_le_bytes());
        let own = hasher.clone().finalize();
        let own_seed = u64::from_le_bytes(own[..8].try_into().expect("eight bytes"));
        hasher.update(self.system_digest);
        hasher.update(FORMAT);
        let source = hex(&hasher.finalize());
        let [of_frame, of_truth] = ["frame", "truth"].map(|kind| format!("{source} {kind}"));
        let [frame, truth] = pair_files(i);
        let (frame_file, truth_file) = (self.folder.join(&frame), self.folder.join(&truth));
        let kept = |file: &Path, of: &str| {
            let bytes = read_at_most(file, png16::LONGEST, "a picture of the set").ok()?;
            png16::source_of(&bytes).is_some_and(|s| s == of).then_some(bytes)
        };
        let pair = if let (Some(frame), Some(truth)) = (kept(&frame_file, &of_frame), kept(&truth_file, &of_truth)) {
            AtomicFile::clear(&frame_file);
            AtomicFile::clear(&truth_file);
            [frame, truth]
        } else {
            let scene = read(image)?;
            let scene = self.system.simulated(&scene);
            let recorded = self.system.record(self.operator, &scene, own_seed)?;
            let ideal = self.system.truth(&scene).mapv(srgb::encoded);
            let frame = png16::grey(&recorded.planes, &self.levels, &of_frame);
            let truth = png16::colour(&ideal, Some(&of_truth));
            // It speaks of other pairs from now on.
            AtomicFile::discard(&self.folder.join(MANIFEST))?;
            AtomicFile::write(&frame_file, &frame)?;
            AtomicFile::write(&truth_file, &truth)?;
            [frame, truth]
        };
        let [frame_sha256, truth_sha256] = pair.map(|bytes| hex(&Sha256::digest(bytes)));
        Ok(DatasetPair {
            image: image
                .file_name()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            image_sha256: hex(&image_digest),
            frame_sha256,
            truth_sha256,
            frame,
            truth,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exposure::{ChosenExposure, expose};
    use metalith_sensor::SensorNoise;
    use ndarray::Array2;

    #[test]
    fn shards_are_named_by_their_range() {
        assert_eq!(shard(0), "000000-000999");
        assert_eq!(shard(1999), "001000-001999");
    }

    #[test]
    fn dark_pixels_of_a_file_are_not_brighter_than_those_of_the_frame() {
        /// Half of a number of the file, and rounding of sums in double precision.
        const ROUNDING: f64 = 0.5 + 1e-6;
        let mut camera = Camera::three_bands(5.86);
        for (read_noise_e, gain_e) in [(4.0, 1.0), (60.0, 20.0), (0.0, 0.001)] {
            camera.sensor.gain_e = gain_e;
            camera.sensor.noise = SensorNoise::Electrons {
                full_well_e: 20_000.0,
                read_noise_e,
                dark_current_e_s: 0.0,
            };
            let black = black_level(&camera);
            let light = vec![Array2::zeros((300, 300)); 3];
            let frame = expose(&camera, &ChosenExposure::of_gain(&camera, &[1.0; 3]), &light, 5);
            assert!(frame.planes[0].iter().any(|v| *v < 0.0) || read_noise_e == 0.0);
            let numbers = png16::tests::numbers(&png16::grey(&frame.planes, &png16::tests::above(black), ""));
            let range = f64::from(png16::WHITE - black);
            for (signal, number) in frame.planes.iter().flatten().zip(&numbers) {
                let off = f64::from(*number) - f64::from(black) - range * f64::from(*signal);
                assert!(off.abs() < ROUNDING, "{black} {signal} {number}");
            }
        }
    }
}
