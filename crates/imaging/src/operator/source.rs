//! Kernels as an operator uses them: on the pixels that a point of its grid reaches.
//!
//! A sub-image is a grid of cells of one pixel or of two by two. In a cell the scene is sampled at one point or at four,
//! and the pixels of a cell are its phases: each phase of the image is a convolution on the grid of cells.

use std::f64::consts::PI;
use std::ops::Range;

use metalith_sensor::{ColourFilter, Sensor};
use nalgebra::DMatrix;

use super::detail::{Detail, SceneInputs, ScenePoints};
use super::kernel_interpolation::BetweenNodes;
use crate::approximation_set::ApproximationSet;
use crate::exposure::channel_at;
use crate::kernels::{BankSpec, KernelBank, TurnedKernel};

/// Source of kernels.
#[derive(Clone)]
pub(crate) struct KernelSource<'a> {
    pub bank: &'a KernelBank,
    pub points: ScenePoints,
    pub inputs: SceneInputs,
    pub assumed: ApproximationSet,
    /// Variation of inputs with one another, if kernels are to be mixed.
    pub statistics: Option<DMatrix<f64>>,
    /// Specification of the bank, with the nodes that are used.
    pub spec: BankSpec,
    pub between: BetweenNodes,
    node_step: usize,
    /// Pixels of a square of the colour filter, or of a cell of one pixel, that each channel counts, row and column.
    counted: Vec<Vec<[usize; 2]>>,
}

/// Lobes of [`lanczos`] on both sides.
pub(crate) const LOBES: usize = 3;

/// Interpolation (Duchon, J. Appl. Meteorol. 18, 1016 (1979)): the weight of a value at a distance in steps of the grid, no
/// more than three steps away. Waves of four steps keep 99 % of their height; a cubic of two steps leaves 88 %.
pub(crate) fn lanczos(distance: f64) -> f64 {
    let sinc = |t: f64| if t == 0.0 { 1.0 } else { (PI * t).sin() / (PI * t) };
    if distance.abs() < LOBES as f64 {
        sinc(distance) * sinc(distance / LOBES as f64)
    } else {
        0.0
    }
}

/// Cells beside the window of a kernel whose light counts, of the three that [`lanczos`] reaches: the light at the border of a window is
/// faint, and the first lobe holds nearly all of what is spread from there. Transforms have 96 places an axis with it in place of 108.
const BESIDE_WINDOW: usize = 1;
/// Points on both sides of the middle of a cell, half a pixel apart, that its light is spread over between it and its neighbours.
fn spread_points(cell: usize) -> usize {
    2 * cell * LOBES
}

/// Weights of the points about a cell, half a pixel apart; an even scene stays exactly even.
fn spread(cell: usize) -> Vec<f32> {
    let (points, step) = (spread_points(cell), 2 * cell);
    let place = |k: usize| (k as f64 + 0.5 - points as f64) / step as f64;
    let plain: Vec<f64> = (0..2 * points).map(|k| lanczos(place(k))).collect();
    // Cells put light into points that are a whole number of steps apart: their weights are all that a point gets.
    let all = |k: usize| step as f64 * plain.iter().skip(k % step).step_by(step).sum::<f64>();
    (0..2 * points).map(|k| (plain[k] / all(k)) as f32).collect()
}

impl<'a> KernelSource<'a> {
    pub(crate) fn new(bank: &'a KernelBank, detail: &Detail, sensor: &Sensor, channel_names: &[String]) -> Self {
        let steps = bank.spec.nodes - 1;
        assert!(steps.is_multiple_of(detail.node_step), "every step ends at a node");
        let cell = detail.points.cell();
        // Blocks are whole squares of the filter.
        let square = cell.min(2);
        let counted = |channel: usize| {
            (0..square * square)
                .map(|i| [i / square, i % square])
                .filter(|[y, x]| {
                    cell == 1
                        || sensor.filter == ColourFilter::None
                        || channel_at(sensor.filter, channel_names, *y, *x) == Some(channel)
                })
                .collect()
        };
        Self {
            bank,
            points: detail.points,
            inputs: detail.inputs.clone(),
            assumed: detail.assumed,
            statistics: detail.statistics.clone(),
            spec: BankSpec {
                // One kernel for the whole field needs no places between which it would change.
                nodes: if detail.assumed.fixed_kernels {
                    1
                } else {
                    steps / detail.node_step + 1
                },
                ..bank.spec
            },
            between: detail.between,
            node_step: detail.node_step,
            counted: (0..bank.channel_um.len()).map(counted).collect(),
        }
    }

    /// Planes of the scene that a channel sees, each with the spectra whose kernels act on it.
    pub(crate) fn inputs(&self, channel: usize) -> Vec<(usize, Range<usize>)> {
        match &self.inputs {
            SceneInputs::Spectra(all) => all.clone().enumerate().map(|(i, b)| (i, b..b + 1)).collect(),
            SceneInputs::Channels(all) => vec![(channel, all.clone())],
        }
    }

    /// Places in a cell of the values of a frame that are found for a channel, row and column.
    pub(crate) fn phases(&self, channel: usize) -> &[[usize; 2]] {
        let counted = &self.counted[channel];
        match self.points {
            ScenePoints::OneABlock if counted.is_empty() => &[],
            ScenePoints::OneABlock => &[[0; 2]],
            _ => counted,
        }
    }

    /// Pixels of a cell whose mean is a value, row and column.
    fn mean_of(&self, channel: usize, phase: usize) -> &[[usize; 2]] {
        match self.points {
            ScenePoints::OneABlock => &self.counted[channel],
            _ => &self.counted[channel][phase..=phase],
        }
    }

    /// Cells on each side of its own that a kernel reaches.
    pub(crate) fn reach(&self) -> usize {
        let cell = self.points.cell();
        let beside = if cell > 1 { BESIDE_WINDOW } else { 0 };
        (self.spec.window / 2).div_ceil(cell) + beside
    }

    /// The kernel of a node, for light at a point of a cell, on one value of the frame in each cell: `2 reach + 1` values an
    /// axis, the middle one in the cell itself.
    pub(crate) fn pixels(
        &self,
        element: usize,
        node: [usize; 2],
        channel: usize,
        bases: Range<usize>,
        point: usize,
        phase: usize,
    ) -> Vec<f32> {
        let side = 2 * self.reach() + 1;
        let pixels = self.mean_of(channel, phase);
        let (kept, node) = (2 * self.spec.window, node.map(|n| n * self.node_step));
        let mut out = vec![0.0f32; side * side];
        for basis in bases {
            let (kernel, level) = self.kernel(element, node, channel, basis);
            let kernel = kernel.turned();
            let level = level / pixels.len() as f32;
            for pixel in pixels {
                let [down, across] = [0, 1].map(|axis| self.taps((point >> (1 - axis)) & 1, pixel[axis]));
                // Sums along the rows that are asked for, each once.
                let mut lines: Vec<Option<Vec<f32>>> = vec![None; kept];
                for (m, to) in out.chunks_exact_mut(side).enumerate() {
                    for (i, weight) in down.weights_of(m, kept) {
                        let line = lines[i].get_or_insert_with(|| {
                            let row = &kernel[i * kept..][..kept];
                            (0..side).map(|x| across.sum(x, row)).collect()
                        });
                        let weight = level * weight;
                        to.iter_mut().zip(line.iter()).for_each(|(t, v)| *t += weight * v);
                    }
                }
            }
        }
        out
    }

    /// The kernel that is taken to be in force at a node of the bank, and what it is multiplied by.
    fn kernel(&self, element: usize, node: [usize; 2], channel: usize, basis: usize) -> (TurnedKernel<'_>, f32) {
        let axis = self
            .bank
            .kernel(element, [(self.bank.spec.nodes - 1) / 2; 2], channel, basis);
        if self.assumed.fixed_kernels {
            return (axis, 1.0);
        }
        let kernel = self.bank.kernel(element, node, channel, basis);
        let level = match (self.assumed.butterworth, kernel.energy()) {
            // How much an element passes is then in the brightness.
            (true, energy) if energy > 0.0 => (axis.energy() / energy) as f32,
            _ => 1.0,
        };
        (kernel, level)
    }

    /// Values of a kernel by which light at a point reaches a pixel of each cell, along one axis: the first or the
    /// second of two points, the first or the second of two pixels.
    fn taps(&self, point: usize, phase: usize) -> Taps {
        let window = self.spec.window as i64;
        // A kept value `i` stands at (i - window + 1/2) / 2 pixels from the light.
        match self.points {
            // Light a quarter of a pixel beyond the middle is half a value nearer to what lies there.
            ScenePoints::FourAPixel => Taps {
                first: -(point as i64),
                stride: 2,
                weights: vec![1.0],
            },
            // The mean of both points.
            ScenePoints::OneAPixel => Taps {
                first: -1,
                stride: 2,
                weights: vec![0.5; 2],
            },
            ScenePoints::OneASquare | ScenePoints::OneABlock => {
                let cell = self.points.cell();
                let before = 2 * cell * self.reach() + spread_points(cell) + cell;
                let one = spread(cell);
                // Squares of the filter that a value is the mean of, four values of the kernel apart.
                let squares = self.points.value().div_ceil(2);
                let mut weights = vec![0.0; one.len() + 4 * (squares - 1)];
                for square in 0..squares {
                    let to = weights[4 * square..].iter_mut().zip(&one);
                    to.for_each(|(t, w)| *t += w / squares as f32);
                }
                Taps {
                    first: window + 2 * phase as i64 + 1 - before as i64,
                    stride: 2 * cell,
                    weights,
                }
            }
        }
    }
}

/// A weighted sum over values next to one another, for each of many cells.
struct Taps {
    /// The first value for the first cell; it may lie before all.
    first: i64,
    /// Values from one cell to the next.
    stride: usize,
    weights: Vec<f32>,
}

impl Taps {
    /// Indices of the values, of so many, that count for a cell, and their weights.
    fn weights_of(&self, cell: usize, values: usize) -> impl Iterator<Item = (usize, f32)> {
        let first = self.first + (cell * self.stride) as i64;
        let from = (-first).max(0) as usize;
        let to = (values as i64 - first).clamp(0, self.weights.len() as i64) as usize;
        let inside = &self.weights[from.min(to)..to];
        let first = (first + from.min(to) as i64) as usize;
        inside.iter().enumerate().map(move |(k, w)| (first + k, *w))
    }

    fn sum(&self, cell: usize, values: &[f32]) -> f32 {
        self.weights_of(cell, values.len()).map(|(i, w)| w * values[i]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_scene_stays_even_and_waves_their_height() {
        let weights = spread(2);
        for class in 0..4 {
            let sum: f32 = weights.iter().skip(class).step_by(4).sum();
            // Single precision.
            assert!((sum - 0.25).abs() < 1e-6, "{sum}");
        }
        let height = |steps: f64| {
            let wave = |k: usize| (2.0 * PI * 0.25 * (k as f64 + 0.5 - spread_points(2) as f64) / steps).cos();
            weights
                .iter()
                .enumerate()
                .map(|(k, w)| f64::from(*w) * wave(k))
                .sum::<f64>()
        };
        // The lobes that are cut off.
        assert!((height(4.0) - 1.0).abs() < 0.02 && (height(8.0) - 1.0).abs() < 0.01);
        assert!((height(2.0) - 0.5).abs() < 0.05);
    }
}
