//! Sums of spectra that move with their chief rays, in the widest registers of the machine.

use std::ops::Range;

use num_complex::Complex32;
use pulp::{Arch, Simd, WithSimd};

/// Most numbers in a register: columns begin at multiples of it.
const LANES: usize = 16;

/// The half spectrum of a real image, column by column of frequencies along y, real and imaginary parts apart.
#[derive(Clone)]
pub(super) struct SplitSpectrum {
    size: usize,
    /// Numbers from column to column; those past `size` are zero.
    stride: usize,
    real: Vec<f32>,
    imaginary: Vec<f32>,
}

impl SplitSpectrum {
    /// Columns of `size` zeros.
    pub(super) fn zero(columns: usize, size: usize) -> Self {
        let stride = size.next_multiple_of(LANES);
        Self {
            size,
            stride,
            real: vec![0.0; columns * stride],
            imaginary: vec![0.0; columns * stride],
        }
    }

    /// A spectrum whose columns have `size` frequencies.
    pub(super) fn of(spectrum: &[Complex32], size: usize) -> Self {
        let mut split = Self::zero(spectrum.len() / size, size);
        for (k, column) in spectrum.chunks_exact(size).enumerate() {
            split_into(column, split.column_mut(k));
        }
        split
    }

    /// Real and imaginary parts together again.
    pub(super) fn joined(&self) -> Vec<Complex32> {
        let columns = (self.real.chunks_exact(self.stride)).zip(self.imaginary.chunks_exact(self.stride));
        let joined = columns.flat_map(|(re, im)| re.iter().zip(im).take(self.size));
        joined.map(|(re, im)| Complex32::new(*re, *im)).collect()
    }

    fn column(&self, k: usize) -> [&[f32]; 2] {
        let at = k * self.stride..(k + 1) * self.stride;
        [&self.real[at.clone()], &self.imaginary[at]]
    }

    fn column_mut(&mut self, k: usize) -> [&mut [f32]; 2] {
        let at = k * self.stride..(k + 1) * self.stride;
        [&mut self.real[at.clone()], &mut self.imaginary[at]]
    }
}

fn split_into(values: &[Complex32], [real, imaginary]: [&mut [f32]; 2]) {
    for (value, (re, im)) in values.iter().zip(real.iter_mut().zip(imaginary)) {
        (*re, *im) = (value.re, value.im);
    }
}

/// Add the weighted sum of one to four spectra, moved by the turns of their phase along x and along y, which is one column, to each
/// sum with its weight, in some columns.
pub(super) fn add_part(
    terms: &[(&SplitSpectrum, f32)],
    columns: Range<usize>,
    (along_x, along_y): (&[Complex32], &SplitSpectrum),
    weights: &[f32],
    sums: &mut [SplitSpectrum],
) {
    let mut mixed = vec![0.0; 2 * along_y.stride];
    let (real, imaginary) = mixed.split_at_mut(along_y.stride);
    for k in columns {
        let columns: Vec<_> = terms
            .iter()
            .map(|(spectrum, weight)| (spectrum.column(k), *weight))
            .collect();
        Arch::new().dispatch(Mix {
            terms: &columns,
            along_x: along_x[k],
            along_y: along_y.column(0),
            mixed: [&mut *real, &mut *imaginary],
        });
        for (sum, weight) in sums.iter_mut().zip(weights) {
            let [sum_real, sum_imaginary] = sum.column_mut(k);
            for (sum, of) in [(sum_real, &*real), (sum_imaginary, &*imaginary)] {
                Arch::new().dispatch(AddWeighted {
                    sum,
                    of,
                    weight: *weight,
                });
            }
        }
    }
}

/// Columns of spectra, each with its weight, summed and turned.
struct Mix<'a> {
    terms: &'a [([&'a [f32]; 2], f32)],
    along_x: Complex32,
    along_y: [&'a [f32]; 2],
    mixed: [&'a mut [f32]; 2],
}

impl Mix<'_> {
    /// Variant of [`WithSimd::with_simd`] for a known number of terms: each has its registers.
    #[inline(always)]
    fn with<S: Simd, const N: usize>(self, simd: S) {
        let terms: [_; N] = std::array::from_fn(|i| {
            let ([re, im], weight) = self.terms[i];
            (S::as_simd_f32s(re).0, S::as_simd_f32s(im).0, simd.splat_f32s(weight))
        });
        let (x_re, x_im) = (simd.splat_f32s(self.along_x.re), simd.splat_f32s(self.along_x.im));
        let [y_re, y_im] = self.along_y.map(|y| S::as_simd_f32s(y).0);
        let [re, im] = self.mixed.map(|m| S::as_mut_simd_f32s(m).0);
        let n = re.len();
        let (y_re, y_im, im) = (&y_re[..n], &y_im[..n], &mut im[..n]);
        let terms = terms.map(|(re, im, weight)| (&re[..n], &im[..n], weight));
        for j in 0..n {
            let (mut sum_re, mut sum_im) = (simd.splat_f32s(0.0), simd.splat_f32s(0.0));
            for (re, im, weight) in &terms {
                sum_re = simd.mul_add_e_f32s(*weight, re[j], sum_re);
                sum_im = simd.mul_add_e_f32s(*weight, im[j], sum_im);
            }
            let turn_re = simd.sub_f32s(simd.mul_f32s(x_re, y_re[j]), simd.mul_f32s(x_im, y_im[j]));
            let turn_im = simd.mul_add_e_f32s(x_re, y_im[j], simd.mul_f32s(x_im, y_re[j]));
            re[j] = simd.sub_f32s(simd.mul_f32s(sum_re, turn_re), simd.mul_f32s(sum_im, turn_im));
            im[j] = simd.mul_add_e_f32s(sum_re, turn_im, simd.mul_f32s(sum_im, turn_re));
        }
    }
}

impl WithSimd for Mix<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.terms.len() {
            1 => self.with::<S, 1>(simd),
            2 => self.with::<S, 2>(simd),
            3 => self.with::<S, 3>(simd),
            4 => self.with::<S, 4>(simd),
            n => unreachable!("a cubic goes through four wavelengths, not {n}"),
        }
    }
}

/// Numbers added with a weight.
struct AddWeighted<'a> {
    sum: &'a mut [f32],
    of: &'a [f32],
    weight: f32,
}

impl WithSimd for AddWeighted<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let weight = simd.splat_f32s(self.weight);
        let (sum, of) = (S::as_mut_simd_f32s(self.sum).0, S::as_simd_f32s(self.of).0);
        for (sum, of) in sum.iter_mut().zip(of) {
            *sum = simd.mul_add_e_f32s(weight, *of, *sum);
        }
    }
}
