//! One element: its warps, and the kernels of its nodes.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use metalith_camera::Sensor;
use metalith_wave::kernels::fft_size;
use ndarray::Array2;
use num_complex::Complex32;

use super::{Detail, FftScratch, SceneInputs, SquareFft, Warp, hat};
use crate::kernels::{BankSpec, KernelBank};
use crate::{ElementView, SceneView};

/// Where kernels come from.
#[derive(Clone)]
pub struct KernelSource<'a> {
    bank: &'a KernelBank,
    points: usize,
    node_step: usize,
    inputs: SceneInputs,
    /// That of the bank, with the nodes that are used.
    spec: BankSpec,
}

impl<'a> KernelSource<'a> {
    pub fn new(bank: &'a KernelBank, detail: &Detail) -> Self {
        assert!(matches!(detail.points, 1 | 2), "one or two points an axis");
        let steps = bank.spec.nodes - 1;
        assert!(steps.is_multiple_of(detail.node_step), "every step ends at a node");
        Self {
            bank,
            points: detail.points,
            node_step: detail.node_step,
            inputs: detail.inputs.clone(),
            spec: BankSpec {
                nodes: steps / detail.node_step + 1,
                ..bank.spec
            },
        }
    }

    /// Points within a pixel at which the scene is sampled: shifts from the middle (pixels).
    fn points(&self) -> &'static [[f64; 2]] {
        match self.points {
            1 => &[[0.0; 2]],
            _ => &[[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]],
        }
    }

    /// Which planes of the scene a channel sees, each with the spectra whose kernels act on it.
    fn inputs(&self, channel: usize) -> Vec<(usize, Range<usize>)> {
        match &self.inputs {
            SceneInputs::Spectra(all) => all.clone().enumerate().map(|(i, b)| (i, b..b + 1)).collect(),
            SceneInputs::Channels(all) => vec![(channel, all.clone())],
        }
    }

    /// The kernel of a node on whole pixels, for light at a point of a pixel, `window + 1` values an axis: the middle one
    /// is the pixel itself.
    fn pixels(&self, element: usize, node: [usize; 2], channel: usize, bases: Range<usize>, point: usize) -> Vec<f32> {
        let window = self.spec.window;
        let side = window + 1;
        let mut out = vec![0.0f32; side * side];
        // A kernel value `i` stands at (i - window + 1/2) / 2 pixels; light at a quarter of a pixel beyond the middle is
        // half a value nearer to what lies there. For one point a pixel, the mean of all four.
        const PHASES: [[usize; 2]; 4] = [[0, 0], [1, 0], [0, 1], [1, 1]];
        let phases = match self.points {
            1 => &PHASES[..],
            _ => &PHASES[point..=point],
        };
        let share = 1.0 / phases.len() as f32;
        let node = node.map(|n| n * self.node_step);
        for basis in bases {
            let kernel = self.bank.kernel(element, node, channel, basis);
            for [px, py] in phases {
                for (y, row) in out.chunks_exact_mut(side).enumerate() {
                    let Some(i) = (2 * y).checked_sub(*py).filter(|i| *i < 2 * window) else {
                        continue;
                    };
                    for (x, v) in row.iter_mut().enumerate() {
                        if let Some(j) = (2 * x).checked_sub(*px).filter(|j| *j < 2 * window) {
                            *v += share * kernel.at(i, j);
                        }
                    }
                }
            }
        }
        out
    }
}

/// One element of an operator.
pub struct ElementOperator<'a> {
    element: usize,
    view: ElementView,
    source: KernelSource<'a>,
    sensor: Sensor,
    scene: SceneView,
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
    spectra: Vec<Complex32>,
}

/// The sub-image of an element, by channel.
pub struct SubImage {
    channel: usize,
    origin: [i64; 2],
    light: Array2<f32>,
}

impl SubImage {
    /// Add what lies on the sensor to its frames.
    pub fn add_to(&self, frames: &mut [Array2<f32>]) {
        let frame = &mut frames[self.channel];
        let (rows, columns) = frame.dim();
        let (own_rows, own_columns) = self.light.dim();
        for y in 0..own_rows {
            let row = self.origin[0] + y as i64;
            if !(0..rows as i64).contains(&row) {
                continue;
            }
            for x in 0..own_columns {
                let column = self.origin[1] + x as i64;
                if (0..columns as i64).contains(&column) {
                    frame[[row as usize, column as usize]] += self.light[[y, x]];
                }
            }
        }
    }
}

impl<'a> ElementOperator<'a> {
    pub fn new(
        element: usize,
        view: &ElementView,
        source: &KernelSource<'a>,
        sensor: &Sensor,
        scene: &SceneView,
    ) -> Self {
        let mut own = Self {
            element,
            view: *view,
            source: source.clone(),
            sensor: sensor.clone(),
            scene: *scene,
            channels: Vec::new(),
        };
        own.channels = (0..source.bank.channel_um.len()).map(|c| own.channel(c)).collect();
        own
    }

    fn warp(&self, channel: usize, shift: [f64; 2], area: f64) -> Warp {
        let um = self.source.bank.channel_um[channel];
        Warp::new(
            &self.view,
            &self.sensor,
            &self.source.spec,
            &self.scene,
            um,
            shift,
            area,
        )
    }

    fn channel(&self, channel: usize) -> ChannelPlan {
        let middle = self.warp(channel, [0.0; 2], 1.0);
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
                    spectra: Vec::new(),
                });
            }
        }
        let longest = nodes.iter().flat_map(|n| n.shape).max().unwrap_or(1);
        let fft = Arc::new(SquareFft::new(fft_size(longest + self.source.spec.window + 1)));
        let mut warps = Vec::new();
        if self.source.points == 1 {
            let mut scratch = FftScratch::default();
            for node in &mut nodes {
                for (_, bases) in self.source.inputs(channel) {
                    node.spectra
                        .extend(self.spectrum(node.node, channel, bases, 0, &fft, &mut scratch));
                }
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
        bases: Range<usize>,
        point: usize,
        fft: &SquareFft,
        scratch: &mut FftScratch,
    ) -> Vec<Complex32> {
        let kernel = self.source.pixels(self.element, node, channel, bases, point);
        let (side, size) = (self.source.spec.window + 1, fft.size());
        let mut square = vec![0.0; size * size];
        for (row, to) in kernel.chunks_exact(side).zip(square.chunks_exact_mut(size)) {
            to[..side].copy_from_slice(row);
        }
        let mut spectrum = vec![Complex32::ZERO; fft.entries()];
        fft.forward(&mut square, side, &mut spectrum, scratch);
        spectrum
    }

    /// Warps of a channel at all points within a pixel: those that are kept, or made now.
    fn warps<'b>(&self, channel: usize, plan: &'b ChannelPlan) -> Cow<'b, [Warp]> {
        if !plan.warps.is_empty() {
            return Cow::Borrowed(&plan.warps);
        }
        let points = self.source.points();
        let area = 1.0 / points.len() as f64;
        points.iter().map(|shift| self.warp(channel, *shift, area)).collect()
    }

    pub fn apply(&self, scene: &[Array2<f32>], scratch: &mut FftScratch) -> Vec<SubImage> {
        let half = self.source.spec.window / 2;
        let mut images = Vec::new();
        for (channel, plan) in self.channels.iter().enumerate() {
            let warps = self.warps(channel, plan);
            let inputs = self.source.inputs(channel);
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
            let mut image = Array2::zeros([shape[0] + 2 * half, shape[1] + 2 * half]);
            let mut square = vec![0.0; size * size];
            let mut spectrum = vec![Complex32::ZERO; entries];
            for node in &plan.nodes {
                let mut sum = vec![Complex32::ZERO; entries];
                let mut lit = false;
                for (k, light) in sampled.iter().enumerate() {
                    let (input, point) = (k / warps.len(), k % warps.len());
                    if !cut(light, &warps[point], node, &mut square, size) {
                        continue;
                    }
                    lit = true;
                    plan.fft.forward(&mut square, node.shape[0], &mut spectrum, scratch);
                    if node.spectra.is_empty() {
                        let kernel =
                            self.spectrum(node.node, channel, inputs[input].1.clone(), point, &plan.fft, scratch);
                        multiply_add(&mut sum, &spectrum, &kernel);
                    } else {
                        multiply_add(&mut sum, &spectrum, &node.spectra[input * entries..][..entries]);
                    }
                }
                if !lit {
                    continue;
                }
                plan.fft.inverse(&mut sum, &mut square, scratch);
                for y in 0..node.shape[0] + 2 * half {
                    for x in 0..node.shape[1] + 2 * half {
                        image[[node.first[0] + y, node.first[1] + x]] += square[y * size + x];
                    }
                }
            }
            images.push(SubImage {
                channel,
                origin: warps[0].origin.map(|o| o - half as i64),
                light: image,
            });
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
        let half = self.source.spec.window / 2;
        let mut planes = vec![Array2::zeros(shape); inputs];
        for (channel, plan) in self.channels.iter().enumerate() {
            let warps = self.warps(channel, plan);
            let own = self.source.inputs(channel);
            let size = plan.fft.size();
            let entries = plan.fft.entries();
            let origin = warps[0].origin.map(|o| o - half as i64);
            let mut gathered = vec![vec![0.0f32; warps[0].shape[0] * warps[0].shape[1]]; own.len() * warps.len()];
            let mut square = vec![0.0; size * size];
            let mut spectrum = vec![Complex32::ZERO; entries];
            for node in &plan.nodes {
                let lines = node.shape.map(|s| s + 2 * half);
                if !window_of(&frames[channel], origin, node, lines, &mut square, size) {
                    continue;
                }
                plan.fft.forward(&mut square, lines[0], &mut spectrum, scratch);
                for (k, light) in gathered.iter_mut().enumerate() {
                    let (input, point) = (k / warps.len(), k % warps.len());
                    let mut product = spectrum.clone();
                    if node.spectra.is_empty() {
                        let kernel = self.spectrum(node.node, channel, own[input].1.clone(), point, &plan.fft, scratch);
                        multiply_conj(&mut product, &kernel);
                    } else {
                        multiply_conj(&mut product, &node.spectra[input * entries..][..entries]);
                    }
                    plan.fft.inverse(&mut product, &mut square, scratch);
                    let warp = &warps[point];
                    for y in 0..node.shape[0] {
                        let row = (node.first[0] + y) * warp.shape[1] + node.first[1];
                        for x in 0..node.shape[1] {
                            light[row + x] += hat(warp.nodes[row + x], node.node) * square[y * size + x];
                        }
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

/// The light under the hat of a node, in the corner of a square. Whether there is any.
fn cut(light: &[f32], warp: &Warp, node: &NodePlan, square: &mut [f32], size: usize) -> bool {
    square.fill(0.0);
    let mut lit = false;
    for y in 0..node.shape[0] {
        let row = (node.first[0] + y) * warp.shape[1] + node.first[1];
        for x in 0..node.shape[1] {
            let value = light[row + x];
            if value != 0.0 {
                square[y * size + x] = value * hat(warp.nodes[row + x], node.node);
                lit = true;
            }
        }
    }
    lit
}

/// The part of a frame that a node reaches, in the corner of a square. Whether any of it is on the sensor.
fn window_of(
    frame: &Array2<f32>,
    origin: [i64; 2],
    node: &NodePlan,
    lines: [usize; 2],
    square: &mut [f32],
    size: usize,
) -> bool {
    square.fill(0.0);
    let (rows, columns) = frame.dim();
    let mut any = false;
    for y in 0..lines[0] {
        let row = origin[0] + (node.first[0] + y) as i64;
        if !(0..rows as i64).contains(&row) {
            continue;
        }
        for x in 0..lines[1] {
            let column = origin[1] + (node.first[1] + x) as i64;
            if (0..columns as i64).contains(&column) {
                square[y * size + x] = frame[[row as usize, column as usize]];
                any = true;
            }
        }
    }
    any
}

fn multiply_add(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    sum.iter_mut().zip(a.iter().zip(b)).for_each(|(s, (a, b))| *s += a * b);
}

fn multiply_conj(a: &mut [Complex32], b: &[Complex32]) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a *= b.conj());
}
