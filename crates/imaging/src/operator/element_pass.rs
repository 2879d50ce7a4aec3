//! Light through one element, from planes of the scene to its sub-images, and back.

use std::borrow::Cow;

use metalith_wave::kernels::FftScratch;
use ndarray::Array2;
use num_complex::Complex32;

use super::element::{ElementOperator, NodePlan};
use super::inner_loops::{Rectangle, multiply_add, multiply_conj_add};
use super::sub_image::SubImage;

/// The rectangles of a node in its channel's sub-image: where light is cut out, and where its kernels spread it to, in an
/// image with `reach` more cells on each side.
fn rectangles(node: &NodePlan, columns: usize, reach: usize) -> [Rectangle; 2] {
    let cut = Rectangle {
        first: node.first,
        shape: node.shape,
        columns,
    };
    let spread = Rectangle {
        shape: node.shape.map(|s| s + 2 * reach),
        columns: columns + 2 * reach,
        ..cut
    };
    [cut, spread]
}

impl ElementOperator<'_> {
    /// The sub-images of planes of the scene.
    pub(crate) fn apply(&self, scene: &[Array2<f32>], scratch: &mut FftScratch) -> Vec<SubImage> {
        let (reach, step) = (self.source.reach(), self.source.points.frame_step());
        let mut images = Vec::new();
        for (channel, plan) in self.channels.iter().enumerate() {
            let warps = self.warps(channel, plan);
            let (inputs, phases) = (self.source.inputs(channel), self.source.phases(channel));
            let planes: Vec<_> = inputs.iter().map(|(input, _)| &scene[*input]).collect();
            // By point and input.
            let sampled: Vec<Vec<Vec<f32>>> = warps.iter().map(|warp| warp.sample(&planes)).collect();
            let wide = warps[0].pixels(step, [0; 2], reach).shape;
            let (size, entries) = (plan.fft.size(), plan.fft.entries());
            let mut own = vec![vec![0.0f32; wide[0] * wide[1]]; phases.len()];
            let mut square = vec![0.0; size * size];
            let mut spectrum = vec![Complex32::ZERO; entries];
            let mut sums = vec![vec![Complex32::ZERO; entries]; phases.len()];
            for node in &plan.nodes {
                let [cut, spread] = rectangles(node, warps[0].shape[1], reach);
                let mut weights: Vec<Option<Cow<'_, [f32]>>> = vec![None; warps.len()];
                let mut lit = false;
                for (k, light) in Self::lights(node, inputs.len(), warps.len()).iter().enumerate() {
                    let own = sampled[light.point].iter().zip(&light.weights);
                    let own = own.filter(|(image, weight)| **weight != 0.0 && cut.is_lit(image));
                    let own: Vec<(&[f32], f32)> = own.map(|(image, weight)| (&image[..], *weight)).collect();
                    if own.is_empty() {
                        continue;
                    }
                    if !lit {
                        sums.iter_mut().for_each(|s| s.fill(Complex32::ZERO));
                        lit = true;
                    }
                    let point = light.point;
                    let weights = weights[point].get_or_insert_with(|| node.weights(&warps[point], &self.source));
                    cut.cut(&own, weights, &mut square, size);
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
                    plan.fft.inverse(sum, &mut square, spread.shape[0], scratch);
                    spread.add(&square, size, image);
                }
            }
            images.extend(phases.iter().zip(own).map(|(phase, mut light)| {
                let grid = warps[0].pixels(step, *phase, reach);
                self.accept(&grid, &mut light);
                SubImage { channel, grid, light }
            }));
        }
        images
    }

    /// The adjoint of [`ElementOperator::apply`]: from frames by channel to planes of the scene.
    pub(crate) fn adjoint(
        &self,
        frames: &[Array2<f32>],
        shape: (usize, usize),
        inputs: usize,
        scratch: &mut FftScratch,
    ) -> Vec<Array2<f32>> {
        let (reach, step) = (self.source.reach(), self.source.points.frame_step());
        let mut planes = vec![Array2::zeros(shape); inputs];
        for (channel, plan) in self.channels.iter().enumerate() {
            let warps = self.warps(channel, plan);
            let (own, phases) = (self.source.inputs(channel), self.source.phases(channel));
            let (size, entries) = (plan.fft.size(), plan.fft.entries());
            let gather = |phase: &[usize; 2]| self.counted(&warps[0].pixels(step, *phase, reach), &frames[channel]);
            let images: Vec<Vec<f32>> = phases.iter().map(gather).collect();
            let [rows, columns] = warps[0].shape;
            // By point and input.
            let mut gathered = vec![vec![vec![0.0f32; rows * columns]; own.len()]; warps.len()];
            let mut square = vec![0.0; size * size];
            let mut spectra = vec![vec![Complex32::ZERO; entries]; phases.len()];
            let mut product = vec![Complex32::ZERO; entries];
            for node in &plan.nodes {
                let [cut, spread] = rectangles(node, columns, reach);
                if !images.iter().any(|image| spread.is_lit(image)) {
                    continue;
                }
                for (image, spectrum) in images.iter().zip(&mut spectra) {
                    spread.copy(image, &mut square, size);
                    plan.fft.forward(&mut square, spread.shape[0], spectrum, scratch);
                }
                for (k, light) in Self::lights(node, own.len(), warps.len()).iter().enumerate() {
                    product.fill(Complex32::ZERO);
                    for (phase, spectrum) in spectra.iter().enumerate() {
                        let kernel = self.kernel(channel, plan, node, (k, warps.len()), phase, scratch);
                        multiply_conj_add(&mut product, spectrum, &kernel);
                    }
                    plan.fft.inverse(&mut product, &mut square, node.shape[0], scratch);
                    let over = node.weights(&warps[light.point], &self.source);
                    let own = gathered[light.point].iter_mut().zip(&light.weights);
                    for (to, weight) in own.filter(|(_, weight)| **weight != 0.0) {
                        cut.paste(&square, size, *weight, &over, to);
                    }
                }
            }
            // A channel's inputs follow one another.
            let seen = own[0].0..own[0].0 + own.len();
            for (warp, light) in warps.iter().zip(&gathered) {
                let light: Vec<&[f32]> = light.iter().map(|l| &l[..]).collect();
                warp.scatter(&light, &mut planes[seen.clone()]);
            }
        }
        planes
    }
}
