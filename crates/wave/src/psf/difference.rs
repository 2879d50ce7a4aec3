//! Difference of two PSFs.

use super::Psf;
use crate::error::{Result, WaveError};

impl Psf {
    /// Root mean square difference from `reference`, over the root mean square of `reference`.
    ///
    /// # Errors
    /// If the windows differ in their samples.
    pub fn difference(&self, reference: &Self) -> Result<f64> {
        self.compare(reference, 1.0)
    }

    /// Difference in shape alone, with both PSFs brought to the same energy.
    ///
    /// # Errors
    /// If the windows differ in their samples.
    pub fn shape_difference(&self, reference: &Self) -> Result<f64> {
        self.compare(reference, reference.values.sum() / self.values.sum())
    }

    fn compare(&self, reference: &Self, scale: f64) -> Result<f64> {
        if self.values.dim() != reference.values.dim() || self.window.step_um != reference.window.step_um {
            return Err(WaveError::Samples);
        }
        let pairs = self.values.iter().zip(&reference.values);
        let squares: f64 = pairs.map(|(a, b)| (a * scale - b).powi(2)).sum();
        let norm: f64 = reference.values.iter().map(|b| b * b).sum();
        Ok((squares / norm).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{AT, SIGMA, gaussian};
    use super::*;

    /// Rounding of sums over 4096 samples.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn differences_count_scale_or_leave_it_out() {
        let psf = gaussian(SIGMA, AT);
        let brighter = Psf {
            values: &psf.values * 1.1,
            ..psf.clone()
        };
        assert!((brighter.difference(&psf).unwrap() - 0.1).abs() < ROUNDING);
        assert!(brighter.shape_difference(&psf).unwrap() < ROUNDING);
        // Another width changes the PSF by more than a tenth of its peak: the measure is not blind to shape.
        const UNLIKE: f64 = 0.1;
        assert!(psf.difference(&gaussian(2.0, AT)).unwrap() > UNLIKE);
        let mut coarse = psf.clone();
        coarse.window.step_um = 1.0;
        assert!(coarse.difference(&psf).is_err());
    }
}
