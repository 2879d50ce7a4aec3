//! A discrete Fourier sum onto any equidistant points, by chirps (Bluestein).

use std::sync::Arc;

use metalith_fourier::{Fft, forward, inverse};
use num_complex::{Complex32, Complex64};

use crate::kernels::{fft_size, multiply, multiply_conj, multiply_to, process};

/// `y[m] = sum_k exp(2 pi i c (first + k) (m - (outputs - 1) / 2)) x[k]`, and its adjoint.
///
/// Of the k m in the exponent, 2 k m = k^2 + m^2 - (m - k)^2 leaves a convolution with a chirp, which
/// runs on transforms of any size not below `inputs + outputs - 1`.
pub(super) struct Zoom {
    inputs: usize,
    outputs: usize,
    before: Vec<Complex32>,
    after: Vec<Complex32>,
    kernel: Vec<Complex32>,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl Zoom {
    /// `cycles` is c above, the phase of neighbouring inputs at neighbouring outputs (turns).
    pub(crate) fn new(inputs: usize, first: f64, outputs: usize, cycles: f64) -> Self {
        let size = fft_size(inputs + outputs - 1);
        let middle = 0.5 * (outputs as f64 - 1.0);
        let square = |n: f64| 0.5 * cycles * n * n;
        let before = |k: f64| single(cis64(square(k) - cycles * k * middle));
        let after = |m: f64| single(cis64(square(m) + cycles * first * (m - middle)));
        // The tables are made in double precision: what they err by, every sample of a window errs by.
        let mut kernel = vec![Complex64::ZERO; size];
        let scale = 1.0 / size as f64;
        for (n, k) in kernel.iter_mut().take(outputs).enumerate() {
            *k = cis64(-square(n as f64)) * scale;
        }
        for n in 1..inputs {
            kernel[size - n] = cis64(-square(n as f64)) * scale;
        }
        forward(size).process(&mut kernel);
        Self {
            inputs,
            outputs,
            before: (0..inputs).map(|k| before(k as f64)).collect(),
            after: (0..outputs).map(|m| after(m as f64)).collect(),
            kernel: kernel.into_iter().map(single).collect(),
            forward: forward(size),
            inverse: inverse(size),
        }
    }

    /// The sum for every output. `padded` and `fft` are working memory.
    pub(crate) fn run(
        &self,
        x: &[Complex32],
        y: &mut [Complex32],
        padded: &mut Vec<Complex32>,
        fft: &mut Vec<Complex32>,
    ) {
        padded.clear();
        padded.resize(self.kernel.len(), Complex32::ZERO);
        multiply_to(&mut padded[..self.inputs], x, &self.before);
        process(&*self.forward, padded, fft);
        multiply(padded, &self.kernel);
        process(&*self.inverse, padded, fft);
        multiply_to(y, &padded[..self.outputs], &self.after);
    }

    /// The adjoint: from outputs to inputs.
    pub(crate) fn adjoint(
        &self,
        y: &[Complex32],
        x: &mut [Complex32],
        padded: &mut Vec<Complex32>,
        fft: &mut Vec<Complex32>,
    ) {
        padded.clear();
        padded.resize(self.kernel.len(), Complex32::ZERO);
        padded[..self.outputs].copy_from_slice(y);
        multiply_conj(&mut padded[..self.outputs], &self.after);
        process(&*self.forward, padded, fft);
        multiply_conj(padded, &self.kernel);
        process(&*self.inverse, padded, fft);
        x.copy_from_slice(&padded[..self.inputs]);
        multiply_conj(x, &self.before);
    }
}

fn cis64(turns: f64) -> Complex64 {
    Complex64::cis(std::f64::consts::TAU * (turns - turns.round()))
}

fn single(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::cis;

    /// Transforms of a few hundred points in single precision.
    const TOLERANCE: f32 = 2e-5;

    #[test]
    fn is_the_sum_it_says_and_the_adjoint_is_its_own() {
        let (inputs, outputs, first, cycles) = (37, 21, -11, 0.0173);
        let zoom = Zoom::new(inputs, first as f64, outputs, cycles);
        let x: Vec<_> = (0..inputs).map(|k| cis(0.37 * (k * k) as f64)).collect();
        let g: Vec<_> = (0..outputs).map(|m| cis(0.11 * (m * m * m) as f64)).collect();
        let (mut padded, mut fft) = (Vec::new(), Vec::new());
        let mut y = vec![Complex32::ZERO; outputs];
        zoom.run(&x, &mut y, &mut padded, &mut fft);
        for (m, y) in y.iter().enumerate() {
            let want: Complex32 = (0..inputs)
                .map(|k| x[k] * cis(cycles * (first + k as i64) as f64 * (m as f64 - 10.0)))
                .sum();
            assert!((y - want).norm() < TOLERANCE, "{y} is not {want}");
        }
        let mut back = vec![Complex32::ZERO; inputs];
        zoom.adjoint(&g, &mut back, &mut padded, &mut fft);
        let dot = |a: &[Complex32], b: &[Complex32]| -> Complex32 { a.iter().zip(b).map(|(a, b)| a.conj() * b).sum() };
        assert!((dot(&g, &y) - dot(&back, &x)).norm() < TOLERANCE * outputs as f32);
    }
}
