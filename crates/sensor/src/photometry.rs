//! The photometric chain: from the light on a scene to the electrons of a pixel.
//!
//! A white surface of reflectance rho in an illuminance E (lux) has the luminance rho E / pi, whatever it is looked at from
//! (Lambert). Its spectral radiance is s P(lambda), where P is the relative power of the illuminant and s follows from
//! rho E / pi = K_m s Int P V (CIE 018:2019). A channel that counts `eta` electrons a photon counts
//! s P eta lambda / (h c) electrons for each second, nm, square metre and steradian. Behind a lens of area A at a distance z from its sensor a
//! pixel of area a at the angle theta receives the etendue a A cos^4 theta / z^2, so that on the axis of a lens of
//! transmission tau and f-number N the illuminance of the sensor is pi L tau / (4 N^2) (the camera equation, Smith, Modern
//! Optical Engineering, 4th ed., section 8.7).

use serde::Serialize;

use crate::{Camera, Illuminant, lagrange};

/// Luminous efficacy of light of 540 THz (lm/W), by definition of the candela.
const EFFICACY_LM_W: f64 = 683.0;
/// Planck's constant times the speed of light (J m), exact in the SI.
const PLANCK_LIGHT_J_M: f64 = 6.626_070_15e-34 * 299_792_458.0;
/// Step of integrals over wavelength (nm): half of the width of the narrowest diode.
const STEP_NM: f64 = 0.05;
/// Least luminous efficacy of light that is stated in lux (lm/W): 1e-3 of green light's is at 720 nm.
const LEAST_LM_W: f64 = 0.5;
/// Illuminance that is assumed of a file that states no light (lux): an office or a living room by day.
const ASSUMED_LUX: f64 = 500.0;
/// Radiance of a white surface that is assumed where nobody sees the light (W m^-2 sr^-1): as much as 500 lux of daylight give.
const ASSUMED_W_M2_SR: f64 = 1.0;
/// Reflectance that is assumed of white: paper.
pub(crate) const ASSUMED_REFLECTANCE: f64 = 0.9;

/// Light of a white surface of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneLight {
    /// Amount of light; `None` if the file does not state it, which is a guess then.
    pub level: Option<LightLevel>,
    /// Reflectance of a surface that is white in scenes.
    pub reflectance: f64,
}

/// Amount of light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LightLevel {
    /// Illuminance of the scene (lux).
    IlluminanceLux(f64),
    /// Radiance of a white surface over the wavelengths from the first to the last that a channel counts (W m^-2 sr^-1).
    RadianceWM2Sr(f64),
    /// Light that stands for other light, of which a camera counts as much.
    StandingFor {
        /// Spectral radiance of a white surface where the illuminant is one (W m^-2 sr^-1 nm^-1).
        spectral: f64,
        /// Illuminance of the other light (lux), if that is seen.
        lux: Option<f64>,
        /// Radiance of a white surface in the other light (W m^-2 sr^-1).
        radiance: f64,
    },
}

impl SceneLight {
    /// Light that a file does not state.
    pub const fn unstated() -> Self {
        Self {
            level: None,
            reflectance: ASSUMED_REFLECTANCE,
        }
    }
}

/// Luminous efficiency V of light of a wavelength (nm) for the CIE 1924 photopic observer (CIE 018:2019, every 10 nm; between
/// these the cubic of the logarithms). The fits of [`crate::observer`] err by 0.01, a fifth of V at 455 nm.
pub fn luminous_efficiency(nm: f64) -> f64 {
    const FIRST_NM: f64 = 380.0;
    const V: [f64; 40] = [
        3.9e-5, 1.2e-4, 3.96e-4, 1.21e-3, 4e-3, 0.0116, 0.023, 0.038, 0.06, 0.090_98, 0.139_02, 0.208_02, 0.323, 0.503,
        0.71, 0.862, 0.954, 0.994_95, 0.995, 0.952, 0.87, 0.757, 0.631, 0.503, 0.381, 0.265, 0.175, 0.107, 0.061,
        0.032, 0.017, 8.21e-3, 4.102e-3, 2.091e-3, 1.047e-3, 5.2e-4, 2.492e-4, 1.2e-4, 6e-5, 3e-5,
    ];
    let place = (nm - FIRST_NM) / 10.0;
    if !(0.0..=(V.len() - 1) as f64).contains(&place) {
        return 0.0;
    }
    let start = (place as usize).saturating_sub(1).min(V.len() - 4);
    let log = |i: usize| V[start + i].ln() * lagrange(i, 4, place - start as f64);
    (0..4).map(log).sum::<f64>().exp()
}

impl Camera {
    /// Spectral radiance of a white surface where the illuminant is one (W m^-2 sr^-1 nm^-1).
    pub fn spectral_radiance(&self) -> f64 {
        let light = &self.exposure.light;
        match light.level.unwrap_or_else(|| self.assumed_level()) {
            LightLevel::IlluminanceLux(lux) => {
                light.reflectance * lux / (std::f64::consts::PI * lumens(&self.illuminant))
            }
            LightLevel::RadianceWM2Sr(radiance) => radiance / self.counted_power(),
            LightLevel::StandingFor { spectral, .. } => spectral,
        }
    }

    /// Illuminance of the scene (lux), if the light is seen.
    pub fn illuminance_lux(&self) -> Option<f64> {
        let light = &self.exposure.light;
        if let Some(LightLevel::StandingFor { lux, .. }) = light.level {
            return lux;
        }
        self.is_seen()
            .then(|| self.spectral_radiance() * std::f64::consts::PI * lumens(&self.illuminant) / light.reflectance)
    }

    /// Radiance of a white surface over the wavelengths from the first to the last that a channel counts (W m^-2 sr^-1).
    pub fn radiance_w_m2_sr(&self) -> f64 {
        match self.exposure.light.level {
            Some(LightLevel::StandingFor { radiance, .. }) => radiance,
            _ => self.spectral_radiance() * self.counted_power(),
        }
    }

    /// Electrons that a channel counts in a second from a white surface, for each um^2 sr of etendue. `counted`: the sum of the
    /// weights of the channel ([`crate::Channel::weight`]) over wavelength (nm).
    pub fn electrons_per_s(&self, counted: f64) -> f64 {
        const M2_PER_UM2: f64 = 1e-12;
        const M_PER_NM: f64 = 1e-9;
        self.spectral_radiance() * counted * M_PER_NM / PLANCK_LIGHT_J_M * M2_PER_UM2
    }

    /// True if a person sees the light of the scene, so that it may be stated in lux.
    pub(crate) fn is_seen(&self) -> bool {
        lumens(&self.illuminant) > LEAST_LM_W * self.counted_power()
    }

    fn assumed_level(&self) -> LightLevel {
        if self.is_seen() {
            LightLevel::IlluminanceLux(ASSUMED_LUX)
        } else {
            LightLevel::RadianceWM2Sr(ASSUMED_W_M2_SR)
        }
    }

    /// Power of the illuminant, in its own unit times nm, between the first and the last wavelength that is counted.
    fn counted_power(&self) -> f64 {
        let ends = self.channels.iter().map(|c| c.response.ends_nm());
        let [low, high] = ends.fold([f64::INFINITY, 0.0], |[a, b], [low, high]| [a.min(low), b.max(high)]);
        integral([low, high], |nm| self.illuminant.power(nm))
    }
}

/// Lumens of an illuminant, for a watt in each nm where it is one.
fn lumens(illuminant: &Illuminant) -> f64 {
    EFFICACY_LM_W * integral([380.0, 770.0], |nm| illuminant.power(nm) * luminous_efficiency(nm))
}

/// Integral between two wavelengths (nm), by the middles of equal steps.
fn integral([low, high]: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    let steps = ((high - low) / STEP_NM).ceil().max(1.0);
    let step = (high - low) / steps;
    (0..steps as usize)
        .map(|k| of(low + (k as f64 + 0.5) * step))
        .sum::<f64>()
        * step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Led, Response};

    /// Values of the CIE table at 5 nm, between those that are held.
    #[test]
    fn the_eye_is_the_table_of_the_cie() {
        // A cubic of the logarithms misses the steep flank at 505 nm by 0.45 %.
        const DIGITS: f64 = 6e-3;
        for (nm, v) in [
            (455.0, 0.048),
            (505.0, 0.4073),
            (555.0, 1.0),
            (605.0, 0.5668),
            (655.0, 0.0816),
        ] {
            assert!(
                (luminous_efficiency(nm) / v - 1.0).abs() < DIGITS,
                "{nm}: {}",
                luminous_efficiency(nm)
            );
        }
        assert_eq!(luminous_efficiency(1550.0), 0.0);
    }

    /// Lines of one wavelength: photons of a lumen are 1 / (683 V) J of lambda / (h c) each.
    #[test]
    fn electrons_of_one_wavelength_follow_from_lux() {
        // A line 0.2 nm wide, V by its table.
        const PERCENT: f64 = 0.01;
        let mut camera = Camera::three_bands(5.86);
        camera.channels.truncate(1);
        camera.channels[0].response = Response::Band {
            band_nm: [500.0, 600.0],
            efficiency: 0.5,
        };
        let led = |centre_nm: f64| {
            Illuminant::Leds(vec![Led {
                centre_nm,
                width_nm: 0.2,
                power: 3.0,
            }])
        };
        let counted =
            |camera: &Camera| integral([500.0, 600.0], |nm| camera.channels[0].weight(&camera.illuminant, nm));
        for (nm, v) in [(555.0, 1.0), (505.0, 0.4073)] {
            camera.illuminant = led(nm);
            for (lux, reflectance) in [(500.0, 0.9), (1.0, 0.18)] {
                camera.exposure.light = SceneLight {
                    level: Some(LightLevel::IlluminanceLux(lux)),
                    reflectance,
                };
                let photons_per_lumen_s = nm * 1e-9 / (683.0 * v * 6.626e-34 * 2.998e8);
                let want = 0.5 * reflectance * lux / std::f64::consts::PI * photons_per_lumen_s * 1e-12;
                let found = camera.electrons_per_s(counted(&camera));
                assert!((found / want - 1.0).abs() < PERCENT, "{nm}: {found} {want}");
                assert!((camera.illuminance_lux().unwrap() / lux - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn light_that_nobody_sees_has_no_lux() {
        let mut camera = Camera::three_bands(5.86);
        assert!((camera.illuminance_lux().unwrap() - ASSUMED_LUX).abs() < 1e-9);
        camera.channels.truncate(1);
        camera.channels[0].response = Response::Band {
            band_nm: [1500.0, 1600.0],
            efficiency: 0.5,
        };
        camera.illuminant = Illuminant::Leds(vec![Led {
            centre_nm: 1550.0,
            width_nm: 20.0,
            power: 1.0,
        }]);
        assert_eq!(camera.illuminance_lux(), None);
        assert!((camera.radiance_w_m2_sr() - ASSUMED_W_M2_SR).abs() < 1e-9);
    }
}
