//! Light of a camera: wavelengths of its channels, what the metasurface does to them, electrons and noise.

use metalith_sensor::{AngularResponse, Camera, Colour, ColourFilter, SensorNoise, StatedExposure, WavelengthSteps};

use metalith_core::Result;

use super::search::SensorLattice;

/// Shares of the light of a wavelength that leaves a metasurface: with the phase of its design, and otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Efficiency {
    pub focused: f64,
    pub stray: f64,
}

/// A camera as the model sees it.
#[derive(Clone, Debug)]
pub struct CameraLight {
    pub wavelengths_um: Vec<f64>,
    pub channels: Vec<ChannelLight>,
    /// Lattices of pixels: the channel, and the place of a pixel of each (um).
    pub lattices: Vec<(usize, [f64; 2])>,
    /// Pitch of a lattice (um).
    pub pitch_um: f64,
    pub pixel_um: f64,
    /// Sides of the sensor along x and y (um).
    pub sides_um: [f64; 2],
    /// True if the channels are red, green and blue.
    pub colours: bool,
    /// Time (s), and the electrons of white that end it before.
    pub time_s: f64,
    most_e: f64,
    pub angular_response: AngularResponse,
    noise: SensorNoise,
    full_e: f64,
    /// Variance of a number that is rounded to whole steps (electrons^2).
    step_e2: f64,
}

/// One channel.
#[derive(Clone, Debug)]
pub struct ChannelLight {
    pub name: String,
    /// Share of each wavelength in the focused light.
    pub weights: Vec<f64>,
    /// Electrons a second of focused light, for each um^2 sr, from white.
    pub focused_e_s: f64,
    /// Electrons a second of stray light.
    pub stray_e_s: f64,
}

impl CameraLight {
    /// The camera before scenes of an illuminance (lux), exposed for at most so long (s), with wavelengths at most `step_nm` apart.
    ///
    /// # Errors
    /// If a channel counts no light in the band of the camera, or the light is not visible.
    pub fn new(
        camera: &Camera,
        lux: f64,
        time_s: f64,
        band_nm: [f64; 2],
        step_nm: f64,
        efficiency: &dyn Fn(f64) -> Result<Efficiency>,
    ) -> Result<Self> {
        let camera = camera.clone().stated(&StatedExposure {
            lux: Some(lux),
            ..StatedExposure::default()
        })?;
        let sampling = camera.sampling(band_nm, WavelengthSteps::from(step_nm))?;
        let wavelengths_um: Vec<f64> = sampling.wavelengths_nm.iter().map(|nm| nm * 1e-3).collect();
        let shares = wavelengths_um
            .iter()
            .map(|um| efficiency(*um))
            .collect::<Result<Vec<_>>>()?;
        let sensor = &camera.sensor;
        let channels: Vec<ChannelLight> = sampling
            .channels
            .iter()
            .map(|channel| {
                let (mut weights, mut stray) = (vec![0.0; wavelengths_um.len()], 0.0);
                for part in &channel.parts {
                    for (i, share) in sampling.blended(part.place) {
                        weights[i] += part.weight * share * shares[i].focused;
                        stray += part.weight * share * shares[i].stray;
                    }
                }
                let focused: f64 = weights.iter().sum();
                weights.iter_mut().for_each(|w| *w /= focused);
                ChannelLight {
                    name: channel.name.clone(),
                    weights,
                    focused_e_s: camera.electrons_per_s(focused),
                    stray_e_s: camera.electrons_per_s(stray),
                }
            })
            .collect();
        let index = |name: &str| channels.iter().position(|c| c.name == name);
        let names = Colour::CHOICES.map(|(name, _)| name);
        let colours = channels.len() == 3 && names.iter().all(|n| index(n).is_some());
        let mut lattices = Vec::new();
        for row in 0..2 {
            for column in 0..2 {
                if let Some(colour) = sensor.filter.colour_at(row, column) {
                    let place = [column, row].map(|k| k as f64 * sensor.pixel_um);
                    lattices.extend(index(colour.name()).map(|c| (c, place)));
                }
            }
        }
        let mosaic = sensor.filter != ColourFilter::None;
        if !mosaic {
            lattices = (0..channels.len()).map(|c| (c, [0.0; 2])).collect();
        }
        let full_e = sensor.full_scale_e();
        let lattice = SensorLattice::of(sensor);
        Ok(Self {
            wavelengths_um,
            channels,
            lattices,
            pitch_um: lattice.pitch_um,
            pixel_um: sensor.pixel_um,
            sides_um: lattice.sides_um,
            colours,
            time_s,
            most_e: camera.exposure.white * full_e,
            angular_response: sensor.angular_response.clone(),
            noise: sensor.noise,
            full_e,
            step_e2: sensor.gain_e.powi(2) / 12.0,
        })
    }

    /// Lattice of the sensor.
    pub fn lattice(&self) -> SensorLattice {
        SensorLattice {
            sides_um: self.sides_um,
            pitch_um: self.pitch_um,
        }
    }

    /// Plane of the scene that a channel sees: red, green, blue in this order if there are these.
    pub(super) fn plane(&self, channel: usize) -> usize {
        let name = &self.channels[channel].name;
        let at = Colour::CHOICES.iter().position(|(n, _)| n == name);
        at.filter(|_| self.colours).unwrap_or(channel)
    }

    /// Time (s) after which white in the brightest pixel, of so much etendue (um^2 sr), is as bright as exposures make it at most.
    pub fn exposed_s(&self, brightest_etendue: f64) -> f64 {
        let all = self.channels.iter().map(|c| c.focused_e_s + c.stray_e_s);
        let most = all.fold(0.0, f64::max) * brightest_etendue;
        self.time_s.min(self.most_e / most)
    }

    /// Variance (electrons^2) of a pixel with so many electrons of light, after a time (s).
    pub(super) fn variance_e2(&self, light_e: f64, time_s: f64) -> f64 {
        self.noise.of_exposure(time_s).variance(light_e / self.full_e) * self.full_e.powi(2) + self.step_e2
    }
}
