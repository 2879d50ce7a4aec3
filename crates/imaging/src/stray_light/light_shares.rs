//! Shares of the light by destination.

use serde::{Deserialize, Serialize};

/// Shares by destination of the light that arrives at all elements from a white scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LightShares {
    /// Light that arrives, of any scale.
    pub arrives: f64,
    /// Share that kernels hold, on or off the sensor.
    pub in_kernels: f64,
    /// Share on the sensor, outside of kernels.
    pub stray_light: f64,
    /// Share in the sensor's plane or beyond that no pixel counts: beside the sensor, behind walls, or lost by its angle.
    pub beyond: f64,
    /// Held in frequencies that do not travel.
    pub evanescent: f64,
    /// Undiffracted: a part of the stray light and of what lands beyond.
    pub zero_order: f64,
    /// Reflected or absorbed, or diffracted into the glass.
    pub not_passed: f64,
}

impl LightShares {
    /// Add the light of others, times a weight.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.arrives += weight * other.arrives;
        self.in_kernels += weight * other.in_kernels;
        self.stray_light += weight * other.stray_light;
        self.beyond += weight * other.beyond;
        self.evanescent += weight * other.evanescent;
        self.zero_order += weight * other.zero_order;
        self.not_passed += weight * other.not_passed;
    }

    /// The sum of those of several spectra.
    pub fn sum<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut sum = Self::default();
        all.into_iter().for_each(|s| sum.add(s, 1.0));
        sum
    }
}
