//! The network: a U of three resolutions, blocks of two convolutions each, no biases.
//!
//! It sees pictures and maps that say more of them, squares of 2 x 2 pixels as channels (Zhang, Zuo and Zhang, IEEE Trans.
//! Image Process. 27, 4608 (2018)), and answers with what is to be added to the first picture. Residual blocks
//! between changes of resolution follow Zhang et al., IEEE Trans. Pattern Anal. Mach. Intell. 44, 6360 (2022). The denoiser
//! sees one noisy picture and a map of its noise; the last stage of a camera several pictures of one frame.

use crate::convolution::{Packed, Shape, add_weight_gradient};
use crate::features::Features;

/// Resolutions: a half, a quarter and an eighth of the picture's.
const LEVELS: usize = 3;
/// Colours of a picture.
pub const COLOURS: usize = 3;
/// Rows and columns that the network takes are multiples of this, in its own resolution: half of the picture's.
pub(crate) const MULTIPLE: usize = 1 << (LEVELS - 1);

/// Size of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Channels that it sees, in its own resolution.
    pub inputs: usize,
    /// Channels at each resolution.
    channels: [usize; LEVELS],
    /// Residual blocks at each of them, on the way down and on the way up.
    blocks: usize,
}

impl Size {
    /// Size of the denoiser: four pixels of each colour, and the noise of each colour.
    pub const DENOISER: Self = Self {
        inputs: 4 * COLOURS + COLOURS,
        channels: [32, 64, 96],
        blocks: 2,
    };

    /// Size of the last stage of a camera that sees so many pictures, and one map of where it is.
    pub fn post_processor(pictures: usize) -> Self {
        Self {
            inputs: 4 * COLOURS * pictures + 1,
            channels: [24, 48, 64],
            blocks: 1,
        }
    }
}

/// A step of the network.
#[derive(Clone, Copy, Debug)]
enum Step {
    Convolution(usize),
    /// x + second(cut(first(x)))
    Residual(usize, usize),
    /// Keep the features, then go to half of the resolution.
    Down(usize),
    /// Back to twice the resolution, and add what was kept.
    Up(usize),
}

/// One convolution of the network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Name in files of weights.
    pub name: String,
    pub shape: Shape,
    /// Index where its weights begin.
    pub start: usize,
}

/// Plan of a network, without its weights.
#[derive(Clone, Debug)]
pub struct Plan {
    pub layers: Vec<Layer>,
    steps: Vec<Step>,
}

impl Plan {
    /// Plan of a network of this size.
    pub fn new(size: Size) -> Self {
        let mut plan = Self {
            layers: Vec::new(),
            steps: Vec::new(),
        };
        let Size {
            inputs,
            channels,
            blocks,
        } = size;
        let head = plan.layer("head", inputs, channels[0], 9);
        plan.steps.push(Step::Convolution(head));
        let last = LEVELS - 1;
        for level in 0..last {
            plan.blocks(&format!("down{level}"), channels[level], blocks);
            let down = plan.layer(
                &format!("down{level}.scale"),
                4 * channels[level],
                channels[level + 1],
                1,
            );
            plan.steps.push(Step::Down(down));
        }
        plan.blocks("middle", channels[last], blocks);
        for level in (0..last).rev() {
            let up = plan.layer(&format!("up{level}.scale"), channels[level + 1], 4 * channels[level], 1);
            plan.steps.push(Step::Up(up));
            plan.blocks(&format!("up{level}"), channels[level], blocks);
        }
        let tail = plan.layer("tail", channels[0], 4 * COLOURS, 9);
        plan.steps.push(Step::Convolution(tail));
        plan
    }

    fn layer(&mut self, name: &str, inputs: usize, outputs: usize, taps: usize) -> usize {
        let start = self.weights();
        self.layers.push(Layer {
            name: format!("{name}.weight"),
            shape: Shape { inputs, outputs, taps },
            start,
        });
        self.layers.len() - 1
    }

    fn blocks(&mut self, name: &str, channels: usize, count: usize) {
        for block in 0..count {
            let first = self.layer(&format!("{name}.{block}.first"), channels, channels, 9);
            let second = self.layer(&format!("{name}.{block}.second"), channels, channels, 9);
            self.steps.push(Step::Residual(first, second));
        }
    }

    /// Number of weights.
    pub fn weights(&self) -> usize {
        self.layers.last().map_or(0, |l| l.start + l.shape.weights())
    }

    /// Layers whose output is added to something: they begin near zero, so that the network begins as what it corrects.
    pub fn is_added(layer: &Layer) -> bool {
        layer.name.ends_with("second.weight") || layer.name == "tail.weight"
    }
}

/// The network with its weights, made ready for use.
#[derive(Clone, Debug)]
pub struct Network {
    plan: Plan,
    forward: Vec<Packed>,
    /// Weights for gradients only.
    backward: Vec<Packed>,
}

/// Trace of the forward pass for the backward pass: the input of each step, and what is between two convolutions.
pub struct Trace {
    inputs: Vec<Features>,
    between: Vec<Option<Features>>,
}

impl Network {
    /// Network with the weights of a plan.
    pub fn new(plan: &Plan, weights: &[f32]) -> Self {
        let of = |layer: &Layer| Packed::forward(layer.shape, Self::part(layer, weights));
        Self {
            forward: plan.layers.iter().map(of).collect(),
            backward: Vec::new(),
            plan: plan.clone(),
        }
    }

    /// Network that can be trained.
    pub fn for_learning(plan: &Plan, weights: &[f32]) -> Self {
        let of = |layer: &Layer| Packed::backward(layer.shape, Self::part(layer, weights));
        Self {
            backward: plan.layers.iter().map(of).collect(),
            ..Self::new(plan, weights)
        }
    }

    fn part<'w>(layer: &Layer, weights: &'w [f32]) -> &'w [f32] {
        &weights[layer.start..layer.start + layer.shape.weights()]
    }

    /// The answer of the network: `[12, rows, columns]` of `[inputs, rows, columns]`, both sides multiples of `MULTIPLE`, four.
    pub fn apply(&self, input: Features) -> Features {
        self.walk(input, |_, _| ())
    }

    /// Output of the network, with the trace that the backward pass needs.
    pub fn traced(&self, input: Features) -> (Features, Trace) {
        let mut trace = Trace {
            inputs: Vec::new(),
            between: Vec::new(),
        };
        let out = self.walk(input, |input, between| {
            trace.inputs.push(input.clone());
            trace.between.push(between.cloned());
        });
        (out, trace)
    }

    fn walk(&self, input: Features, mut seen: impl FnMut(&Features, Option<&Features>)) -> Features {
        let mut kept = Vec::new();
        let mut x = input;
        for step in &self.plan.steps {
            x = match *step {
                Step::Convolution(k) => {
                    seen(&x, None);
                    self.forward[k].apply(&x, false)
                }
                Step::Residual(first, second) => {
                    let between = self.forward[first].apply(&x, true);
                    let mut out = self.forward[second].apply(&between, false);
                    out.add(&x);
                    seen(&x, Some(&between));
                    out
                }
                Step::Down(k) => {
                    let small = x.unshuffled();
                    seen(&small, None);
                    kept.push(x);
                    self.forward[k].apply(&small, false)
                }
                Step::Up(k) => {
                    seen(&x, None);
                    let mut out = self.forward[k].apply(&x, false).shuffled();
                    out.add(&kept.pop().expect("as many steps up as down"));
                    out
                }
            };
        }
        x
    }

    /// Gradient of the weights from that of the answer.
    pub fn gradient(&self, trace: &Trace, answer: Features) -> Vec<f32> {
        self.gradients(trace, answer, false).0
    }

    /// Gradients of the weights and of the input from that of the answer. Channels of the input behind the last whole four have none.
    pub fn gradient_and_input(&self, trace: &Trace, answer: Features) -> (Vec<f32>, Features) {
        self.gradients(trace, answer, true)
    }

    fn gradients(&self, trace: &Trace, answer: Features, of_input: bool) -> (Vec<f32>, Features) {
        let mut gradient = vec![0.0; self.plan.weights()];
        let mut kept: Vec<Features> = Vec::new();
        let mut learn = |k: usize, input: &Features, output: &Features| {
            let layer = &self.plan.layers[k];
            let part = &mut gradient[layer.start..layer.start + layer.shape.weights()];
            add_weight_gradient(layer.shape, input, output, part);
        };
        let mut d = answer;
        for (i, step) in self.plan.steps.iter().enumerate().rev() {
            let input = &trace.inputs[i];
            d = match *step {
                Step::Convolution(k) => {
                    learn(k, input, &d);
                    if i == 0 && !of_input {
                        break;
                    }
                    self.backward[k].apply(&d, false)
                }
                Step::Residual(first, second) => {
                    let between = trace.between[i]
                        .as_ref()
                        .expect("a residual block keeps what is between");
                    learn(second, between, &d);
                    let mut inner = self.backward[second].apply(&d, false);
                    for (v, b) in inner.values.iter_mut().zip(&between.values) {
                        if *b <= 0.0 {
                            *v = 0.0;
                        }
                    }
                    learn(first, input, &inner);
                    let mut out = self.backward[first].apply(&inner, false);
                    out.add(&d);
                    out
                }
                Step::Down(k) => {
                    learn(k, input, &d);
                    let mut out = self.backward[k].apply(&d, false).shuffled();
                    out.add(&kept.pop().expect("as many steps up as down"));
                    out
                }
                Step::Up(k) => {
                    let small = d.unshuffled();
                    learn(k, input, &small);
                    kept.push(d);
                    self.backward[k].apply(&small, false)
                }
            };
        }
        (gradient, d)
    }
}
