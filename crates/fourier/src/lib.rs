//! Plans of Fourier transforms of lines, compiled once.
//!
//! A planner of `rustfft` is generic: a crate that makes one compiles each kind of transform for each set of vector
//! instructions anew, which took half a minute a crate. The functions here are not generic. What they return is the
//! trait of `rustfft`, so that nothing else of it is compiled where a plan is used.

use std::sync::Arc;

use realfft::RealFftPlanner;
use rustfft::{FftDirection, FftNum, FftPlanner};

pub use realfft::{ComplexToReal, RealToComplex};
pub use rustfft::Fft;

/// Precision of transforms: `f32` or `f64`.
pub trait Precision: FftNum {
    /// Plan of a transform of `n` values.
    fn plan(n: usize, direction: FftDirection) -> Arc<dyn Fft<Self>>;
}

impl Precision for f32 {
    #[inline(never)]
    fn plan(n: usize, direction: FftDirection) -> Arc<dyn Fft<Self>> {
        FftPlanner::new().plan_fft(n, direction)
    }
}

impl Precision for f64 {
    #[inline(never)]
    fn plan(n: usize, direction: FftDirection) -> Arc<dyn Fft<Self>> {
        FftPlanner::new().plan_fft(n, direction)
    }
}

/// Plan of the forward transform X(k) = sum over m of x(m) exp(-2 pi i k m / n) of `n` values.
pub fn forward<T: Precision>(n: usize) -> Arc<dyn Fft<T>> {
    T::plan(n, FftDirection::Forward)
}

/// Plan of the inverse transform of `n` values, with the other sign. It is not normalised: after the forward one it multiplies by n.
pub fn inverse<T: Precision>(n: usize) -> Arc<dyn Fft<T>> {
    T::plan(n, FftDirection::Inverse)
}

/// Plan of the forward transform of `n` real values, whose result is its first n / 2 + 1 values.
#[inline(never)]
pub fn real_forward(n: usize) -> Arc<dyn RealToComplex<f32>> {
    RealFftPlanner::new().plan_fft_forward(n)
}

/// Plan of the inverse transform to `n` real values, from its first n / 2 + 1 values.
#[inline(never)]
pub fn real_inverse(n: usize) -> Arc<dyn ComplexToReal<f32>> {
    RealFftPlanner::new().plan_fft_inverse(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::num_complex::Complex64;

    /// Sums of some ten values of size one in double precision.
    const ROUNDING: f64 = 1e-13;

    #[test]
    fn transforms_are_their_sums() {
        let values: Vec<Complex64> = (0..12)
            .map(|m| Complex64::new(f64::from(m * m % 7), f64::from(m)))
            .collect();
        for (plan, sign) in [(forward::<f64>(12), -1.0), (inverse::<f64>(12), 1.0)] {
            let mut found = values.clone();
            plan.process(&mut found);
            for (k, found) in found.iter().enumerate() {
                let turn = |m: usize| Complex64::cis(sign * std::f64::consts::TAU * (k * m) as f64 / 12.0);
                let sum: Complex64 = values.iter().enumerate().map(|(m, v)| v * turn(m)).sum();
                assert!((sum - found).norm() < ROUNDING * 100.0, "{k}: {sum} {found}");
            }
        }
    }
}
