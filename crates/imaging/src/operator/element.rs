//! One element: its warps, and the kernels of its nodes. What it does with light is in `element_pass`.

use std::borrow::Cow;
use std::sync::Arc;

use metalith_sensor::Sensor;
use metalith_wave::kernels::{FftScratch, SquareFft, fft_size};
use ndarray::Array2;
use num_complex::Complex32;

use super::kernel_interpolation::BetweenNodes;
use super::low_rank_kernels::MixedKernels;
use super::source::KernelSource;
use super::sub_image::PixelGrid;
use super::warp::{CellPoint, Warp};
use crate::geometry::{ElementView, SceneSpace};

/// One element of an operator.
pub(crate) struct ElementOperator<'a> {
    element: usize,
    view: ElementView,
    pub(super) source: KernelSource<'a>,
    sensor: Sensor,
    /// Share of its light that each value of the frame counts; none if all count all of it.
    accepted: Option<Array2<f32>>,
    scene: SceneSpace,
    pub(super) channels: Vec<ChannelPlan>,
}

/// Plan of one channel of an element.
pub(super) struct ChannelPlan {
    /// One for each point within a pixel; none if they are made when needed.
    warps: Vec<Warp>,
    pub fft: Arc<SquareFft>,
    pub nodes: Vec<NodePlan>,
}

/// One node of a channel: the rectangle in which it has weight, and what is kept of it if the light has one point a cell.
pub(super) struct NodePlan {
    node: [usize; 2],
    pub first: [usize; 2],
    pub shape: [usize; 2],
    /// Kernels by phase and light, see [`MixedKernels`].
    kernels: MixedKernels,
    /// Over its rectangle.
    weights: Vec<f32>,
}

impl<'a> ElementOperator<'a> {
    pub(crate) fn new(
        element: usize,
        view: &ElementView,
        source: &KernelSource<'a>,
        (sensor, accepted): (&Sensor, Option<Array2<f32>>),
        scene: &SceneSpace,
    ) -> Self {
        let mut own = Self {
            element,
            view: *view,
            source: source.clone(),
            sensor: sensor.clone(),
            accepted,
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

    /// A point of a cell, for light of so many pixels.
    fn point(&self, shift: [f64; 2], area: f64) -> CellPoint {
        CellPoint {
            cell: self.source.points.cell(),
            shift,
            reach: self.source.reach() + self.around(),
            area,
            assumed: self.source.assumed,
        }
    }

    /// Cells about the rectangle of a node by the middles of cells that points within them may lie in.
    fn around(&self) -> usize {
        usize::from(self.source.points.offsets().len() > 1)
    }

    fn channel(&self, channel: usize) -> ChannelPlan {
        let cell = self.source.points.cell();
        let middle = self.warp(channel, self.point([0.0; 2], (cell * cell) as f64));
        let (between, n) = (self.source.between, self.source.spec.nodes);
        let mut nodes: Vec<NodePlan> = Vec::new();
        for (i, support) in middle.supports(between, n).into_iter().enumerate() {
            let node = [i / n, i % n];
            if let Some((first, shape)) = support {
                let beyond = self.around();
                let low = first.map(|f| f.saturating_sub(beyond));
                let high = [0, 1].map(|a| (first[a] + shape[a] + beyond).min(middle.shape[a]));
                nodes.push(NodePlan {
                    node,
                    first: low,
                    shape: [high[0] - low[0], high[1] - low[1]],
                    kernels: MixedKernels::default(),
                    weights: Vec::new(),
                });
            }
        }
        let longest = nodes.iter().flat_map(|n| n.shape).max().unwrap_or(1);
        let fft = Arc::new(SquareFft::new(fft_size(longest + 2 * self.source.reach())));
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
                node.weights = node.weights_of(&middle, between, n);
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
        let kernel = self
            .source
            .pixels(self.element, node, channel, bases, at.point, at.phase);
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
    pub(super) fn warps<'b>(&self, channel: usize, plan: &'b ChannelPlan) -> Cow<'b, [Warp]> {
        if !plan.warps.is_empty() {
            return Cow::Borrowed(&plan.warps);
        }
        let (cell, points) = (self.source.points.cell(), self.source.points.offsets());
        let area = (cell * cell) as f64 / points.len() as f64;
        let warp = |shift: &[f64; 2]| self.warp(channel, self.point(*shift, area));
        points.iter().map(warp).collect()
    }

    /// Light that is cut out of the sampled light for a node: weights of its inputs, at one of their points.
    pub(super) fn lights(node: &NodePlan, inputs: usize, points: usize) -> Vec<Light> {
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
    pub(super) fn kernel<'b>(
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

    /// Light of pixels of a frame as far as they count light of this element.
    pub(super) fn counted(&self, grid: &PixelGrid, frame: &Array2<f32>) -> Vec<f32> {
        let mut light = grid.gather(frame);
        self.accept(grid, &mut light);
        light
    }

    /// Leave what pixels count of light of this element that falls on them.
    pub(super) fn accept(&self, grid: &PixelGrid, light: &mut [f32]) {
        if let Some(accepted) = &self.accepted {
            let shares = grid.gather(accepted);
            light.iter_mut().zip(shares).for_each(|(l, share)| *l *= share);
        }
    }

    /// Add the light of pixels to the places of the scene that they look at, as if nothing were blurred: a plane for each
    /// channel.
    pub(crate) fn lay_on_scene(&self, frames: &[Array2<f32>], planes: &mut [Array2<f32>]) {
        let step = self.source.points.frame_step();
        for (channel, plan) in self.channels.iter().enumerate() {
            let Some(warp) = plan.warps.first() else { continue };
            let grids = self.source.phases(channel).iter().map(|p| warp.pixels(step, *p, 0));
            let mut light = vec![0.0; warp.shape[0] * warp.shape[1]];
            for grid in grids {
                let own = self.counted(&grid, &frames[channel]);
                light.iter_mut().zip(own).for_each(|(l, v)| *l += v);
            }
            warp.scatter(&[&light], &mut planes[channel..=channel]);
        }
    }
}

/// Light that one kernel of a node acts on.
pub(super) struct Light {
    /// Weights of each input.
    pub weights: Vec<f32>,
    pub point: usize,
}

impl NodePlan {
    /// Weights over its rectangle for light of a warp: those that are kept, or made now.
    pub(crate) fn weights(&self, warp: &Warp, source: &KernelSource<'_>) -> Cow<'_, [f32]> {
        if self.weights.is_empty() {
            Cow::Owned(self.weights_of(warp, source.between, source.spec.nodes))
        } else {
            Cow::Borrowed(&self.weights)
        }
    }

    fn weights_of(&self, warp: &Warp, between: BetweenNodes, n: usize) -> Vec<f32> {
        let mut weights = Vec::with_capacity(self.shape[0] * self.shape[1]);
        for y in 0..self.shape[0] {
            let row = &warp.nodes[(self.first[0] + y) * warp.shape[1] + self.first[1]..][..self.shape[1]];
            between.weights(row, self.node, n, &mut weights);
        }
        weights
    }
}

/// Index of a kernel of a node.
#[derive(Clone, Copy)]
struct KernelAt {
    input: usize,
    point: usize,
    phase: usize,
}
