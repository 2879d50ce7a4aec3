//! Transforms of images, in double precision, and the border rule: beyond its border an image goes on as its own
//! mirror image.

use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use ndarray::Array2;
use num_complex::Complex64;

/// The border rule: pixel of an axis of `n` pixels that stands for place `i`, which may be beyond its ends.
pub fn mirrored(i: i64, n: usize) -> usize {
    let n = n as i64;
    let at = i.rem_euclid(2 * n);
    at.min(2 * n - 1 - at) as usize
}

/// Transforms of images that go on periodically.
pub(crate) struct Fourier {
    size: [usize; 2],
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

impl Fourier {
    /// Transform for images of this shape.
    pub(crate) fn periodic(size: [usize; 2]) -> Self {
        Self {
            size,
            forward: size.map(forward),
            inverse: size.map(inverse),
        }
    }

    /// Frequency of element `i` of an axis of a spectrum (cycles a pixel).
    pub(crate) fn frequency(&self, axis: usize, i: usize) -> f64 {
        let n = self.size[axis];
        let signed = if 2 * i < n { i as f64 } else { i as f64 - n as f64 };
        signed / n as f64
    }

    /// Spectrum of an image.
    pub(crate) fn of_image(&self, image: &Array2<f64>) -> Array2<Complex64> {
        let mut plane = image.map(|v| Complex64::from(*v));
        Self::run(&self.forward, &mut plane);
        plane
    }

    /// The image of a spectrum.
    pub(crate) fn to_image(&self, mut spectrum: Array2<Complex64>) -> Array2<f64> {
        Self::run(&self.inverse, &mut spectrum);
        let scale = 1.0 / (self.size[0] * self.size[1]) as f64;
        spectrum.map(|v| v.re * scale)
    }

    fn run(plans: &[Arc<dyn Fft<f64>>; 2], plane: &mut Array2<Complex64>) {
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
