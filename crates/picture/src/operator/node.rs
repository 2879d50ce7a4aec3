//! One element: its warps, and the kernels of its nodes.

use std::borrow::Cow;
use std::sync::Arc;

use metalith_camera::Sensor;
use metalith_wave::kernels::fft_size;
use ndarray::Array2;
use num_complex::Complex32;

use super::mixed::MixedKernels;
use super::source::KernelSource;
use super::warp::{CellPoint, Warp, hat};
use super::{FftScratch, SquareFft};
use crate::ElementView;
use crate::geometry::SceneSpace;

/// One element of an operator.
pub struct ElementOperator<'a> {
    element: usize,
    view: ElementView,
    source: KernelSource<'a>,
    sensor: Sensor,
    scene: SceneSpace,
    channels: Vec<ChannelPlan>,
}

/// What one channel of an element needs.
struct ChannelPlan {
    /// One for each point within a pixel; none if they are made when needed.
    warps: Vec<Warp>,
    fft: Arc<SquareFft>,
    nodes: Vec<NodePlan>,
}

/// One node of a channel: the rectangle of its hat, and the spectra of its kernels if they are kept.
struct NodePlan {
    node: [usize; 2],
    first: [usize; 2],
    shape: [usize; 2],
    /// By phase and light, see [`MixedKernels`].
    kernels: MixedKernels,
}

/// The sub-image of an element: the pixels of one phase of its cells, in one channel.
pub struct SubImage {
    channel: usize,
    /// Row and column of the first of its pixels on the sensor.
    origin: [i64; 2],
    /// Pixels of the sensor from one of its pixels to the next.
    step: usize,
    light: Array2<f32>,
}

impl SubImage {
    /// Add what lies on the sensor to its frames.
    pub fn add_to(&self, frames: &mut [Array2<f32>]) {
        let frame = &mut frames[self.channel];
        let (rows, columns) = frame.dim();
        for (y, line) in self.light.outer_iter().enumerate() {
            let Some(row) = inside(self.origin[0] + (y * self.step) as i64, rows) else {
                continue;
            };
            for (x, value) in line.iter().enumerate() {
                if let Some(column) = inside(self.origin[1] + (x * self.step) as i64, columns) {
                    frame[[row, column]] += value;
                }
            }
        }
    }
}

/// An index, if it is below a length.
fn inside(index: i64, length: usize) -> Option<usize> {
    usize::try_from(index).ok().filter(|i| *i < length)
}

impl<'a> ElementOperator<'a> {
    pub fn new(
        element: usize,
        view: &ElementView,
        source: &KernelSource<'a>,
        sensor: &Sensor,
        scene: &SceneSpace,
    ) -> Self {
        let mut own = Self {
            element,
            view: *view,
            source: source.clone(),
            sensor: sensor.clone(),
            scene: scene.clone(),
            channels: Vec::new(),
        };
        own.channels = (0..source.bank.channel_um.len()).map(|c| own.channel(c)).collect();
        own
    }

    fn warp(&self, channel: usize, point: CellPoint) -> Warp {
        let um = self.source.bank.channel_um[channel];
        Warp::new(&self.view, &self.sensor, &self.source.spec, &self.scene, um, point)
    }

    fn channel(&self, channel: usize) -> ChannelPlan {
        let cell = self.source.points.cell();
        let middle = self.warp(
            channel,
            CellPoint {
                cell,
                shift: [0.0; 2],
                area: (cell * cell) as f64,
                assumed: self.source.assumed,
            },
        );
        let n = self.source.spec.nodes;
        let mut nodes: Vec<NodePlan> = Vec::new();
        for i in 0..n * n {
            let node = [i / n, i % n];
            if let Some((first, shape)) = middle.support(node) {
                // Points within a pixel lie in the hat where its middle does not.
                let low = first.map(|f| f.saturating_sub(1));
                let high = [0, 1].map(|a| (first[a] + shape[a] + 1).min(middle.shape[a]));
                nodes.push(NodePlan {
                    node,
                    first: low,
                    shape: [high[0] - low[0], high[1] - low[1]],
                    kernels: MixedKernels::default(),
                });
            }
        }
        let longest = nodes.iter().flat_map(|n| n.shape).max().unwrap_or(1);
        let fft = Arc::new(SquareFft::new(fft_size(longest + 2 * self.source.reach() + 1)));
        let mut warps = Vec::new();
        if self.source.points.offsets().len() == 1 {
            let mut scratch = FftScratch::default();
            let inputs = self.source.inputs(channel).len();
            for node in &mut nodes {
                let mut spectra = Vec::new();
                for phase in 0..self.source.phases(channel).len() {
                    for input in 0..inputs {
                        let at = KernelAt { input, point: 0, phase };
                        spectra.extend(self.spectrum(node.node, channel, at, &fft, &mut scratch));
                    }
                }
                node.kernels = MixedKernels::new(spectra, inputs, fft.size(), self.source.statistics.as_ref());
            }
            warps.push(middle);
        }
        ChannelPlan { warps, fft, nodes }
    }

    /// Spectrum of a kernel, its first value at the first place of the square.
    fn spectrum(
        &self,
        node: [usize; 2],
        channel: usize,
        at: KernelAt,
        fft: &SquareFft,
        scratch: &mut FftScratch,
    ) -> Vec<Complex32> {
        let bases = self.source.inputs(channel)[at.input].1.clone();
        let phase = self.source.phases(channel)[at.phase];
        let kernel = self.source.pixels(self.element, node, channel, bases, at.point, phase);
        let (side, size) = (2 * self.source.reach() + 1, fft.size());
        let mut square = vec![0.0; size * size];
        for (row, to) in kernel.chunks_exact(side).zip(square.chunks_exact_mut(size)) {
            to[..side].copy_from_slice(row);
        }
        let mut spectrum = vec![Complex32::ZERO; fft.entries()];
        fft.forward(&mut square, side, &mut spectrum, scratch);
        spectrum
    }

    /// Warps of a channel at all points within a cell: those that are kept, or made now.
    fn warps<'b>(&self, channel: usize, plan: &'b ChannelPlan) -> Cow<'b, [Warp]> {
        if !plan.warps.is_empty() {
            return Cow::Borrowed(&plan.warps);
        }
        let (cell, points) = (self.source.points.cell(), self.source.points.offsets());
        let area = (cell * cell) as f64 / points.len() as f64;
        let warp = |shift: &[f64; 2]| {
            self.warp(
                channel,
                CellPoint {
                    cell,
                    shift: *shift,
                    area,
                    assumed: self.source.assumed,
                },
            )
        };
        points.iter().map(warp).collect()
    }

    /// What is cut out of the sampled light for a node: weights of its inputs, at one of their points.
    fn lights(&self, node: &NodePlan, inputs: usize, points: usize) -> Vec<Light> {
        if !node.kernels.is_empty() {
            let all = node.kernels.mixtures().iter();
            return all
                .map(|w| Light {
                    weights: w.clone(),
                    point: 0,
                })
                .collect();
        }
        let alone = |input: usize| (0..inputs).map(|i| f32::from(u8::from(i == input))).collect();
        (0..inputs * points)
            .map(|k| Light {
                weights: alone(k / points),
                point: k % points,
            })
            .collect()
    }

    /// The kept spectrum of a node for one of its lights and phases, or one that is made now.
    fn kernel<'b>(
        &self,
        channel: usize,
        plan: &ChannelPlan,
        node: &'b NodePlan,
        (light, points): (usize, usize),
        phase: usize,
        scratch: &mut FftScratch,
    ) -> Cow<'b, [Complex32]> {
        if !node.kernels.is_empty() {
            return Cow::Borrowed(node.kernels.spectrum(phase, light));
        }
        let at = KernelAt {
            input: light / points,
            point: light % points,
            phase,
        };
        Cow::Owned(self.spectrum(node.node, channel, at, &plan.fft, scratch))
    }

    /// Add the light of pixels to the places of the scene that they look at, as if nothing were blurred: a plane for each
    /// channel.
    pub fn lay_on_scene(&self, frames: &[Array2<f32>], planes: &mut [Array2<f32>]) {
        let cell = self.source.points.cell() as i64;
        for (channel, plan) in self.channels.iter().enumerate() {
            let Some(warp) = plan.warps.first() else { continue };
            let frame = &frames[channel];
            let pixel = |y: usize, x: usize, phase: &[usize; 2]| {
                let row = inside((warp.origin[0] + y as i64) * cell + phase[0] as i64, frame.nrows())?;
                let column = inside((warp.origin[1] + x as i64) * cell + phase[1] as i64, frame.ncols())?;
                Some(frame[[row, column]])
            };
            let phases = self.source.phases(channel);
            let light: Vec<f32> = (0..warp.shape[0] * warp.shape[1])
                .map(|i| {
                    let of = |phase| pixel(i / warp.shape[1], i % warp.shape[1], phase);
                    phases.iter().filter_map(of).sum()
                })
                .collect();
            warp.scatter(&light, &mut planes[channel]);
        }
    }

    pub fn apply(&self, scene: &[Array2<f32>], scratch: &mut FftScratch) -> Vec<SubImage> {
        let (reach, cell) = (self.source.reach(), self.source.points.cell());
        let mut images = Vec::new();
        for (channel, plan) in self.channels.iter().enumerate() {
            let warps = self.warps(channel, plan);
            let (inputs, phases) = (self.source.inputs(channel), self.source.phases(channel));
            let shape = warps[0].shape;
            // Sampled once: light of each input at each point.
            let sampled: Vec<Vec<f32>> = inputs
                .iter()
                .flat_map(|(input, _)| warps.iter().map(move |w| (*input, w)))
                .map(|(input, warp)| {
                    let mut light = vec![0.0; shape[0] * shape[1]];
                    warp.sample(&scene[input], &mut light);
                    light
                })
                .collect();
            let (size, entries) = (plan.fft.size(), plan.fft.entries());
            let mut own: Vec<Array2<f32>> = vec![Array2::zeros(shape.map(|s| s + 2 * reach)); phases.len()];
            let mut square = vec![0.0; size * size];
            let mut spectrum = vec![Complex32::ZERO; entries];
            let mut hats = Vec::new();
            let mut sums = vec![vec![Complex32::ZERO; entries]; phases.len()];
            for node in &plan.nodes {
                sums.iter_mut().for_each(|s| s.fill(Complex32::ZERO));
                let mut lit = false;
                for (k, light) in self.lights(node, inputs.len(), warps.len()).iter().enumerate() {
                    if k == 0 || warps.len() > 1 {
                        node.hats(&warps[light.point], &mut hats);
                    }
                    square.fill(0.0);
                    let mut any = false;
                    for (own, weight) in sampled.chunks_exact(warps.len()).zip(&light.weights) {
                        any |= node.cut(&own[light.point], *weight, shape[1], &hats, &mut square, size);
                    }
                    if !any {
                        continue;
                    }
                    lit = true;
                    plan.fft.forward(&mut square, node.shape[0], &mut spectrum, scratch);
                    for (phase, sum) in sums.iter_mut().enumerate() {
                        let kernel = self.kernel(channel, plan, node, (k, warps.len()), phase, scratch);
                        multiply_add(sum, &spectrum, &kernel);
                    }
                }
                if !lit {
                    continue;
                }
                for (sum, image) in sums.iter_mut().zip(&mut own) {
                    plan.fft.inverse(sum, &mut square, scratch);
                    let lines = node.shape.map(|s| s + 2 * reach);
                    for y in 0..lines[0] {
                        let from = &square[y * size..][..lines[1]];
                        let mut to = image.row_mut(node.first[0] + y);
                        let to = to.as_slice_mut().expect("rows are whole");
                        let to = &mut to[node.first[1]..][..lines[1]];
                        to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
                    }
                }
            }
            let origin = warps[0].origin.map(|o| (o - reach as i64) * cell as i64);
            images.extend(phases.iter().zip(own).map(|(phase, light)| SubImage {
                channel,
                origin: [0, 1].map(|a| origin[a] + phase[a] as i64),
                step: cell,
                light,
            }));
        }
        images
    }

    pub fn adjoint(
        &self,
        frames: &[Array2<f32>],
        shape: (usize, usize),
        inputs: usize,
        scratch: &mut FftScratch,
    ) -> Vec<Array2<f32>> {
        let (reach, cell) = (self.source.reach(), self.source.points.cell());
        let mut planes = vec![Array2::zeros(shape); inputs];
        for (channel, plan) in self.channels.iter().enumerate() {
            let warps = self.warps(channel, plan);
            let (own, phases) = (self.source.inputs(channel), self.source.phases(channel));
            let (size, entries) = (plan.fft.size(), plan.fft.entries());
            let columns = warps[0].shape[1];
            let origin = warps[0].origin.map(|o| (o - reach as i64) * cell as i64);
            let mut gathered = vec![vec![0.0f32; warps[0].shape[0] * columns]; own.len() * warps.len()];
            let mut square = vec![0.0; size * size];
            let mut spectra = vec![vec![Complex32::ZERO; entries]; phases.len()];
            let mut product = vec![Complex32::ZERO; entries];
            let mut hats = Vec::new();
            for node in &plan.nodes {
                let lines = node.shape.map(|s| s + 2 * reach);
                let mut any = false;
                for (phase, spectrum) in phases.iter().zip(&mut spectra) {
                    let first = [0, 1].map(|a| origin[a] + (node.first[a] * cell + phase[a]) as i64);
                    any |= window_of(&frames[channel], first, cell, lines, &mut square, size);
                    plan.fft.forward(&mut square, lines[0], spectrum, scratch);
                }
                if !any {
                    continue;
                }
                for (k, light) in self.lights(node, own.len(), warps.len()).iter().enumerate() {
                    product.fill(Complex32::ZERO);
                    for (phase, spectrum) in spectra.iter().enumerate() {
                        let kernel = self.kernel(channel, plan, node, (k, warps.len()), phase, scratch);
                        multiply_conj_add(&mut product, spectrum, &kernel);
                    }
                    plan.fft.inverse(&mut product, &mut square, scratch);
                    if k == 0 || warps.len() > 1 {
                        node.hats(&warps[light.point], &mut hats);
                    }
                    for (to, weight) in gathered.chunks_exact_mut(warps.len()).zip(&light.weights) {
                        node.add(&square, size, *weight, &hats, &mut to[light.point], columns);
                    }
                }
            }
            for (k, light) in gathered.iter().enumerate() {
                warps[k % warps.len()].scatter(light, &mut planes[own[k / warps.len()].0]);
            }
        }
        planes
    }
}

/// Light that one kernel of a node acts on.
struct Light {
    /// Of each input.
    weights: Vec<f32>,
    point: usize,
}

/// Which of the kernels of a node.
#[derive(Clone, Copy)]
struct KernelAt {
    input: usize,
    point: usize,
    phase: usize,
}

impl NodePlan {
    /// Weights of the node over its rectangle.
    fn hats(&self, warp: &Warp, hats: &mut Vec<f32>) {
        hats.clear();
        for y in 0..self.shape[0] {
            let row = (self.first[0] + y) * warp.shape[1] + self.first[1];
            hats.extend(
                warp.nodes[row..][..self.shape[1]]
                    .iter()
                    .map(|place| hat(*place, self.node)),
            );
        }
    }

    /// Add light under the hat, times a weight, to the corner of a square. Whether there is any.
    fn cut(&self, light: &[f32], weight: f32, columns: usize, hats: &[f32], square: &mut [f32], size: usize) -> bool {
        if weight == 0.0 {
            return false;
        }
        let mut lit = false;
        for (y, hats) in hats.chunks_exact(self.shape[1]).enumerate() {
            let from = &light[(self.first[0] + y) * columns + self.first[1]..][..self.shape[1]];
            let to = &mut square[y * size..][..self.shape[1]];
            for (to, (v, h)) in to.iter_mut().zip(from.iter().zip(hats)) {
                let value = weight * v * h;
                *to += value;
                lit |= value != 0.0;
            }
        }
        lit
    }

    /// The adjoint of [`NodePlan::cut`].
    fn add(&self, square: &[f32], size: usize, weight: f32, hats: &[f32], light: &mut [f32], columns: usize) {
        if weight == 0.0 {
            return;
        }
        for (y, hats) in hats.chunks_exact(self.shape[1]).enumerate() {
            let to = &mut light[(self.first[0] + y) * columns + self.first[1]..][..self.shape[1]];
            let from = &square[y * size..][..self.shape[1]];
            to.iter_mut()
                .zip(from.iter().zip(hats))
                .for_each(|(t, (f, h))| *t += weight * f * h);
        }
    }
}

/// Every `step`-th pixel of a frame from `first` on, in the corner of a square. Whether any of it is on the sensor.
fn window_of(
    frame: &Array2<f32>,
    first: [i64; 2],
    step: usize,
    lines: [usize; 2],
    square: &mut [f32],
    size: usize,
) -> bool {
    square.fill(0.0);
    let (rows, columns) = frame.dim();
    let mut any = false;
    for y in 0..lines[0] {
        let Some(row) = inside(first[0] + (y * step) as i64, rows) else {
            continue;
        };
        for x in 0..lines[1] {
            if let Some(column) = inside(first[1] + (x * step) as i64, columns) {
                square[y * size + x] = frame[[row, column]];
                any = true;
            }
        }
    }
    any
}

fn multiply_add(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    sum.iter_mut().zip(a.iter().zip(b)).for_each(|(s, (a, b))| *s += a * b);
}

/// Adds the products of `a` with the conjugates of `b`.
fn multiply_conj_add(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    sum.iter_mut()
        .zip(a.iter().zip(b))
        .for_each(|(s, (a, b))| *s += a * b.conj());
}
