//! Transforms of images, in double precision, and the border rule: beyond its border an image goes on as its own
//! mirror image.

use metalith_core::part;
use std::sync::Arc;

use ndarray::Array2;
use num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use super::fft_size;

/// The border rule: pixel of an axis of `n` pixels that stands for place `i`, which may be beyond its ends.
pub fn mirrored(i: i64, n: usize) -> usize {
    let n = n as i64;
    let at = i.rem_euclid(2 * n);
    at.min(2 * n - 1 - at) as usize
}

/// Transforms of images continued beyond their border, so that what a kernel moves across it is not the other side
/// of the image.
pub(crate) struct Fourier {
    image: [usize; 2],
    border: usize,
    size: [usize; 2],
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

impl Fourier {
    /// For images of shape `image`, continued by at least `border` pixels on every side.
    pub fn new(image: [usize; 2], border: usize) -> Self {
        Self::with_size(image, border, image.map(|n| fft_size(n + 2 * border)))
    }

    fn with_size(image: [usize; 2], border: usize, size: [usize; 2]) -> Self {
        let mut planner = FftPlanner::new();
        Self {
            image,
            border,
            size,
            forward: size.map(|n| planner.plan_fft_forward(n)),
            inverse: size.map(|n| planner.plan_fft_inverse(n)),
        }
    }

    /// For images that go on periodically, and need no size of their own.
    pub fn periodic(image: [usize; 2]) -> Self {
        Self::with_size(image, 0, image)
    }

    /// Shape of a spectrum.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Frequency of element `i` of an axis of a spectrum (cycles a pixel).
    pub fn frequency(&self, axis: usize, i: usize) -> f64 {
        let n = self.size[axis];
        let signed = if 2 * i < n { i as f64 } else { i as f64 - n as f64 };
        signed / n as f64
    }

    /// Spectrum of an image, mirrored at its border as often as it takes.
    pub fn of_image(&self, image: &Array2<f64>) -> Array2<Complex64> {
        let source = |axis: usize, i: usize| mirrored(i as i64 - self.border as i64, self.image[axis]);
        let mut plane = Array2::from_shape_fn(self.size, |(y, x)| Complex64::from(image[[source(0, y), source(1, x)]]));
        self.run(&self.forward, &mut plane);
        plane
    }

    /// Spectrum of a kernel, whose middle pixel is where a point's image has its place.
    pub fn of_kernel(&self, kernel: &Array2<f64>) -> Array2<Complex64> {
        let (rows, columns) = kernel.dim();
        let mut plane = Array2::zeros(self.size);
        for ((y, x), v) in kernel.indexed_iter() {
            let at =
                [(y, rows, 0), (x, columns, 1)].map(|(i, n, axis)| (i + self.size[axis] - n / 2) % self.size[axis]);
            plane[at] += Complex64::from(*v);
        }
        self.run(&self.forward, &mut plane);
        plane
    }

    /// The image of a spectrum, without its continuation.
    pub fn to_image(&self, mut spectrum: Array2<Complex64>) -> Array2<f64> {
        self.run(&self.inverse, &mut spectrum);
        let scale = 1.0 / (self.size[0] * self.size[1]) as f64;
        let (b, [rows, columns]) = (self.border, self.image);
        part(spectrum.view(), b..b + rows, b..b + columns).map(|v| v.re * scale)
    }

    fn run(&self, plans: &[Arc<dyn Fft<f64>>; 2], plane: &mut Array2<Complex64>) {
        plans[1].process(plane.as_slice_mut().expect("made in standard layout"));
        let mut turned = plane.t().as_standard_layout().into_owned();
        plans[0].process(turned.as_slice_mut().expect("standard layout"));
        plane.assign(&turned.t());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beyond_its_border_an_image_goes_on_as_its_mirror_image() {
        let seen: Vec<usize> = (-7..8).map(|i| mirrored(i, 3)).collect();
        assert_eq!(seen, [0, 0, 1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
        assert_eq!(mirrored(-4, 1), 0);
    }
}
