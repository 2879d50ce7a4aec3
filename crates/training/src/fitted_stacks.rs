//! Training of a last stage through the restoration: whole pictures, and fits to their frames between passes of the network.

use metalith_core::{Progress, Result};
use metalith_prior::parts::{Features, Network, SIDE, STAGE, Size, cut, folded, mirrored, refitted, seen, with_answer};
use metalith_prior::{COLOURS, PictureFit, PostProcessor};
use ndarray::Array3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::examples::is_held_out;
use crate::learning::{TrainingSet, TrainingSpec, psnr_db};
use crate::stacks::{Stack, Stacks};

/// Weight of the error of a picture that is fitted again, that of the last one being one: the first passes learn to restore too.
const ON_THE_WAY: f32 = 0.3;

/// Stacks of one camera, with the fit to the frame of each.
pub struct FittedStacks<'a> {
    stacks: Stacks,
    learnt: Vec<Box<dyn PictureFit + 'a>>,
    held_out: Vec<Box<dyn PictureFit + 'a>>,
}

impl<'a> FittedStacks<'a> {
    /// Stacks of which the fits are, in the order in which the stacks were made from pictures.
    pub fn new(stacks: Stacks, fits: Vec<Box<dyn PictureFit + 'a>>) -> Self {
        let (mut learnt, mut held_out) = (Vec::new(), Vec::new());
        for (i, fit) in fits.into_iter().enumerate() {
            if is_held_out(i) {
                held_out.push(fit);
            } else {
                learnt.push(fit);
            }
        }
        Self {
            stacks,
            learnt,
            held_out,
        }
    }
}

/// Pass of the network over a whole pile: the corrected picture, and what the way back needs.
struct Pass {
    trace: metalith_prior::parts::Trace,
    found: Array3<f32>,
}

impl Pass {
    fn new(network: &Network, pile: &Array3<f32>) -> Self {
        let (rows, columns, _) = pile.dim();
        let [high, wide] = [rows, columns].map(|n| n.next_multiple_of(SIDE));
        let (answer, trace) = network.traced(seen(&mirrored(pile, high, wide), [0; 2], [rows, columns]));
        let found = with_answer(cut(pile, [0; 2], [rows, columns, COLOURS]), &answer);
        Self { trace, found }
    }

    /// Gradients of the weights and of all pictures of the pile from that of the corrected picture.
    fn back(&self, network: &Network, gradient: &Array3<f32>, planes: usize) -> (Vec<f32>, Array3<f32>) {
        let (rows, columns, _) = gradient.dim();
        let [high, wide] = [rows, columns].map(|n| n.next_multiple_of(SIDE));
        let mut answer = Features::zero(COLOURS, high, wide);
        for ((y, x, c), g) in gradient.indexed_iter() {
            answer.row_mut(c, y)[x] = *g;
        }
        let (weights, input) = network.gradient_and_input(&self.trace, answer.unshuffled());
        // Behind the pictures the input has a map, and a shuffle takes whole fours.
        let mut squares = Features::zero(4 * planes, input.rows, input.columns);
        let n = squares.values.len();
        squares.values.copy_from_slice(&input.values[..n]);
        let whole = squares.shuffled();
        let mut back = folded(
            &Array3::from_shape_fn((high, wide, planes), |(y, x, c)| whole.row(c, y)[x]),
            rows,
            columns,
        );
        // What the network answers is added to the first picture.
        for ((y, x, c), g) in gradient.indexed_iter() {
            back[[y, x, c]] += g;
        }
        (weights, back)
    }
}

/// Mean squared error between pictures, times a weight, and its gradient.
fn error(found: &Array3<f32>, clean: &Array3<f32>, weight: f32) -> (f64, Array3<f32>) {
    let share = weight / clean.len() as f32;
    let difference = found - clean;
    let sum = difference.iter().map(|d| f64::from(share * d * d)).sum();
    (sum, difference * (2.0 * share))
}

/// Loss of a stack by all passes and the fits between them, and its gradient over the weights.
pub(crate) fn loss_through(network: &Network, stack: &Stack, fit: &dyn PictureFit, refits: usize) -> (f64, Vec<f32>) {
    let mut pile = stack.pile();
    let clean = stack.truth();
    let planes = pile.dim().2;
    let mut passes = vec![Pass::new(network, &pile)];
    let mut fits = Vec::new();
    for k in 0..refits {
        let fitted = fit.fitted(&passes[k].found);
        pile = refitted(&pile, &passes[k].found, &fitted);
        passes.push(Pass::new(network, &pile));
        fits.push(fitted);
    }
    let (mut sum, mut gradient) = error(&passes[refits].found, &clean, 1.0);
    let mut weights: Option<Vec<f32>> = None;
    for k in (0..=refits).rev() {
        let (own, back) = passes[k].back(network, &gradient, planes);
        match &mut weights {
            None => weights = Some(own),
            Some(all) => all.iter_mut().zip(&own).for_each(|(a, g)| *a += g),
        }
        if k > 0 {
            let (rows, columns, _) = clean.dim();
            let picture =
                |n: usize| Array3::from_shape_fn((rows, columns, COLOURS), |(y, x, c)| back[[y, x, n * COLOURS + c]]);
            let before = &passes[k - 1].found;
            let (on_the_way, own) = error(before, &clean, ON_THE_WAY);
            sum += on_the_way;
            gradient = picture(0) + own + fit.adjoint(before, &fits[k - 1], &picture(1));
        }
    }
    (sum, weights.unwrap_or_default())
}

impl TrainingSet for FittedStacks<'_> {
    fn size(&self) -> Size {
        self.stacks.size()
    }

    fn origin(&self, spec: &TrainingSpec) -> serde_json::Value {
        serde_json::json!({ "spec": spec, STAGE: self.stacks.provenance(), "pictures": self.stacks.digest() })
    }

    /// A whole picture.
    fn loss(&self, network: &Network, spec: &TrainingSpec, k: u64) -> (f64, Vec<f32>) {
        let mut random = ChaCha8Rng::seed_from_u64(spec.seed);
        random.set_stream(k);
        let n = random.random_range(0..self.learnt.len());
        loss_through(
            network,
            &self.stacks.learnt[n],
            &*self.learnt[n],
            self.stacks.provenance().refits,
        )
    }

    fn held_out(&self, network: Network) -> f64 {
        let post_processor = PostProcessor::of_network(network, self.stacks.provenance().clone());
        let all = self.stacks.held_out.iter().zip(&self.held_out).map(|(stack, fit)| {
            let found = post_processor.corrected_fitted(stack.pile(), &**fit);
            psnr_db(&found, &stack.truth())
        });
        all.sum::<f64>() / self.held_out.len() as f64
    }

    fn held_out_uncorrected(&self) -> f64 {
        self.stacks.held_out_uncorrected()
    }
}

/// Teach a last stage through its fits to frames; else as [`crate::train_post_processor`].
///
/// # Errors
/// As [`crate::train_post_processor`].
pub fn train_through_fits(
    stacks: &FittedStacks<'_>,
    spec: &TrainingSpec,
    first: Option<Vec<f32>>,
    files: [&std::path::Path; 2],
    progress: &dyn Progress,
) -> Result<crate::TrainingReport> {
    crate::learning::learn(stacks, spec, first, files, progress)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::tests::{gradients_hold, picture};

    /// Half of the way from a picture to another one.
    struct HalfWay(Array3<f32>);

    impl PictureFit for HalfWay {
        fn fitted(&self, picture: &Array3<f32>) -> Array3<f32> {
            (picture + &self.0) * 0.5
        }

        fn adjoint(&self, _: &Array3<f32>, _: &Array3<f32>, gradient: &Array3<f32>) -> Array3<f32> {
            gradient * 0.5
        }
    }

    /// Sides that are no multiples of eight: borders are mirrored, and their gradients folded back.
    #[test]
    fn gradients_through_fits_are_those_of_differences() {
        let clean = picture(1, 42);
        let dark = clean.mapv(|v| 0.6 * v);
        let stack = Stack::new(&[dark.clone(), picture(2, 42)], &clean).unwrap();
        let fit = HalfWay(clean.mapv(|v| v * v));
        for refits in [0, 2] {
            gradients_hold(Size::post_processor(2), |network| {
                loss_through(network, &stack, &fit, refits)
            });
        }
    }
}
