//! The innermost loops: over light, hats and spectra, in the widest registers of the machine.

use num_complex::Complex32;
use pulp::{Arch, Simd, WithSimd};

/// Adds the products of `a` and `b`.
pub(crate) fn multiply_add(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    Arch::new().dispatch(Products::<false> { sum, a, b });
}

/// Adds the products of `a` with the conjugates of `b`.
pub(crate) fn multiply_conj_add(sum: &mut [Complex32], a: &[Complex32], b: &[Complex32]) {
    Arch::new().dispatch(Products::<true> { sum, a, b });
}

struct Products<'a, const CONJUGATE: bool> {
    sum: &'a mut [Complex32],
    a: &'a [Complex32],
    b: &'a [Complex32],
}

impl<const CONJUGATE: bool> WithSimd for Products<'_, CONJUGATE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (sums, sum) = S::as_mut_simd_c32s(self.sum);
        let (first, a) = S::as_simd_c32s(self.a);
        let (second, b) = S::as_simd_c32s(self.b);
        for ((s, a), b) in sums.iter_mut().zip(first).zip(second) {
            *s = if CONJUGATE {
                simd.conj_mul_add_e_c32s(*b, *a, *s)
            } else {
                simd.mul_add_e_c32s(*a, *b, *s)
            };
        }
        for ((s, a), b) in sum.iter_mut().zip(a).zip(b) {
            *s += a * if CONJUGATE { b.conj() } else { *b };
        }
    }
}

/// A rectangle of an image of many columns.
#[derive(Clone, Copy)]
pub(crate) struct Rectangle {
    pub first: [usize; 2],
    pub shape: [usize; 2],
    /// Columns of the image.
    pub columns: usize,
}

impl Rectangle {
    /// Range of one of its rows in the image.
    fn row(&self, y: usize) -> std::ops::Range<usize> {
        let at = (self.first[0] + y) * self.columns + self.first[1];
        at..at + self.shape[1]
    }

    /// True if an image has any light in it.
    pub(crate) fn is_lit(&self, image: &[f32]) -> bool {
        (0..self.shape[0]).any(|y| image[self.row(y)].iter().any(|v| *v != 0.0))
    }

    /// Copy it into the corner of a square of `size` columns.
    pub(crate) fn copy(&self, image: &[f32], square: &mut [f32], size: usize) {
        for (y, to) in square.chunks_exact_mut(size).take(self.shape[0]).enumerate() {
            to[..self.shape[1]].copy_from_slice(&image[self.row(y)]);
            to[self.shape[1]..].fill(0.0);
        }
    }

    /// Add the corner of a square of `size` columns to it.
    pub(crate) fn add(&self, square: &[f32], size: usize, image: &mut [f32]) {
        Arch::new().dispatch(|| {
            for (y, from) in square.chunks_exact(size).take(self.shape[0]).enumerate() {
                image[self.row(y)].iter_mut().zip(from).for_each(|(t, f)| *t += f);
            }
        });
    }

    /// Weighted sum of images times hats, into the corner of a square of `size` columns. Rows below the corner are left as they
    /// are.
    pub(crate) fn cut(&self, images: &[(&[f32], f32)], hats: &[f32], square: &mut [f32], size: usize) {
        Arch::new().dispatch(|| {
            let rows = square.chunks_exact_mut(size).zip(hats.chunks_exact(self.shape[1]));
            for (y, (to, hats)) in rows.enumerate() {
                let (to, beyond) = to.split_at_mut(self.shape[1]);
                beyond.fill(0.0);
                to.fill(0.0);
                for (image, weight) in images {
                    let from = &image[self.row(y)];
                    to.iter_mut().zip(from).for_each(|(t, f)| *t += weight * f);
                }
                to.iter_mut().zip(hats).for_each(|(t, h)| *t *= h);
            }
        });
    }

    /// The adjoint of [`Rectangle::cut`] for one image.
    pub(crate) fn paste(&self, square: &[f32], size: usize, weight: f32, hats: &[f32], image: &mut [f32]) {
        Arch::new().dispatch(|| {
            let rows = square.chunks_exact(size).zip(hats.chunks_exact(self.shape[1]));
            for (y, (from, hats)) in rows.enumerate() {
                let to = image[self.row(y)].iter_mut();
                to.zip(from.iter().zip(hats))
                    .for_each(|(t, (f, h))| *t += weight * f * h);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_complex_numbers() {
        let value = |k: usize, i: usize| Complex32::new(((i * k) % 7) as f32 - 3.0, ((i + k) % 5) as f32 - 2.0);
        let [a, b]: [Vec<_>; 2] = [3, 4].map(|k| (0..21).map(|i| value(k, i)).collect());
        let start = vec![Complex32::new(1.0, -1.0); 21];
        let [mut plain, mut conjugate] = [start.clone(), start];
        multiply_add(&mut plain, &a, &b);
        multiply_conj_add(&mut conjugate, &a, &b);
        for i in 0..21 {
            // Whole numbers.
            assert_eq!(plain[i], Complex32::new(1.0, -1.0) + a[i] * b[i]);
            assert_eq!(conjugate[i], Complex32::new(1.0, -1.0) + a[i] * b[i].conj());
        }
    }

    #[test]
    fn what_is_pasted_is_the_adjoint_of_what_is_cut() {
        let (columns, size) = (11, 8);
        let rectangle = Rectangle {
            first: [2, 3],
            shape: [4, 5],
            columns,
        };
        let image: Vec<f32> = (0..7 * columns).map(|i| ((i * 5) % 9) as f32).collect();
        let hats: Vec<f32> = (0..20).map(|i| (i % 4) as f32).collect();
        let other: Vec<f32> = (0..size * size).map(|i| ((i * 3) % 7) as f32).collect();
        let mut square = vec![0.0; size * size];
        rectangle.cut(&[(&image, 2.0)], &hats, &mut square, size);
        let forward: f32 = square.iter().zip(&other).map(|(a, b)| a * b).sum();
        let mut back = vec![0.0; image.len()];
        rectangle.paste(&other, size, 2.0, &hats, &mut back);
        let adjoint: f32 = back.iter().zip(&image).map(|(a, b)| a * b).sum();
        // Sums of whole numbers.
        assert_eq!(forward, adjoint);
        assert!(forward > 0.0 && rectangle.is_lit(&image));
        rectangle.copy(&image, &mut square, size);
        let mut twice = image.clone();
        rectangle.add(&square, size, &mut twice);
        assert_eq!(twice[2 * columns + 3], 2.0 * image[2 * columns + 3]);
        assert_eq!(twice[2 * columns + 8], image[2 * columns + 8]);
    }
}
