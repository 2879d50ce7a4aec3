//! Approximations that others make of such cameras, so that the worth of each can be stated.
//!
//! The array of Chakravarthula et al. (ACM Trans. Graph. 42, 257 (2023)) was trained on frames with one kernel for each
//! element and colour, whatever the place in its field, brightness that falls as a Butterworth filter of the angle, one
//! wavelength for each colour, no light beside the image, and nine patches of 420 x 420 pixels, each for itself.

use serde::Serialize;

/// Assumptions on the way from a scene to the frame, in place of what is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ApproximationSet {
    /// The kernel on the axis of an element holds over its whole field.
    pub fixed_kernels: bool,
    /// Light falls with the angle as `butterworth` says, and not by what elements pass and flat surfaces send.
    pub butterworth: bool,
    /// True if nothing lands outside of the kernels.
    pub no_stray_light: bool,
    /// Each element has a square of so many pixels to itself, and no light lands beside it.
    pub patch_pixels: Option<u32>,
}

impl ApproximationSet {
    /// The text of these approximations in the digest of a camera, which stands in files of sets for learning: names of fields
    /// do not decide it, so that sets are the same and go on after a change of names.
    pub(crate) fn digest_text(&self) -> String {
        format!(
            "Assumed {{ fixed_kernels: {}, butterworth: {}, no_veil: {}, patch_pixels: {:?} }}",
            self.fixed_kernels, self.butterworth, self.no_stray_light, self.patch_pixels
        )
    }

    /// All of it: the setting of the paper.
    pub fn paper() -> Self {
        Self {
            fixed_kernels: true,
            butterworth: true,
            no_stray_light: true,
            patch_pixels: Some(PATCH),
        }
    }
}

/// Angle at which the filter has lost half of the power: half of 45 degrees.
const CUTOFF_DEG: f64 = 22.5;
const ORDER: i32 = 4;
/// Pixels an axis of a patch.
pub(crate) const PATCH: u32 = 420;

/// Light under an angle from the axis of an element, whose tangent is given, over that on the axis.
pub(crate) fn butterworth(tangent: f64) -> f64 {
    (1.0 + (tangent.atan().to_degrees() / CUTOFF_DEG).powi(2 * ORDER))
        .sqrt()
        .recip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_falls_to_half_of_its_power_at_the_cutoff() {
        let at = |degrees: f64| butterworth(degrees.to_radians().tan());
        // Rounding.
        assert!((at(CUTOFF_DEG).powi(2) - 0.5).abs() < 1e-12);
        assert!(at(0.0) == 1.0 && at(15.0) > 0.97 && at(45.0) < 0.07);
    }

    #[test]
    fn the_text_of_a_digest_is_that_of_sets_on_the_disk() {
        let none = "Assumed { fixed_kernels: false, butterworth: false, no_veil: false, patch_pixels: None }";
        assert_eq!(ApproximationSet::default().digest_text(), none);
        let all = "Assumed { fixed_kernels: true, butterworth: true, no_veil: true, patch_pixels: Some(420) }";
        assert_eq!(ApproximationSet::paper().digest_text(), all);
    }
}
