//! The training of the last stage of a camera.

use std::path::Path;

use metalith_core::{Progress, Result};

use crate::learning::{TrainingReport, TrainingSpec, learn};
use crate::stacks::Stacks;

/// Teach a last stage, go on where a state on the disk stands, and write the weights in the end. A user who stops it loses
/// nothing: the state is written first. `first`: weights to begin with, random if there are none; `files`: weights, state.
///
/// # Errors
/// If the state is of another training, files cannot be written, or the user stopped it.
pub fn train_post_processor(
    stacks: &Stacks,
    spec: &TrainingSpec,
    first: Option<Vec<f32>>,
    files: [&Path; 2],
    progress: &dyn Progress,
) -> Result<TrainingReport> {
    learn(stacks, spec, first, files, progress)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::TrainingSet;
    use crate::learning::tests::{gradients_hold, picture};
    use crate::stacks::Stack;
    use metalith_core::Silent;
    use metalith_prior::{PostProcessor, Provenance};
    use ndarray::Array3;

    const PIECE: usize = 32;

    /// Pictures that are too dark, and one that is grey.
    fn stacks(count: usize) -> Stacks {
        let stack = |k: usize| {
            let clean = picture(k, 56);
            let dark = clean.mapv(|v| 0.6 * v);
            let grey = Array3::from_shape_fn(clean.dim(), |(y, x, _)| clean[[y, x, 1]]);
            Stack::new(&[dark, grey], &clean).unwrap()
        };
        let provenance = Provenance {
            kind: "test".into(),
            camera: "none".into(),
            pictures: 2,
            optics: Some("light".into()),
            refits: 0,
        };
        Stacks::new((0..count).map(stack).collect(), provenance, PIECE).unwrap()
    }

    fn spec(steps: u64) -> TrainingSpec {
        TrainingSpec {
            steps,
            batch: 2,
            piece: PIECE,
            seed: 4,
            ..TrainingSpec::default()
        }
    }

    #[test]
    fn gradients_are_those_of_differences() {
        let stacks = stacks(3);
        gradients_hold(stacks.size(), |network| stacks.loss(network, &spec(1), 7));
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
                .install(|| train_post_processor(&stacks, &spec(steps), None, [&out, &state], &Silent))
                .unwrap();
            (report.held_out_psnr_db, std::fs::read(out).unwrap())
        };
        let (begun, _) = learn("begun", 1, 1);
        let (one, bytes) = learn("one", 1, 40);
        let (_, again) = learn("two", 2, 40);
        assert!(bytes == again, "weights depend on the number of threads");
        assert!(one - begun > LEAST_GAIN_DB, "{begun} {one}");
        let post_processor = PostProcessor::read(&folder.path().join("one")).unwrap();
        assert_eq!(post_processor.provenance(), stacks.provenance());
        // Sides that are no multiples of eight come back as they were.
        let odd = picture(1, 45);
        assert_eq!(
            post_processor.finish(&[odd.clone(), odd.clone()]).unwrap().dim(),
            odd.dim()
        );
        assert_eq!(
            post_processor.finish(&[odd]).unwrap_err().id(),
            "stage/picture-count-differs"
        );
    }

    #[test]
    fn damaged_weights_and_those_of_others_are_refused() {
        let stacks = stacks(2);
        let folder = tempfile::tempdir().unwrap();
        let (out, state) = (folder.path().join("w"), folder.path().join("w.state"));
        train_post_processor(&stacks, &spec(1), None, [&out, &state], &Silent).unwrap();
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
        assert!(replaced("stage", "stags").contains("trained for"));
        // Not a number, in the last weight.
        let mut bytes = whole.clone();
        let n = bytes.len();
        bytes[n - 2..].copy_from_slice(&half::f16::NAN.to_le_bytes());
        assert!(refused(&bytes).contains("no numbers"));
        // A denoiser is no last stage.
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../prior/weights/denoiser.safetensors");
        assert!(PostProcessor::read(&shipped).is_err());
    }
}
