//! Exposure: the amount of light that a camera lets in.

use std::ops::RangeInclusive;

use metalith_core::document::{Limits, Section};
use metalith_core::{Error, Result};
use serde::{Deserialize, Serialize};

use crate::photometry::ASSUMED_REFLECTANCE;
use crate::{LightLevel, SceneLight, Sensor};

/// Amount of light that a camera lets in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exposure {
    /// Time (s); with `auto` the longest.
    pub time_s: f64,
    /// True if each camera takes the time after which the brightest pixel of a white scene has the signal `white`.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub auto: bool,
    /// Signal of a white surface of the scene, of full scale, where the time is chosen by it.
    pub white: f64,
    /// Light of the scene.
    #[serde(skip_serializing_if = "SceneLight::is_unstated")]
    pub light: SceneLight,
}

/// Light and time that a command states in place of a camera file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatedExposure {
    /// Illuminance of the scene (lux).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lux: Option<f64>,
    /// Time of the exposure (ms).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_ms: Option<f64>,
    /// Longest time (ms) of exposures whose time each camera chooses by its light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest_ms: Option<f64>,
}

impl StatedExposure {
    /// Illuminances that may be stated (lux).
    pub const LUX: RangeInclusive<f64> = 1e-6..=1e9;
    /// Times of an exposure (ms).
    pub const TIMES_MS: RangeInclusive<f64> = 1e-3..=1e6;

    /// Numbers must be those of a light and a time.
    ///
    /// # Errors
    /// If one is out of its range, or two times are stated.
    pub(crate) fn check(&self) -> Result<()> {
        if self.time_ms.is_some() && self.longest_ms.is_some() {
            return Err(Error::refused(
                "camera/two-times",
                "a time of the exposure, and a longest one",
                "give one of them",
            ));
        }
        let all = [
            (self.lux, Self::LUX, "an illuminance", "lux"),
            (self.time_ms, Self::TIMES_MS, "a time", "ms"),
            (self.longest_ms, Self::TIMES_MS, "a longest time", "ms"),
        ];
        for (value, limits, what, unit) in all {
            if let Some(value) = value.filter(|v| !limits.contains(v)) {
                return Err(Error::refused(
                    "camera/exposure-out-of-range",
                    format!("{what} of {value} {unit}"),
                    format!("give a number from {} to {} {unit}", limits.start(), limits.end()),
                ));
            }
        }
        Ok(())
    }

    /// True if nothing is stated.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Longest time of an exposure that is chosen, if the file says nothing (ms).
const LONGEST_MS: f64 = 1000.0;

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
    /// What of this decides frames but for their dark current: with `auto` the brightness alone, whatever the light and the
    /// time. Files of 10 ms were exposed by brightness before there was `auto`, and what was made for them still holds.
    #[must_use]
    pub fn of_brightness(&self) -> Self {
        const STATED_S: f64 = 0.01;
        if self.auto {
            Self {
                time_s: STATED_S,
                auto: false,
                white: self.white,
                light: SceneLight::unstated(),
            }
        } else {
            *self
        }
    }

    /// Reads the exposure from its section, for a sensor that must be able to hold it, and the amount of light from the section of
    /// the illuminant.
    pub(crate) fn read(
        s: &Section<'_, '_>,
        illuminant: &Section<'_, '_>,
        sensor_section: &Section<'_, '_>,
        sensor: &Sensor,
    ) -> Self {
        let auto = s.is_one_of("time_ms", &["auto"]);
        let longest_ms = s.optional_float("longest_ms", Limits::new(StatedExposure::TIMES_MS, "ms"));
        let time_ms = if auto {
            s.choice("time_ms", &[("auto", ())], None);
            longest_ms.unwrap_or(LONGEST_MS)
        } else {
            s.float("time_ms", Limits::new(StatedExposure::TIMES_MS, "ms"))
        };
        if longest_ms.is_some() && !auto && s.sound(&["exposure.time_ms"]) {
            s.fault(
                "longest_ms",
                "a time that is stated has no longest one",
                "remove it, or give `time_ms = \"auto\"`",
            );
        }
        let exposure = Self {
            time_s: time_ms * 1e-3,
            auto,
            light: SceneLight::read(illuminant),
            white: s.float_or("white", Limits::new(1e-6..=1.0, "of full scale"), 0.9),
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

impl SceneLight {
    /// True if the file says nothing of the light.
    fn is_unstated(&self) -> bool {
        *self == Self::unstated()
    }

    /// Reads the amount of light from the section of the illuminant.
    fn read(s: &Section<'_, '_>) -> Self {
        let lux = s.optional_float("illuminance_lux", Limits::new(1e-6..=1e9, "lux"));
        let radiance = s.optional_float("radiance_w_m2_sr", Limits::new(1e-12..=1e9, "W m^-2 sr^-1"));
        let reflectance = s.optional_float("reflectance", Limits::new(1e-3..=1.0, "of the light"));
        if lux.is_some() && radiance.is_some() {
            s.fault(
                "radiance_w_m2_sr",
                "the light is stated twice: in lux and as a radiance",
                "keep one of `illuminance_lux` and `radiance_w_m2_sr`",
            );
        }
        if reflectance.is_some() && radiance.is_some() {
            s.fault(
                "reflectance",
                "a radiance is the light of the white surface itself",
                "remove it, or give `illuminance_lux` instead of the radiance",
            );
        }
        Self {
            level: lux
                .map(LightLevel::IlluminanceLux)
                .or(radiance.map(LightLevel::RadianceWM2Sr)),
            reflectance: reflectance.unwrap_or(ASSUMED_REFLECTANCE),
        }
    }
}
