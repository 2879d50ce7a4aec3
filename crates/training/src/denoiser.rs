//! The denoiser's lessons: pieces of photographs, and noise on them.

use std::path::Path;

use metalith_core::{Progress, Result};

use crate::examples::Photographs;
use crate::learning::{Sample, TrainingReport, TrainingSet, TrainingSpec, learn, loss, psnr_db};
use metalith_prior::NetworkDenoiser;
use metalith_prior::parts::{Network, Size, input};

/// Errors where noise of this deviation is are weighted by one, others by one over theirs.
const EQUAL: f32 = 0.1;
/// Keeps the weight of pieces with hardly any noise within bounds.
const LEAST: f32 = 0.02;
/// Noise of the photographs that are held out.
pub const JUDGED: f32 = 25.0 / 255.0;

/// Teach the denoiser, go on where a state on the disk stands, and write the weights in the end. A user who stops it loses
/// nothing: the state is written first.
///
/// # Errors
/// If the state is of another training, files cannot be written, or the user stopped it.
pub fn train(
    photographs: &Photographs,
    spec: &TrainingSpec,
    out: &Path,
    state: &Path,
    progress: &dyn Progress,
) -> Result<TrainingReport> {
    learn(photographs, spec, None, [out, state], progress)
}

impl TrainingSet for Photographs {
    fn size(&self) -> Size {
        Size::DENOISER
    }

    fn origin(&self, spec: &TrainingSpec) -> serde_json::Value {
        serde_json::json!({ "spec": spec, "photographs": self.digest() })
    }

    fn loss(&self, network: &Network, spec: &TrainingSpec, k: u64) -> (f64, Vec<f32>) {
        loss(network, self.sample(spec, k))
    }

    fn held_out(&self, network: Network) -> f64 {
        let denoiser = NetworkDenoiser::of_network(network);
        let all: Vec<f64> = self
            .judged(JUDGED)
            .map(|(clean, noisy)| {
                let found = denoiser
                    .denoise_even(&noisy, JUDGED)
                    .expect("the own network takes any size");
                psnr_db(&found, clean)
            })
            .collect();
        all.iter().sum::<f64>() / all.len() as f64
    }

    fn held_out_uncorrected(&self) -> f64 {
        let all: Vec<f64> = self
            .judged(JUDGED)
            .map(|(clean, noisy)| psnr_db(&noisy, clean))
            .collect();
        all.iter().sum::<f64>() / all.len() as f64
    }
}

impl Photographs {
    fn sample(&self, spec: &TrainingSpec, k: u64) -> Sample {
        let example = self.example(spec.piece, spec.seed, k);
        let mean = example.deviation.mean().unwrap_or(EQUAL);
        Sample {
            input: input(&example.noisy, &example.deviation),
            picture: example.noisy,
            clean: example.clean,
            weight: EQUAL / (mean + LEAST),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::tests::{gradients_hold, picture};
    use metalith_core::{Error, Silent};

    fn photographs() -> Photographs {
        Photographs::new((0..4).map(|k| (format!("{k}"), picture(k, 80))).collect(), 32).unwrap()
    }

    #[test]
    fn gradients_are_those_of_differences() {
        let spec = TrainingSpec {
            piece: 32,
            seed: 5,
            ..TrainingSpec::default()
        };
        gradients_hold(Size::DENOISER, |network| photographs().loss(network, &spec, 9));
    }

    #[test]
    fn what_is_learnt_is_the_same_on_any_number_of_threads_and_after_a_stop() {
        let photographs = photographs();
        let spec = TrainingSpec {
            steps: 4,
            batch: 3,
            piece: 32,
            seed: 7,
            ..TrainingSpec::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let learn = |name: &str, threads: usize, progress: &dyn Progress| {
            let out = folder.path().join(name);
            let state = folder.path().join(format!("{name}.state"));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| train(&photographs, &spec, &out, &state, progress))
                .map(|_| std::fs::read(out).unwrap())
        };
        let whole = learn("a", 1, &Silent).unwrap();
        assert!(learn("b", 2, &Silent).unwrap() == whole);

        /// Stops after two looks.
        struct Impatient(std::sync::atomic::AtomicU32);
        impl Progress for Impatient {
            fn begin(&self, _: &str, _: u64) {}
            fn advance(&self, _: u64) {}
            fn stopped(&self) -> bool {
                self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= 2
            }
        }
        let stopped = learn("c", 2, &Impatient(0.into()));
        assert!(matches!(stopped, Err(Error::Interrupted)));
        /// Holds the words on the state of the work.
        struct Listener(std::sync::Mutex<Vec<String>>);
        impl Progress for Listener {
            fn begin(&self, _: &str, _: u64) {}
            fn advance(&self, _: u64) {}
            fn note(&self, text: &str) {
                self.0.lock().unwrap().push(text.into());
            }
        }
        let listener = Listener(Vec::new().into());
        learn("d", 2, &listener).unwrap();
        let said = listener.0.into_inner().unwrap();
        assert!(said[0].starts_with("held out") && said.len() == 5, "{said:?}");
        assert!(
            said[1..].iter().all(|s| s.contains("loss") && s.contains("held out")),
            "{said:?}"
        );
        let other = TrainingSpec {
            seed: 8,
            ..spec.clone()
        };
        let of_other = || {
            let [out, state] = ["c", "c.state"].map(|name| folder.path().join(name));
            train(&photographs, &other, &out, &state, &Silent)
        };
        // While it has not ended, nothing else may go on from there; then it is as if nothing had been.
        assert_eq!(of_other().unwrap_err().id(), "table/malformed");
        assert!(learn("c", 2, &Silent).unwrap() == whole);
        assert!(!folder.path().join("c.state").exists() && of_other().is_ok());
    }
}
