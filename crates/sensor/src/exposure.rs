//! Exposure: the amount of light that a camera lets in.

use metalith_core::document::{Limits, Section};
use serde::Serialize;

use crate::Sensor;

/// Amount of light that a camera lets in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exposure {
    /// Time (s).
    pub time_s: f64,
    /// Signal of a white surface of the scene, of full scale.
    pub white: f64,
}

/// Keys that decide whether a white surface is within the largest signal of a sensor.
const SIGNAL: [&str; 6] = [
    "exposure.white",
    "sensor.bits",
    "sensor.gain_e",
    "sensor.full_well_e",
    "sensor.noise_photon",
    "sensor.noise_read",
];

impl Exposure {
    /// Reads the exposure from its section, for a sensor that must be able to hold it.
    pub(crate) fn read(s: &Section<'_, '_>, sensor_section: &Section<'_, '_>, sensor: &Sensor) -> Self {
        let exposure = Self {
            time_s: s.float("time_ms", Limits::new(1e-3..=1e6, "ms")) * 1e-3,
            white: s
                .optional_float("white", Limits::new(1e-6..=1.0, "of full scale"))
                .unwrap_or(0.9),
        };
        s.finish();
        let (white, full_e, largest) = (exposure.white, sensor.full_scale_e(), sensor.largest_signal());
        // A step of slack: the last one of a sensor whose steps are the whole of its well is below full scale.
        if white > largest + sensor.step() && s.sound(&SIGNAL) {
            let (section, key) = if s.has("white") {
                (s, "white")
            } else {
                (sensor_section, "gain_e")
            };
            section.fault(
                key,
                format!(
                    "most of a picture would be at its limit: a white surface has {white} of full scale, {:.0} electrons, and pixel values end at {:.0}",
                    white * full_e,
                    largest * full_e
                ),
                format!(
                    "give a smaller `white`, or a `gain_e` of {:.4} electrons a step and more",
                    sensor.gain_e * white / largest
                ),
            );
        }
        exposure
    }
}
