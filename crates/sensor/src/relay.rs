//! The camera of a bench: a sensor behind a relay.

use crate::{ColourFilter, Noise};

/// A mean of frames this near to saturation contains clipped frames.
pub const SATURATED: f64 = 0.97;

/// The camera behind its relay, in units of the sensor plane.
#[derive(Clone, Copy, Debug)]
pub struct RelayCamera {
    pub pixel_um: f64,
    pub rows: usize,
    pub cols: usize,
    pub black_level_dn: f64,
    pub gain_e_per_dn: f64,
    pub read_noise_dn: f64,
    pub saturation_dn: f64,
    /// Standard deviation of where a window is, along each axis (pixels).
    pub registration_sigma_px: f64,
    /// Relative standard deviation of the DN scale of each LED.
    pub flux_sigma: f64,
    /// Standard deviation of the relay's own Gaussian blur (um).
    pub relay_blur_um: f64,
    /// Filter over the pixels.
    pub filter: ColourFilter,
}

impl RelayCamera {
    /// Mean of a pixel from which on it was clipped in some of its frames (DN).
    pub fn full_dn(&self) -> f64 {
        SATURATED * self.saturation_dn
    }

    /// Variance of a pixel as recorded (DN^2) in the mean of so many frames: shot noise of this signal above the black level (DN),
    /// and read noise.
    pub fn variance_dn2(&self, signal_dn: f64, frames: u32) -> f64 {
        Noise::of_dn(self.gain_e_per_dn, self.read_noise_dn).variance(signal_dn) / f64::from(frames)
    }

    /// Electrons that the mean of so many frames rests on where it shows this signal above black (DN): those of the light, and as
    /// many as would scatter like the read noise.
    pub fn electrons(&self, signal_dn: f64, frames: u32) -> f64 {
        self.gain_e_per_dn.powi(2) * f64::from(frames).powi(2) * self.variance_dn2(signal_dn, frames)
    }
}
