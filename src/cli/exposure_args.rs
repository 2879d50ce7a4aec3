//! Options that state light and time in place of a camera file.

use clap::Args;
use metalith::sensor::StatedExposure;

/// Light of the scene and time of the exposure.
#[derive(Args)]
pub(crate) struct ExposureArgs {
    /// Illuminance of the scene (lux); what the camera file states if left out.
    #[arg(long, value_parser = light_of, value_name = "LUX", allow_negative_numbers = true)]
    lux: Option<f64>,

    /// Time of the exposure (ms); what the camera file states if left out.
    #[arg(long, value_parser = time_of, value_name = "MS", allow_negative_numbers = true)]
    time_ms: Option<f64>,

    /// Longest time (ms) of an exposure that ends when a white pixel is bright, as `time_ms = "auto"`; not with --time-ms.
    #[arg(long, value_parser = time_of, value_name = "MS", conflicts_with = "time_ms", allow_negative_numbers = true)]
    longest_ms: Option<f64>,
}

impl ExposureArgs {
    /// What the options state.
    pub(crate) fn stated(&self) -> StatedExposure {
        StatedExposure {
            lux: self.lux,
            time_ms: self.time_ms,
            longest_ms: self.longest_ms,
        }
    }
}

/// A number within limits.
fn within(text: &str, limits: std::ops::RangeInclusive<f64>, unit: &str) -> std::result::Result<f64, String> {
    let number = text.parse().ok().filter(|v| limits.contains(v));
    number.ok_or_else(|| format!("give a number from {} to {} {unit}", limits.start(), limits.end()))
}

pub(crate) fn light_of(text: &str) -> std::result::Result<f64, String> {
    within(text, StatedExposure::LUX, "lux")
}

fn time_of(text: &str) -> std::result::Result<f64, String> {
    within(text, StatedExposure::TIMES_MS, "ms")
}
