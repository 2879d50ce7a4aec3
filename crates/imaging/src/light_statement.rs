//! Statement of the light of an exposure: what a white surface gives, and what is made of it.

use metalith_report::{fixed, sig};
use metalith_sensor::Camera;
use serde::{Deserialize, Serialize};

use crate::exposure::ChosenExposure;

/// Light, time and electrons of an exposure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightStatement {
    /// Illuminance of the scene (lux); none where the light is not visible.
    pub illuminance_lux: Option<f64>,
    /// Radiance of a white surface over the wavelengths that channels count (W m^-2 sr^-1).
    pub radiance_w_m2_sr: f64,
    /// True if the camera file does not state the light.
    pub is_guess: bool,
    /// Time of the exposure (ms).
    pub time_ms: f64,
    /// True if the time was chosen for this camera.
    pub is_auto: bool,
    /// Focal length over the diameter of a circle as large as the lens; none without a lens.
    pub f_number: Option<f64>,
    /// Electrons of full scale.
    pub full_scale_e: f64,
    pub white: Vec<WhitePixel>,
}

/// The brightest pixel of a white scene in one channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WhitePixel {
    pub channel: String,
    /// Electrons that the light gives; above full scale the pixel is saturated.
    pub electrons: f64,
    /// Signal over the standard deviation of its noise; none for a sensor without noise.
    pub snr: Option<f64>,
    /// Range from the noise of reading to this pixel or to full scale (dB); none for a sensor without such noise.
    pub dynamic_range_db: Option<f64>,
}

impl LightStatement {
    /// Statement for the exposure of a camera behind a lens of an f-number.
    pub fn of(camera: &Camera, exposure: &ChosenExposure, f_number: Option<f64>) -> Self {
        let full_scale_e = camera.sensor.full_scale_e();
        let noise = camera.sensor.noise.of_exposure(exposure.time_s);
        let white = |(channel, electrons): (String, &f64)| {
            let signal = electrons / full_scale_e;
            let variance = noise.variance(signal);
            WhitePixel {
                channel,
                electrons: *electrons,
                snr: (variance > 0.0).then(|| signal / variance.sqrt()),
                dynamic_range_db: (noise.read > 0.0)
                    .then(|| 20.0 * (signal.min(camera.sensor.largest_signal()) / noise.read).log10())
                    .filter(|db| db.is_finite()),
            }
        };
        Self {
            illuminance_lux: camera.illuminance_lux(),
            radiance_w_m2_sr: camera.radiance_w_m2_sr(),
            is_guess: camera.exposure.light.level.is_none(),
            time_ms: 1e3 * exposure.time_s,
            is_auto: camera.exposure.auto,
            f_number,
            full_scale_e,
            white: camera
                .channel_names()
                .into_iter()
                .zip(&exposure.white_e)
                .map(white)
                .collect(),
        }
    }

    /// Light of the scene, in words.
    pub fn light_words(&self) -> String {
        match self.illuminance_lux {
            Some(lux) => format!("{} lux", sig(lux, 3)),
            None => format!("{} W/(m² sr) from white", sig(self.radiance_w_m2_sr, 3)),
        }
    }

    /// Light, time and f-number, in words.
    pub fn words(&self) -> String {
        let time = if self.is_auto { " ms (auto)" } else { " ms" };
        let f_number = self.f_number.map_or_else(String::new, |n| format!(", f/{}", sig(n, 3)));
        format!("{}, {}{time}{f_number}", self.light_words(), sig(self.time_ms, 3))
    }

    /// Light, time and electrons in a sentence.
    pub fn sentence(&self) -> String {
        format!(
            "Light: {}; electrons of a white pixel: {}.",
            self.words(),
            self.each(|w| Some(w.electrons), 0)
        )
    }

    /// A quantity of the white pixel of each channel, in words, with the name of the channel if there are several; a dash where there
    /// is none.
    pub fn each(&self, of: impl Fn(&WhitePixel) -> Option<f64>, digits: usize) -> String {
        let one = |w: &WhitePixel| {
            let value = of(w).map_or_else(|| "-".into(), |v| fixed(v, digits));
            match self.white.len() {
                1 => value,
                _ => format!("{} {value}", w.channel),
            }
        };
        let all: Vec<String> = self.white.iter().map(one).collect();
        all.join(", ")
    }

    /// Notes to read before the picture: light that is a guess, and a time that is too short or too long.
    pub fn notes(&self) -> Vec<String> {
        /// Share of full scale below which a white scene is dark.
        const DARK: f64 = 0.1;
        let share = self.white.iter().map(|w| w.electrons).fold(0.0, f64::max) / self.full_scale_e;
        let key = match self.illuminance_lux {
            Some(_) => "illuminance_lux",
            None => "radiance_w_m2_sr",
        };
        let guess = format!(
            "the light of the scene is a guess, {}: the camera file does not state it; add `{key}` to its [illuminant]",
            self.light_words()
        );
        let dark = format!(
            "the light is low: a white pixel has {} of full scale after {} ms",
            sig(share, 2),
            sig(self.time_ms, 3)
        );
        let bright = format!(
            "the exposure is too long: {} ms give a white pixel {} of full scale; give a shorter `time_ms`, or \"auto\"",
            sig(self.time_ms, 3),
            sig(share, 2)
        );
        [(self.is_guess, guess), (share < DARK, dark), (share > 1.0, bright)]
            .into_iter()
            .filter_map(|(holds, note)| holds.then_some(note))
            .collect()
    }
}
