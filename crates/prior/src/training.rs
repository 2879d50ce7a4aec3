//! Learning: pieces of photographs, their gradients, one step after the other, and where it stands on the disk.

use std::collections::HashMap;
use std::path::Path;

use metalith_core::{Error, Progress, Result};
use ndarray::{Array3, Axis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::checkpoint::Checkpoint;
use crate::denoiser::{NetworkDenoiser, input};
use crate::examples::{Example, Photographs};
use crate::features::Features;
use crate::network::{COLOURS, Network, Plan};
use crate::weights::write_weights;

/// How long and from what is learnt.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrainingSpec {
    /// Steps down the gradient.
    pub steps: u64,
    /// Pieces of photographs a step.
    pub batch: usize,
    /// Pixels a side of a piece; a multiple of eight.
    pub piece: usize,
    /// Of weights, pieces and noise.
    pub seed: u64,
}

impl Default for TrainingSpec {
    fn default() -> Self {
        Self {
            steps: 8000,
            batch: 8,
            piece: 96,
            seed: 1,
        }
    }
}

/// What came out.
#[derive(Clone, Debug, Serialize)]
pub struct TrainingReport {
    pub steps: u64,
    pub weights: usize,
    /// Of the photographs that nothing was learnt from, noise of 25 / 255 (dB).
    pub held_out_psnr_db: f64,
}

/// Longest step, after the first ones, which grow to it; it falls as a cosine to nothing.
const RATE: f64 = 1e-3;
const GROWING: f64 = 300.0;
/// Errors where noise of this deviation is are weighted by one, others by one over theirs.
const EQUAL: f32 = 0.1;
/// Keeps the weight of pieces with hardly any noise within bounds.
const LEAST: f32 = 0.02;
/// Noise of the photographs that are held out.
pub const JUDGED: f32 = 25.0 / 255.0;
/// Steps between two looks at photographs that are held out, and between two states on the disk.
const LOOK: u64 = 500;
const KEEP: u64 = 250;
/// Layers that are added to something begin with this share of their size.
const ADDED: f32 = 0.1;

impl TrainingSpec {
    fn check(&self) -> Result<()> {
        let fault = |what: &str, hint: &str| Err(Error::invalid(what, hint));
        if !self.piece.is_multiple_of(8) || !(32..=512).contains(&self.piece) {
            return fault(
                "pieces of this size cannot be learnt from",
                "give a multiple of 8 from 32 to 512",
            );
        }
        if self.steps == 0 || !(1..=256).contains(&self.batch) {
            return fault("nothing to learn", "give at least one step, and 1 to 256 pieces a step");
        }
        Ok(())
    }

    /// Length of step number `step`, from one.
    fn rate(&self, step: u64) -> f32 {
        let (step, steps) = (step as f64, self.steps as f64);
        let falling = 0.5 * (1.0 + (std::f64::consts::PI * (step - 1.0) / steps).cos());
        (RATE * (step / GROWING).min(1.0) * falling) as f32
    }
}

/// Learn, go on where a state on the disk stands, and write the weights in the end. A user who stops it loses nothing: the
/// state is written first.
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
    spec.check()?;
    let plan = Plan::new();
    let origin = serde_json::json!({ "spec": spec, "photographs": photographs.digest() }).to_string();
    let mut at = match Checkpoint::read(state, &origin, plan.weights())? {
        Some(found) => found,
        None => Checkpoint::begin(begun(&plan, spec.seed)),
    };
    progress.begin("learning", spec.steps);
    progress.advance(at.step);
    let mut judged = f64::NAN;
    while at.step < spec.steps {
        if progress.stopped() {
            at.write(state, &origin)?;
            return Err(Error::Interrupted);
        }
        let (loss, gradient) = step(photographs, spec, &plan, &at);
        if !loss.is_finite() {
            return Err(Error::invalid(
                format!("learning went astray at step {}", at.step),
                "use another --seed or more pieces a step, and report this",
            ));
        }
        at.step += 1;
        at.adam.step(&mut at.weights, &gradient, at.step, spec.rate(at.step));
        at.loss = 0.99 * at.loss + 0.01 * if at.step == 1 { 100.0 * loss } else { loss };
        progress.advance(1);
        if at.step.is_multiple_of(LOOK) {
            judged = held_out(photographs, &at.weights);
        }
        if at.step.is_multiple_of(KEEP) {
            at.write(state, &origin)?;
        }
        progress.note(&format!("loss {:.5}, held out {judged:.2} dB", at.loss));
    }
    let about = HashMap::from([("training".to_owned(), origin)]);
    write_weights(out, &at.weights, about)?;
    // The weights as they were written: in half precision.
    let written = NetworkDenoiser::read(out)?;
    Ok(TrainingReport {
        steps: at.step,
        weights: plan.weights(),
        held_out_psnr_db: psnr(photographs, &written),
    })
}

/// Weights before anything is learnt: normal, so that features neither grow nor fade (He et al., ICCV 2015).
fn begun(plan: &Plan, seed: u64) -> Vec<f32> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // Examples have the streams from zero.
    random.set_stream(u64::MAX);
    let mut weights = Vec::with_capacity(plan.weights());
    for layer in &plan.layers {
        let size = (2.0 / (layer.shape.inputs * layer.shape.taps) as f32).sqrt();
        let size = if Plan::is_added(layer) { ADDED * size } else { size };
        let normal = StandardNormal.sample_iter(&mut random).take(layer.shape.weights());
        weights.extend(normal.map(|v: f32| size * v));
    }
    weights
}

/// Loss and gradient of a step: those of its pieces, added up in their order.
fn step(photographs: &Photographs, spec: &TrainingSpec, plan: &Plan, at: &Checkpoint) -> (f64, Vec<f32>) {
    let network = Network::for_learning(plan, &at.weights);
    let first = at.step * spec.batch as u64;
    let pieces: Vec<(f64, Vec<f32>)> = (0..spec.batch as u64)
        .into_par_iter()
        .map(|k| loss(&network, &photographs.example(spec.piece, spec.seed, first + k)))
        .collect();
    let share = 1.0 / spec.batch as f32;
    let mut sum = vec![0.0; plan.weights()];
    for (_, gradient) in &pieces {
        sum.iter_mut().zip(gradient).for_each(|(s, g)| *s += share * g);
    }
    (pieces.iter().map(|(l, _)| l).sum::<f64>() / spec.batch as f64, sum)
}

/// Mean squared error of a piece, weighted by its noise, and its gradient.
fn loss(network: &Network, example: &Example) -> (f64, Vec<f32>) {
    let (answer, trace) = network.traced(input(&example.noisy, &example.deviation));
    let found = answer.shuffled();
    let mean = example.deviation.mean().unwrap_or(EQUAL);
    let weight = EQUAL / (mean + LEAST);
    let share = weight / example.clean.len() as f32;
    let mut sum = 0.0;
    let mut back = Features::zero(COLOURS, found.rows, found.columns);
    for c in 0..COLOURS {
        let (noisy, clean) = (
            example.noisy.index_axis(Axis(2), c),
            example.clean.index_axis(Axis(2), c),
        );
        for (y, (noisy, clean)) in noisy.rows().into_iter().zip(clean.rows()).enumerate() {
            let row = found.row(c, y).iter().zip(noisy.iter().zip(clean));
            for (to, (f, (b, want))) in back.row_mut(c, y).iter_mut().zip(row) {
                let error = f + b - want;
                sum += f64::from(share * error * error);
                *to = 2.0 * share * error;
            }
        }
    }
    (sum, network.gradient(&trace, back.unshuffled()))
}

fn held_out(photographs: &Photographs, weights: &[f32]) -> f64 {
    psnr(photographs, &NetworkDenoiser::of_weights(weights))
}

/// Mean peak signal to noise ratio of the photographs that are held out (dB).
fn psnr(photographs: &Photographs, denoiser: &NetworkDenoiser) -> f64 {
    let of = |(clean, noisy): (&Array3<f32>, Array3<f32>)| {
        let found = denoiser
            .denoise_even(&noisy, JUDGED)
            .expect("the own network takes any size");
        let error = ndarray::Zip::from(&found)
            .and(clean)
            .fold(0.0, |sum, f, c| sum + f64::from(f.clamp(0.0, 1.0) - c).powi(2));
        -10.0 * (error / clean.len() as f64).log10()
    };
    let all: Vec<f64> = photographs.judged(JUDGED).map(of).collect();
    all.iter().sum::<f64>() / all.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;

    /// A picture of waves and edges.
    fn picture(seed: usize, side: usize) -> Array3<f32> {
        Array3::from_shape_fn((side, side, 3), |(y, x, c)| {
            let wave = (0.1 * (x * (seed + 1)) as f32 + 0.05 * (y * (c + 1)) as f32).sin();
            let edge = if (x / 16 + y / 24 + seed).is_multiple_of(2) {
                0.15
            } else {
                -0.15
            };
            0.5 + 0.2 * wave + edge
        })
    }

    fn photographs() -> Photographs {
        Photographs::new((0..4).map(|k| (format!("{k}"), picture(k, 80))).collect(), 32).unwrap()
    }

    #[test]
    fn gradients_are_those_of_differences() {
        /// A difference quotient in single precision of a loss of some thousand terms.
        const QUOTIENT: f64 = 0.02;
        let plan = Plan::new();
        let weights: Vec<f32> = begun(&plan, 3).iter().map(|w| 1.5 * w).collect();
        let example = photographs().example(32, 5, 9);
        let (_, gradient) = loss(&Network::for_learning(&plan, &weights), &example);
        // Along a direction in every layer: each must have its share of the gradient.
        for layer in &plan.layers {
            let range = layer.start..layer.start + layer.shape.weights();
            let norm = gradient[range.clone()].iter().map(|g| g * g).sum::<f32>().sqrt();
            assert!(norm > 0.0, "{} learns nothing", layer.name);
            let size = weights[range.clone()].iter().map(|w| w * w).sum::<f32>().sqrt();
            let step = 2e-3 * size;
            let moved = |sign: f32| {
                let mut weights = weights.clone();
                for k in range.clone() {
                    weights[k] += sign * step * gradient[k] / norm;
                }
                loss(&Network::for_learning(&plan, &weights), &example).0
            };
            let quotient = (moved(1.0) - moved(-1.0)) / f64::from(2.0 * step);
            let found = f64::from(norm);
            assert!(
                (quotient / found - 1.0).abs() < QUOTIENT,
                "{}: {quotient} {found}",
                layer.name
            );
        }
    }

    #[test]
    fn what_is_learnt_is_the_same_on_any_number_of_threads_and_after_a_stop() {
        let photographs = photographs();
        let spec = TrainingSpec {
            steps: 4,
            batch: 3,
            piece: 32,
            seed: 7,
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
        assert!(learn("c", 2, &Silent).unwrap() == whole);

        let other = TrainingSpec {
            seed: 8,
            ..spec.clone()
        };
        let refused = train(
            &photographs,
            &other,
            &folder.path().join("c"),
            &folder.path().join("c.state"),
            &Silent,
        );
        assert!(refused.unwrap_err().to_string().contains("another training"));
    }
}
