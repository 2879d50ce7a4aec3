//! Training set of the last stage of a camera: pictures of frames, and the scenes that they are of.

use std::collections::HashMap;
use std::path::Path;

use half::f16;
use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, Result};
use metalith_prior::parts::{Network, STAGE, Size, cut, piled, seen};
use metalith_prior::{COLOURS, PostProcessor, Provenance};
use ndarray::Array3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use sha2::{Digest, Sha256};

use crate::examples::is_held_out;
use crate::learning::{Sample, TrainingSet, TrainingSpec, loss, psnr_db};

/// Longest file of the pictures of a frame (bytes).
const LONGEST: u64 = 4 << 30;
/// Tensors in such a file.
const NAMES: [&str; 2] = ["pictures", "clean"];

/// The pictures of one frame and its scene, all in sRGB values, in half precision.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// `[row, column, colour]`, picture after picture.
    pictures: Array3<f16>,
    clean: Array3<f16>,
}

impl Stack {
    /// Stack of pictures `[row, column, colour]` and the clean one, all of one size; the first picture is the one that
    /// is corrected.
    ///
    /// # Errors
    /// If there is no picture, or one has another size.
    pub fn new(pictures: &[Array3<f32>], clean: &Array3<f32>) -> Result<Self> {
        Ok(Self {
            pictures: piled(pictures, clean.dim())?.mapv(f16::from_f32),
            clean: clean.mapv(f16::from_f32),
        })
    }

    /// Keep it in a file, with what it is of.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path, of: &str) -> Result<()> {
        let bytes = [&self.pictures, &self.clean].map(|planes| planes.iter().flat_map(|v| v.to_le_bytes()).collect());
        let about = HashMap::from([
            ("of".to_owned(), of.to_owned()),
            ("sha256".to_owned(), digest(&bytes, of)),
        ]);
        let shapes = [&self.pictures, &self.clean].map(|planes| planes.shape().to_vec());
        let views = NAMES.iter().zip(shapes).zip(&bytes).map(|((name, shape), bytes)| {
            let view = TensorView::new(Dtype::F16, shape, bytes).expect("two bytes a number");
            (*name, view)
        });
        let file = safetensors::serialize(views, Some(about))
            .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
        AtomicFile::write(path, &file)
    }

    /// The one that a file keeps, if it is whole and of the same; else it has to be made again.
    pub fn kept(path: &Path, of: &str) -> Option<Self> {
        let file = read_at_most(path, LONGEST, "pictures of a frame").ok()?;
        let (_, header) = SafeTensors::read_metadata(&file).ok()?;
        let about = header.metadata().as_ref()?;
        let tensors = SafeTensors::deserialize(&file).ok()?;
        let [pictures, clean] = NAMES.map(|name| {
            let tensor = tensors.tensor(name).ok()?;
            let [rows, columns, planes] = *tensor.shape() else {
                return None;
            };
            let values = tensor
                .data()
                .as_chunks()
                .0
                .iter()
                .map(|b| f16::from_le_bytes(*b))
                .collect();
            Array3::from_shape_vec((rows, columns, planes), values).ok()
        });
        let kept = Self {
            pictures: pictures?,
            clean: clean?,
        };
        let bytes = [&kept.pictures, &kept.clean].map(|planes| planes.iter().flat_map(|v| v.to_le_bytes()).collect());
        let same = about.get("of").is_some_and(|o| o == of) && about.get("sha256") == Some(&digest(&bytes, of));
        let (rows, columns, planes) = kept.clean.dim();
        let fits = planes == COLOURS && (rows, columns) == (kept.pictures.dim().0, kept.pictures.dim().1);
        (same && fits).then_some(kept)
    }

    /// All numbers in their order: pictures pixel by pixel, then the clean one.
    fn values(&self) -> impl Iterator<Item = f16> {
        self.pictures.iter().chain(&self.clean).copied()
    }

    /// Pictures behind one another.
    pub(crate) fn pile(&self) -> Array3<f32> {
        self.pictures.mapv(f16::to_f32)
    }

    /// The clean picture.
    pub(crate) fn truth(&self) -> Array3<f32> {
        self.clean.mapv(f16::to_f32)
    }

    /// Number of pictures of the frame.
    pub fn pictures(&self) -> usize {
        self.pictures.dim().2 / COLOURS
    }

    /// Rows and columns.
    pub fn size(&self) -> [usize; 2] {
        let (rows, columns, _) = self.clean.dim();
        [rows, columns]
    }
}

/// SHA-256 of what is kept of a frame.
fn digest(bytes: &[Vec<u8>; 2], of: &str) -> String {
    let mut hasher = Sha256::new();
    bytes.iter().for_each(|b| hasher.update(b));
    hasher.update(of);
    hex(&hasher.finalize())
}

/// Stacks of one camera to learn from, and others to be judged by.
#[derive(Clone, Debug)]
pub struct Stacks {
    pub(crate) learnt: Vec<Stack>,
    pub(crate) held_out: Vec<Stack>,
    provenance: Provenance,
}

impl Stacks {
    /// Checks that so many photographs of these rows and columns are enough to learn pieces of them, before they are
    /// taken.
    ///
    /// # Errors
    /// If there are fewer than two, or they are smaller than a piece.
    pub fn check(photographs: usize, [rows, columns]: [usize; 2], piece: usize) -> Result<()> {
        if photographs >= 2 && rows.min(columns) >= piece {
            return Ok(());
        }
        Err(Error::refused(
            "train/too-few-photographs",
            format!("{photographs} photographs of {columns} x {rows} pixels are too few or too small for training"),
            format!("give at least two of {piece} x {piece} pixels or more, or a smaller --piece"),
        ))
    }

    /// Stacks of what a network is trained for; every twelfth is held out.
    ///
    /// # Errors
    /// If there are fewer than two, one has another number of pictures, or is smaller than a piece.
    pub fn new(stacks: Vec<Stack>, provenance: Provenance, piece: usize) -> Result<Self> {
        let least = |axis: usize| stacks.iter().map(|s| s.size()[axis]).min().unwrap_or(0);
        Self::check(stacks.len(), [least(0), least(1)], piece)?;
        if let Some(other) = stacks.iter().find(|s| s.pictures() != provenance.pictures) {
            return Err(Error::refused(
                "stage/picture-count-differs",
                format!(
                    "{} pictures of a frame, and {} of others",
                    other.pictures(),
                    provenance.pictures
                ),
                "give as many of each frame",
            ));
        }
        let (mut learnt, mut held_out) = (Vec::new(), Vec::new());
        for (i, stack) in stacks.into_iter().enumerate() {
            if is_held_out(i) {
                held_out.push(stack);
            } else {
                learnt.push(stack);
            }
        }
        Ok(Self {
            learnt,
            held_out,
            provenance,
        })
    }

    /// Provenance of the network: what it is trained for.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// SHA-256 of all pixels.
    pub(crate) fn digest(&self) -> String {
        let mut hasher = Sha256::new();
        for stack in self.learnt.iter().chain(&self.held_out) {
            hasher.update(stack.size().map(|n| (n as u64).to_le_bytes()).concat());
            stack.values().for_each(|v| hasher.update(v.to_le_bytes()));
        }
        hex(&hasher.finalize())
    }
}

impl TrainingSet for Stacks {
    fn size(&self) -> Size {
        Size::post_processor(self.provenance.pictures)
    }

    fn origin(&self, spec: &TrainingSpec) -> serde_json::Value {
        serde_json::json!({ "spec": spec, STAGE: self.provenance, "pictures": self.digest() })
    }

    fn loss(&self, network: &Network, spec: &TrainingSpec, k: u64) -> (f64, Vec<f32>) {
        loss(network, self.sample(spec, k))
    }

    fn held_out(&self, network: Network) -> f64 {
        let post_processor = PostProcessor::of_network(network, self.provenance.clone());
        let all = self.held_out.iter().map(|stack| {
            let found = post_processor.corrected(&stack.pile());
            psnr_db(&found, &stack.truth())
        });
        all.sum::<f64>() / self.held_out.len() as f64
    }

    fn held_out_uncorrected(&self) -> f64 {
        let all = self.held_out.iter().map(|stack| {
            let pile = stack.pile();
            let (rows, columns, _) = pile.dim();
            psnr_db(&cut(&pile, [0; 2], [rows, columns, COLOURS]), &stack.truth())
        });
        all.sum::<f64>() / self.held_out.len() as f64
    }
}

impl Stacks {
    /// Piece number `k` of a seed.
    pub(crate) fn sample(&self, spec: &TrainingSpec, k: u64) -> Sample {
        let mut random = ChaCha8Rng::seed_from_u64(spec.seed);
        random.set_stream(k);
        let stack = &self.learnt[random.random_range(0..self.learnt.len())];
        let [rows, columns] = stack.size();
        let piece = spec.piece;
        let place = [
            random.random_range(0..=rows - piece),
            random.random_range(0..=columns - piece),
        ];
        let of = |planes: &Array3<f16>| cut(planes, place, [piece, piece, planes.dim().2]).mapv(f16::to_f32);
        let pictures = of(&stack.pictures);
        Sample {
            input: seen(&pictures, place, stack.size()),
            picture: cut(&pictures, [0; 2], [piece, piece, COLOURS]),
            clean: of(&stack.clean),
            weight: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::tests::picture;

    #[test]
    fn pictures_of_a_frame_are_kept_and_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stack");
        assert!(Stack::kept(&path, "a").is_none());
        let stack = Stack::new(&[picture(1, 24), picture(2, 24)], &picture(3, 24)).unwrap();
        stack.write(&path, "a").unwrap();
        assert_eq!(Stack::kept(&path, "a").as_ref(), Some(&stack));
        assert!(Stack::kept(&path, "b").is_none());
        let whole = std::fs::read(&path).unwrap();
        for k in (0..whole.len()).step_by(97) {
            let mut bytes = whole.clone();
            bytes[k] ^= 4;
            std::fs::write(&path, bytes).unwrap();
            // Spaces of the header decide nothing.
            assert!(Stack::kept(&path, "a").is_none_or(|found| found == stack), "byte {k}");
        }
        assert!(Stack::new(&[picture(1, 24)], &picture(3, 32)).is_err());
        assert!(Stack::new(&[], &picture(3, 32)).is_err());
    }
}
