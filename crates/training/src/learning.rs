//! Learning: examples, their gradients, one step after the other, and where it stands on the disk.

use std::path::Path;
use std::time::{Duration, Instant};

use metalith_core::{AtomicFile, Error, Progress, Result};
use metalith_prior::COLOURS;
use metalith_prior::parts::{Features, Network, Plan, Size, write_weights};
use ndarray::{Array3, Axis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::checkpoint::Checkpoint;

/// Specification of training: how long, and from what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrainingSpec {
    /// Steps down the gradient.
    pub steps: u64,
    /// Pieces of pictures a step.
    pub batch: usize,
    /// Pixels a side of a piece; a multiple of eight.
    pub piece: usize,
    /// Seed of weights, pieces and noise.
    pub seed: u64,
    /// SHA-256 of the weights that it begins with; random ones if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub begun_with: Option<String>,
}

impl Default for TrainingSpec {
    fn default() -> Self {
        Self {
            steps: 8000,
            batch: 8,
            piece: 96,
            seed: 1,
            begun_with: None,
        }
    }
}

/// Result of training.
#[derive(Clone, Debug, Serialize)]
pub struct TrainingReport {
    pub steps: u64,
    pub weights: usize,
    /// Peak signal-to-noise ratio on examples that nothing was learnt from (dB): photographs with noise of 25 / 255, or
    /// the pictures of a camera.
    pub held_out_psnr_db: f64,
    /// The same of the pictures that the network corrects (dB).
    pub held_out_uncorrected_psnr_db: f64,
}

/// Longest step, after the first ones, which grow to it; it falls as a cosine to nothing.
const RATE: f64 = 1e-3;
const GROWING: f64 = 300.0;
/// The same for a training that begins with trained weights, which long steps would undo.
const RATE_BEGUN: f64 = 3e-4;
const GROWING_BEGUN: f64 = 20.0;
/// Steps between two looks at what is held out, and between two states on the disk.
const LOOK: u64 = 500;
const KEEP: u64 = 250;
/// Longest time between two states: what a process that is ended loses.
const KEEP_TIME: Duration = Duration::from_mins(1);
/// Layers that are added to something begin with this share of their size.
const ADDED: f32 = 0.1;

/// One example: what the network sees, the picture that its answer is added to, what should come out, and how much errors count.
pub(crate) struct Sample {
    pub input: Features,
    pub picture: Array3<f32>,
    pub clean: Array3<f32>,
    pub weight: f32,
}

/// Set that is learnt from.
pub(crate) trait TrainingSet: Sync {
    /// Size of the network that is trained.
    fn size(&self) -> Size;

    /// All that decides the weights but the numbers of [`TrainingSpec`], as JSON: a state goes on with the same alone.
    fn origin(&self, spec: &TrainingSpec) -> serde_json::Value;

    /// Loss of example number `k`, with pieces and seed of a specification, and its gradient over the weights: the same whatever was drawn
    /// before.
    fn loss(&self, network: &Network, spec: &TrainingSpec, k: u64) -> (f64, Vec<f32>);

    /// Mean peak signal to noise ratio of what is held out (dB).
    fn held_out(&self, network: Network) -> f64;

    /// The same of the pictures that the network corrects (dB).
    fn held_out_uncorrected(&self) -> f64;
}

impl TrainingSpec {
    /// Checks that training by it is possible, before the training set is made.
    ///
    /// # Errors
    /// If there is nothing to learn, or pieces are too small, too large or no multiple of eight.
    pub fn check(&self) -> Result<()> {
        let fault = |id, what: &str, hint: &str| Err(Error::refused(id, what, hint));
        if !self.piece.is_multiple_of(8) || !(32..=512).contains(&self.piece) {
            return fault(
                "train/piece-out-of-range",
                "this size of a piece is not possible",
                "give a multiple of 8 from 32 to 512",
            );
        }
        if self.steps == 0 || !(1..=256).contains(&self.batch) {
            return fault(
                "train/steps-out-of-range",
                "the numbers of steps and of pieces in a step are out of range",
                "give at least one step, and 1 to 256 pieces in a step",
            );
        }
        Ok(())
    }

    /// Length of step number `step`, from one.
    fn rate(&self, step: u64) -> f32 {
        let (step, steps) = (step as f64, self.steps as f64);
        let falling = 0.5 * (1.0 + (std::f64::consts::PI * (step - 1.0) / steps).cos());
        let (rate, growing) = match self.begun_with {
            None => (RATE, GROWING),
            Some(_) => (RATE_BEGUN, GROWING_BEGUN),
        };
        (rate * (step / growing).min(1.0) * falling) as f32
    }
}

/// Learn, go on where a state on the disk stands, and write the weights in the end, in place of the state. A user who stops it
/// loses nothing: the state is written first. `first`: weights to begin with, random if there are none.
///
/// # Errors
/// If the state is of another training, files cannot be written, or the user stopped it.
pub(crate) fn learn(
    lessons: &dyn TrainingSet,
    spec: &TrainingSpec,
    first: Option<Vec<f32>>,
    [out, state]: [&Path; 2],
    progress: &dyn Progress,
) -> Result<TrainingReport> {
    spec.check()?;
    let plan = Plan::new(lessons.size());
    let origin = lessons.origin(spec).to_string();
    let mut at = match Checkpoint::read(state, &origin, plan.weights())? {
        Some(found) => found,
        None => Checkpoint::begin(first.unwrap_or_else(|| begun(&plan, spec.seed))),
    };
    progress.begin("learning", spec.steps);
    progress.advance(at.step);
    // What there is to judge by from the first step on, and after a stop at once.
    let mut judged = (at.step < spec.steps).then(|| lessons.held_out(Network::new(&plan, &at.weights)));
    progress.note(&words(&at, judged));
    let mut kept = Instant::now();
    while at.step < spec.steps {
        if progress.stopped() {
            at.write(state, &origin)?;
            return Err(Error::Interrupted);
        }
        let (loss, gradient) = step(lessons, spec, &plan, &at);
        if !loss.is_finite() {
            return Err(Error::refused(
                "train/diverged",
                format!("the loss diverged at step {}", at.step),
                "use another --seed or more pieces a step, and report this",
            ));
        }
        at.step += 1;
        at.adam.step(&mut at.weights, &gradient, at.step, spec.rate(at.step));
        at.loss = 0.99 * at.loss + 0.01 * if at.step == 1 { 100.0 * loss } else { loss };
        progress.advance(1);
        if at.step.is_multiple_of(LOOK) {
            judged = Some(lessons.held_out(Network::new(&plan, &at.weights)));
        }
        if at.step.is_multiple_of(KEEP) || kept.elapsed() >= KEEP_TIME {
            at.write(state, &origin)?;
            kept = Instant::now();
        }
        progress.note(&words(&at, judged));
    }
    write_weights(out, &plan, &at.weights, &origin)?;
    // What is learnt is in the weights: the next training begins anew, with whatever numbers.
    AtomicFile::discard(state)?;
    // The weights as they are written: in half precision.
    let written: Vec<f32> = at.weights.iter().map(|w| half::f16::from_f32(*w).to_f32()).collect();
    Ok(TrainingReport {
        steps: at.step,
        weights: plan.weights(),
        held_out_psnr_db: lessons.held_out(Network::new(&plan, &written)),
        held_out_uncorrected_psnr_db: lessons.held_out_uncorrected(),
    })
}

/// Progress of training, in words.
fn words(at: &Checkpoint, held_out_db: Option<f64>) -> String {
    let loss = (at.step > 0).then(|| format!("loss {:.5}", at.loss));
    let held_out = held_out_db.map(|db| format!("held out {db:.2} dB"));
    loss.into_iter().chain(held_out).collect::<Vec<_>>().join(", ")
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
fn step(lessons: &dyn TrainingSet, spec: &TrainingSpec, plan: &Plan, at: &Checkpoint) -> (f64, Vec<f32>) {
    let network = Network::for_learning(plan, &at.weights);
    let first = at.step * spec.batch as u64;
    let pieces: Vec<(f64, Vec<f32>)> = (0..spec.batch as u64)
        .into_par_iter()
        .map(|k| lessons.loss(&network, spec, first + k))
        .collect();
    let share = 1.0 / spec.batch as f32;
    let mut sum = vec![0.0; plan.weights()];
    for (_, gradient) in &pieces {
        sum.iter_mut().zip(gradient).for_each(|(s, g)| *s += share * g);
    }
    (pieces.iter().map(|(l, _)| l).sum::<f64>() / spec.batch as f64, sum)
}

/// Mean squared error of an example by its weight, and its gradient.
pub(crate) fn loss(network: &Network, sample: Sample) -> (f64, Vec<f32>) {
    let (answer, trace) = network.traced(sample.input);
    let found = answer.shuffled();
    let share = sample.weight / sample.clean.len() as f32;
    let mut sum = 0.0;
    let mut back = Features::zero(COLOURS, found.rows, found.columns);
    for c in 0..COLOURS {
        let (picture, clean) = (
            sample.picture.index_axis(Axis(2), c),
            sample.clean.index_axis(Axis(2), c),
        );
        for (y, (picture, clean)) in picture.rows().into_iter().zip(clean.rows()).enumerate() {
            let row = found.row(c, y).iter().zip(picture.iter().zip(clean));
            for (to, (f, (b, want))) in back.row_mut(c, y).iter_mut().zip(row) {
                let error = f + b - want;
                sum += f64::from(share * error * error);
                *to = 2.0 * share * error;
            }
        }
    }
    (sum, network.gradient(&trace, back.unshuffled()))
}

/// Peak signal to noise ratio of a picture between black and white (dB).
pub(crate) fn psnr_db(found: &Array3<f32>, clean: &Array3<f32>) -> f64 {
    let error = ndarray::Zip::from(found)
        .and(clean)
        .fold(0.0, |sum, f, c| sum + f64::from(f.clamp(0.0, 1.0) - c).powi(2));
    -10.0 * (error / clean.len() as f64).log10()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Checks that the gradient of every layer is what difference quotients say, on one example.
    pub(crate) fn gradients_hold(size: Size, loss: impl Fn(&Network) -> (f64, Vec<f32>)) {
        /// A difference quotient in single precision of a loss of some thousand terms.
        const QUOTIENT: f64 = 0.02;
        let plan = Plan::new(size);
        let weights: Vec<f32> = begun(&plan, 3).iter().map(|w| 1.5 * w).collect();
        let (_, gradient) = loss(&Network::for_learning(&plan, &weights));
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
                loss(&Network::for_learning(&plan, &weights)).0
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

    /// A picture of waves and edges.
    pub(crate) fn picture(seed: usize, side: usize) -> Array3<f32> {
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
}
