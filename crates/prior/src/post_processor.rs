//! The last stage of a camera: a network that makes one picture of several that were restored from a frame by classical means.
//!
//! It is smaller than the denoiser, and the same for all cameras but for the number of pictures that it sees. What it learns of, the
//! errors of a camera's own pictures, is of that camera alone: the file of its weights says which.

use std::path::Path;

use metalith_core::{Progress, Result};
use ndarray::Array3;
use serde::{Deserialize, Serialize};

use crate::learning::{TrainingReport, TrainingSpec, learn};
use crate::network::{COLOURS, Network, Plan, Size};
use crate::squares::{SIDE, corrected, cut, mirrored};
use crate::stacks::{Stacks, piled, seen};
use crate::weights::read_described;

/// Where files of weights say what they were taught for.
pub(crate) const STAGE: &str = "stage";
/// Most pictures of a frame.
const MOST: usize = 64;

/// What a last stage is taught for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Kind of pictures, a word.
    pub kind: String,
    /// Digest of all that decides the frames but the scene and the noise.
    pub camera: String,
    /// Pictures of a frame.
    pub pictures: usize,
    /// Digest of what the camera's layout does to light: materials, cell, band. None for cameras without one, and in weights that
    /// were taught before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optics: Option<String>,
}

/// A network that was taught for one camera and one kind of pictures.
#[derive(Clone, Debug)]
pub struct PostProcessor {
    network: Network,
    taught: Provenance,
}

impl PostProcessor {
    /// With the weights of a file that [`train_finisher`] wrote.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or is of a denoiser.
    pub fn read(path: &Path) -> Result<Self> {
        let (taught, weights) = read_described(path, |training| {
            let taught = Provenance::deserialize(training.get(STAGE)?).ok()?;
            let size = Size::finisher(taught.pictures);
            (1..=MOST).contains(&taught.pictures).then_some((taught, size))
        })?;
        let plan = Plan::new(Size::finisher(taught.pictures));
        Ok(Self::of_network(Network::new(&plan, &weights), taught))
    }

    pub(crate) fn of_network(network: Network, taught: Provenance) -> Self {
        Self { network, taught }
    }

    /// What it was taught for.
    pub fn taught(&self) -> &Provenance {
        &self.taught
    }

    /// The picture that is expected of a scene, `[row, column, colour]` in sRGB values, from pictures of one frame of it in the
    /// order in which it was taught by them.
    ///
    /// # Errors
    /// If there are more or fewer of them, or they differ in size.
    pub fn finish(&self, pictures: &[Array3<f32>]) -> Result<Array3<f32>> {
        if pictures.len() != self.taught.pictures {
            return Err(metalith_core::Error::refused(
                "stage/number-of-pictures",
                format!(
                    "{} pictures of a frame for a network that was taught by {}",
                    pictures.len(),
                    self.taught.pictures
                ),
                "give the weights that were taught for this camera",
            ));
        }
        Ok(self.corrected(&piled(pictures, pictures[0].dim())?))
    }

    /// The same of pictures behind one another.
    pub(crate) fn corrected(&self, pile: &Array3<f32>) -> Array3<f32> {
        let (rows, columns, _) = pile.dim();
        let whole = |n: usize| n.next_multiple_of(SIDE).max(SIDE);
        let pile = mirrored(pile, whole(rows), whole(columns));
        let input = seen(&pile, [0; 2], [rows, columns]);
        let first = cut(&pile, [0; 2], [pile.dim().0, pile.dim().1, COLOURS]);
        let found = corrected(&self.network, input, first);
        cut(&found, [0; 2], [rows, columns, COLOURS])
    }
}

/// Teach a last stage, go on where a state on the disk stands, and write the weights in the end. A user who stops it loses
/// nothing: the state is written first.
///
/// # Errors
/// If the state is of another training, files cannot be written, or the user stopped it.
pub fn train_finisher(
    stacks: &Stacks,
    spec: &TrainingSpec,
    out: &Path,
    state: &Path,
    progress: &dyn Progress,
) -> Result<TrainingReport> {
    learn(stacks, spec, out, state, progress)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::Lessons;
    use crate::learning::tests::{gradients_hold, picture};
    use crate::stacks::Stack;
    use metalith_core::Silent;

    const PIECE: usize = 32;

    /// Pictures that are too dark, and one that is grey.
    fn stacks(count: usize) -> Stacks {
        let stack = |k: usize| {
            let clean = picture(k, 56);
            let dark = clean.mapv(|v| 0.6 * v);
            let grey = Array3::from_shape_fn(clean.dim(), |(y, x, _)| clean[[y, x, 1]]);
            Stack::new(&[dark, grey], &clean).unwrap()
        };
        let taught = Provenance {
            kind: "test".into(),
            camera: "none".into(),
            pictures: 2,
            optics: Some("light".into()),
        };
        Stacks::new((0..count).map(stack).collect(), taught, PIECE).unwrap()
    }

    fn spec(steps: u64) -> TrainingSpec {
        TrainingSpec {
            steps,
            batch: 2,
            piece: PIECE,
            seed: 4,
        }
    }

    #[test]
    fn gradients_are_those_of_differences() {
        let stacks = stacks(3);
        gradients_hold(stacks.size(), || stacks.lesson(&spec(1), 7));
    }

    #[test]
    fn a_few_steps_bring_pictures_nearer_on_any_number_of_threads() {
        /// Forty steps take away a half of the error by which dark pictures are off.
        const LEAST_GAIN_DB: f64 = 3.0;
        let stacks = stacks(3);
        let folder = tempfile::tempdir().unwrap();
        let learn = |name: &str, threads: usize, steps: u64| {
            let out = folder.path().join(name);
            let state = folder.path().join(format!("{name}.state"));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let report = pool
                .install(|| train_finisher(&stacks, &spec(steps), &out, &state, &Silent))
                .unwrap();
            (report.held_out_psnr_db, std::fs::read(out).unwrap())
        };
        let (begun, _) = learn("begun", 1, 1);
        let (one, bytes) = learn("one", 1, 40);
        let (_, again) = learn("two", 2, 40);
        assert!(bytes == again, "weights depend on the number of threads");
        assert!(one - begun > LEAST_GAIN_DB, "{begun} {one}");
        let finisher = PostProcessor::read(&folder.path().join("one")).unwrap();
        assert_eq!(finisher.taught(), stacks.taught());
        // Sides that are no multiples of eight come back as they were.
        let odd = picture(1, 45);
        assert_eq!(finisher.finish(&[odd.clone(), odd.clone()]).unwrap().dim(), odd.dim());
        let error = finisher.finish(&[odd]).unwrap_err().to_string();
        assert!(error.contains("taught by 2"), "{error}");
    }

    /// Weights of before say nothing of what a layout does to light; what they say is read, and written as it was.
    #[test]
    fn weights_of_before_can_be_read() {
        let text = r#"{"kind":"blending","camera":"a1","pictures":10}"#;
        let taught: Provenance = serde_json::from_str(text).unwrap();
        assert_eq!(taught.optics, None);
        assert_eq!(serde_json::to_string(&taught).unwrap(), text);
    }

    #[test]
    fn damaged_weights_and_those_of_others_are_refused() {
        let stacks = stacks(2);
        let folder = tempfile::tempdir().unwrap();
        let (out, state) = (folder.path().join("w"), folder.path().join("w.state"));
        train_finisher(&stacks, &spec(1), &out, &state, &Silent).unwrap();
        let whole = std::fs::read(&out).unwrap();
        let refused = |bytes: &[u8]| {
            std::fs::write(&out, bytes).unwrap();
            PostProcessor::read(&out).map(|_| ()).unwrap_err().to_string()
        };
        assert!(refused(&whole[..whole.len() - 2]).contains("no file of weights"));
        assert!(refused(b"").contains("no file of weights"));
        let replaced = |from: &str, to: &str| {
            let mut places = whole[..600].windows(from.len());
            let at = places.position(|w| w == from.as_bytes()).expect("the header says so");
            let mut bytes = whole.clone();
            bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
            refused(&bytes)
        };
        assert!(replaced("\\\"pictures\\\":2", "\\\"pictures\\\":3").contains("has the shape"));
        assert!(replaced("stage", "stags").contains("taught for"));
        // Not a number, in the last weight.
        let mut bytes = whole.clone();
        let n = bytes.len();
        bytes[n - 2..].copy_from_slice(&half::f16::NAN.to_le_bytes());
        assert!(refused(&bytes).contains("no numbers"));
        // A denoiser is no last stage.
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("weights/denoiser.safetensors");
        assert!(
            PostProcessor::read(&shipped)
                .map(|_| ())
                .unwrap_err()
                .to_string()
                .contains("taught for")
        );
    }
}
