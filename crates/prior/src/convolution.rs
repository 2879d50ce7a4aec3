//! Convolutions of 3 x 3 and 1 x 1, and their gradients, in registers.
//!
//! A block of positions of four output channels stays in registers while all inputs pass. Products are fused with their
//! sum, in one order for each output, so that the answer does not depend on threads. Sums of the gradient of weights run
//! along a register: they depend on its length, and learning is the same bit by bit on machines of one kind.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::features::{BLOCK, Features};

/// Output channels that are made at a time.
const OUTPUTS: usize = 4;
/// Registers along a line that are made at a time.
const VECTORS: usize = 2;
/// Positions of one piece of work of a large plane.
const PIECE: usize = 128 * BLOCK;

/// Shape of a convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    pub inputs: usize,
    /// A multiple of four.
    pub outputs: usize,
    /// Nine for 3 x 3, one for 1 x 1.
    pub taps: usize,
}

impl Shape {
    /// Number of weights, `[output][input][tap]`, taps row by row.
    pub fn weights(&self) -> usize {
        self.inputs * self.outputs * self.taps
    }

    /// Distances of the inputs of a position.
    fn offsets(&self, stride: usize) -> Vec<isize> {
        let stride = stride as isize;
        match self.taps {
            9 => (-1..=1).flat_map(|y| (-1..=1).map(move |x| y * stride + x)).collect(),
            _ => vec![0],
        }
    }
}

/// Weights in the order in which they are used.
#[derive(Clone, Debug)]
pub(crate) struct Packed {
    shape: Shape,
    /// `[output / 4][input][tap][output % 4]`
    values: Vec<f32>,
}

impl Packed {
    /// Weights packed for the forward pass.
    pub(crate) fn forward(shape: Shape, weights: &[f32]) -> Self {
        Self::by(shape, |o, i, t| weights[(o * shape.inputs + i) * shape.taps + t])
    }

    /// Weights packed for the gradient of the inputs: channels exchanged, taps mirrored.
    pub(crate) fn backward(shape: Shape, weights: &[f32]) -> Self {
        let mirrored = Shape {
            inputs: shape.outputs,
            outputs: shape.inputs,
            taps: shape.taps,
        };
        Self::by(mirrored, |o, i, t| {
            weights[(i * shape.inputs + o) * shape.taps + (shape.taps - 1 - t)]
        })
    }

    fn by(shape: Shape, weight: impl Fn(usize, usize, usize) -> f32) -> Self {
        let mut values = Vec::with_capacity(shape.weights());
        for block in 0..shape.outputs / OUTPUTS {
            for i in 0..shape.inputs {
                for t in 0..shape.taps {
                    values.extend((0..OUTPUTS).map(|j| weight(block * OUTPUTS + j, i, t)));
                }
            }
        }
        Self { shape, values }
    }

    /// The convolution of features; negative values are set to zero if `rectified`.
    pub(crate) fn apply(&self, input: &Features, rectified: bool) -> Features {
        let mut out = Features::zero(self.shape.outputs, input.rows, input.columns);
        let (span, origin, plane) = (input.span(), input.origin(), input.plane_len());
        if span <= PIECE {
            self.piece(input, 0..span, &mut out.values, plane, origin, rectified);
        } else {
            // Channels of a piece are far from one another in the planes: each piece is made by itself, then laid out.
            let pieces: Vec<Vec<f32>> = (0..span.div_ceil(PIECE))
                .into_par_iter()
                .map(|k| {
                    let range = k * PIECE..span.min((k + 1) * PIECE);
                    let mut made = vec![0.0; self.shape.outputs * range.len()];
                    let stride = range.len();
                    self.piece(input, range, &mut made, stride, 0, rectified);
                    made
                })
                .collect();
            out.values.par_chunks_exact_mut(plane).enumerate().for_each(|(c, to)| {
                for (k, made) in pieces.iter().enumerate() {
                    let n = made.len() / self.shape.outputs;
                    to[origin + k * PIECE..][..n].copy_from_slice(&made[c * n..(c + 1) * n]);
                }
            });
        }
        out.clear_borders();
        out
    }

    /// Positions of a range; that of channel c goes to `out[c * stride + first..]`.
    fn piece(
        &self,
        input: &Features,
        range: std::ops::Range<usize>,
        out: &mut [f32],
        stride: usize,
        first: usize,
        rectified: bool,
    ) {
        Arch::new().dispatch(Piece {
            weights: self,
            offsets: &self.shape.offsets(input.stride()),
            input,
            range,
            out,
            stride,
            first,
            rectified,
        });
    }
}

struct Piece<'a> {
    weights: &'a Packed,
    offsets: &'a [isize],
    input: &'a Features,
    range: std::ops::Range<usize>,
    out: &'a mut [f32],
    stride: usize,
    first: usize,
    rectified: bool,
}

impl WithSimd for Piece<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let length = VECTORS * S::F32_LANES;
        let zero = simd.splat_f32s(0.0);
        let Shape { inputs, outputs, taps } = self.weights.shape;
        let (values, plane, origin) = (&self.input.values[..], self.input.plane_len(), self.input.origin());
        for p in self.range.clone().step_by(length) {
            for block in 0..outputs / OUTPUTS {
                let n = inputs * taps * OUTPUTS;
                let weights = self.weights.values[block * n..(block + 1) * n].as_chunks::<OUTPUTS>().0;
                let mut sum = [[zero; VECTORS]; OUTPUTS];
                for (i, weights) in weights.chunks_exact(taps).enumerate() {
                    let at = i * plane + origin + p;
                    for (offset, weight) in self.offsets.iter().zip(weights) {
                        let from = at.wrapping_add_signed(*offset);
                        let (x, _) = S::as_simd_f32s(&values[from..from + length]);
                        let x = [x[0], x[1]];
                        for j in 0..OUTPUTS {
                            let w = simd.splat_f32s(weight[j]);
                            for v in 0..VECTORS {
                                sum[j][v] = simd.mul_add_f32s(w, x[v], sum[j][v]);
                            }
                        }
                    }
                }
                for (j, sum) in sum.into_iter().enumerate() {
                    let at = (block * OUTPUTS + j) * self.stride + self.first + p - self.range.start;
                    let (to, _) = S::as_mut_simd_f32s(&mut self.out[at..at + length]);
                    for (to, v) in to.iter_mut().zip(sum) {
                        *to = if self.rectified { simd.max_f32s(v, zero) } else { v };
                    }
                }
            }
        }
    }
}

/// Add the gradient of the weights to `gradient`: of each the sum over positions of input times gradient of output.
pub(crate) fn add_weight_gradient(shape: Shape, input: &Features, output: &Features, gradient: &mut [f32]) {
    Arch::new().dispatch(WeightGradient {
        shape,
        input,
        output,
        gradient,
    });
}

struct WeightGradient<'a> {
    shape: Shape,
    input: &'a Features,
    output: &'a Features,
    gradient: &'a mut [f32],
}

impl WithSimd for WeightGradient<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Shape { inputs, outputs, taps } = self.shape;
        let offsets = self.shape.offsets(self.input.stride());
        let (origin, span) = (self.input.origin(), self.input.span());
        for block in 0..outputs / OUTPUTS {
            let planes: [&[f32]; OUTPUTS] =
                std::array::from_fn(|j| &self.output.plane(block * OUTPUTS + j)[origin..origin + span]);
            for i in 0..inputs {
                let input = self.input.plane(i);
                // Three taps of a row at a time, or the one there is.
                for (group, offsets) in offsets.chunks(3).enumerate() {
                    let part = |k: usize| {
                        let from = origin.wrapping_add_signed(offsets[k.min(offsets.len() - 1)]);
                        &input[from..from + span]
                    };
                    let sums = match offsets.len() {
                        3 => products::<S, 3>(simd, planes, [part(0), part(1), part(2)]),
                        _ => products::<S, 1>(simd, planes, [part(0)]).map(|[s]| [s, 0.0, 0.0]),
                    };
                    for (j, sums) in sums.iter().enumerate() {
                        let at = ((block * OUTPUTS + j) * inputs + i) * taps + group * 3;
                        for (to, v) in self.gradient[at..at + offsets.len()].iter_mut().zip(sums) {
                            *to += v;
                        }
                    }
                }
            }
        }
    }
}

/// Sums of the products of each of some lines with each of others.
#[inline(always)]
fn products<S: Simd, const N: usize>(simd: S, a: [&[f32]; OUTPUTS], b: [&[f32]; N]) -> [[f32; N]; OUTPUTS] {
    let mut sum = [[simd.splat_f32s(0.0); N]; OUTPUTS];
    let a = a.map(|line| S::as_simd_f32s(line).0);
    let b = b.map(|line| S::as_simd_f32s(line).0);
    let n = a[0].len();
    let (a, b) = (a.map(|line| &line[..n]), b.map(|line| &line[..n]));
    for p in 0..n {
        let y = b.map(|line| line[p]);
        for j in 0..OUTPUTS {
            let x = a[j][p];
            for k in 0..N {
                sum[j][k] = simd.mul_add_f32s(x, y[k], sum[j][k]);
            }
        }
    }
    sum.map(|row| row.map(|v| simd.reduce_sum_f32s(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tolerance of sums of some hundred products of order one in single precision.
    const SINGLE: f32 = 2e-5;

    fn value(k: usize) -> f32 {
        ((k * 7919 + 13) % 101) as f32 / 50.0 - 1.0
    }

    fn features(channels: usize, rows: usize, columns: usize, seed: usize) -> Features {
        let mut out = Features::zero(channels, rows, columns);
        for c in 0..channels {
            for y in 0..rows {
                for (x, v) in out.row_mut(c, y).iter_mut().enumerate() {
                    *v = value(seed + (c * rows + y) * columns + x);
                }
            }
        }
        out
    }

    /// One output by its definition.
    fn direct(shape: Shape, weights: &[f32], input: &Features, [o, y, x]: [usize; 3]) -> f32 {
        let mut sum = 0.0;
        let reach = isize::from(shape.taps == 9);
        for i in 0..shape.inputs {
            let mut t = 0;
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let (y, x) = (y as isize + dy, x as isize + dx);
                    if (0..input.rows as isize).contains(&y) && (0..input.columns as isize).contains(&x) {
                        sum += weights[(o * shape.inputs + i) * shape.taps + t] * input.row(i, y as usize)[x as usize];
                    }
                    t += 1;
                }
            }
        }
        sum
    }

    #[test]
    fn convolutions_are_what_they_say_in_one_piece_and_in_many() {
        for (shape, rows, columns) in [
            (
                Shape {
                    inputs: 5,
                    outputs: 8,
                    taps: 9,
                },
                7,
                10,
            ),
            (
                Shape {
                    inputs: 12,
                    outputs: 4,
                    taps: 1,
                },
                5,
                6,
            ),
            (
                Shape {
                    inputs: 3,
                    outputs: 4,
                    taps: 9,
                },
                70,
                90,
            ),
        ] {
            let weights: Vec<f32> = (0..shape.weights()).map(value).collect();
            let input = features(shape.inputs, rows, columns, 5);
            let packed = Packed::forward(shape, &weights);
            let (got, cut) = (packed.apply(&input, false), packed.apply(&input, true));
            for o in 0..shape.outputs {
                for y in 0..rows {
                    for x in 0..columns {
                        let want = direct(shape, &weights, &input, [o, y, x]);
                        assert!((got.row(o, y)[x] - want).abs() < SINGLE, "{o} {y} {x}");
                        assert_eq!(cut.row(o, y)[x], got.row(o, y)[x].max(0.0));
                    }
                }
            }
        }
    }

    #[test]
    fn gradients_are_adjoints() {
        for taps in [9, 1] {
            let shape = Shape {
                inputs: 8,
                outputs: 4,
                taps,
            };
            let weights: Vec<f32> = (0..shape.weights()).map(|k| value(k + 3)).collect();
            let (input, output) = (features(8, 6, 9, 1), features(4, 6, 9, 77));
            let dot = |a: &Features, b: &Features| -> f64 {
                a.values
                    .iter()
                    .zip(&b.values)
                    .map(|(a, b)| f64::from(*a) * f64::from(*b))
                    .sum()
            };
            let forward = dot(&Packed::forward(shape, &weights).apply(&input, false), &output);
            let back = dot(&Packed::backward(shape, &weights).apply(&output, false), &input);
            let mut gradient = vec![0.0; shape.weights()];
            add_weight_gradient(shape, &input, &output, &mut gradient);
            let by_weights: f64 = gradient
                .iter()
                .zip(&weights)
                .map(|(g, w)| f64::from(*g) * f64::from(*w))
                .sum();
            let tolerance = f64::from(SINGLE) * forward.abs().max(1.0);
            assert!((forward - back).abs() < tolerance, "{forward} {back}");
            assert!((forward - by_weights).abs() < tolerance, "{forward} {by_weights}");
        }
    }
}
