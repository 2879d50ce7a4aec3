//! The Wiener filter at one frequency.

use num_complex::Complex64;

/// The linear filter of least expected square error at one frequency,
/// W = conj(mean H) S / (mean |H|^2 S + N): Wiener's for a blur H that is known, the best one for all where one of
/// several acts, each as likely as the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wiener {
    signal: f64,
    total: f64,
}

impl Wiener {
    /// Filter from the mean |H|^2 of the blurs and the powers S of the scene and N of the noise.
    pub(crate) fn new(blur_power: f64, signal: f64, noise: f64) -> Self {
        Self {
            signal,
            total: (blur_power * signal + noise).max(f64::MIN_POSITIVE),
        }
    }

    /// Share of the scene's power that is restored; the expected square error is S (1 - share).
    pub(crate) fn restored(&self, blur: Complex64) -> f64 {
        blur.norm_sqr() * self.signal / self.total
    }

    /// Expected power of what is seen, mean |H|^2 S + N.
    pub(crate) fn seen(&self) -> f64 {
        self.total
    }
}
