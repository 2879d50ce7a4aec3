//! A point of the scene, and what a channel of a camera makes of its light.

use ndarray::Array2;
use serde::Serialize;

use metalith_core::{Result, Wedge};
use metalith_design::Element;
use metalith_sensor::ChannelSampling;
use metalith_wave::psf::{BandPart, BandSample, band_otf, pixel_mtf, polychromatic};
use metalith_wave::{PlaneWave, Psf, propagation};

/// Contrast along x and y, pixel included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Contrast {
    /// Frequency (line pairs a millimetre).
    pub lp_mm: f64,
    pub mtf: [f64; 2],
}

/// A point of the scene in one channel.
#[derive(Clone, Debug, Serialize)]
pub struct WhiteChannel {
    pub channel: String,
    /// Share of what the channel counts that lies within the wavelengths simulated.
    pub counted: f64,
    /// Direction sines of the point, for all wavelengths.
    pub incidence_sin: [f64; 2],
    /// Wavelengths up to which 10, 50 and 90 % of the light that passes have come (nm).
    pub wavelengths_nm: [f64; 3],
    /// Places where the chief ray lands at these three, from the element's axis (um).
    pub chief_ray_um: [[f64; 2]; 3],
    /// Distance from the first to the last of these places (um).
    pub spread_um: f64,
    /// Direction of the line between them, from the x axis (degrees, above -90 to 90); none where there is no spread.
    pub spread_direction_deg: Option<f64>,
    /// Place of the brightest sample from the element's axis (um).
    pub peak_um: [f64; 2],
    /// Share of the light that arrives at the element in a square of one pixel about the brightest place.
    pub energy_1_pixel: f64,
    /// Share of the energy in a square of two pixels an edge.
    pub energy_2_pixels: f64,
    /// Share of the light that arrives at the element and passes it.
    pub energy_passed: f64,
    /// Contrast over all light that passes.
    pub contrast: Vec<Contrast>,
    /// Largest change of the contrasts if every second wavelength is left out: an upper bound for the error of
    /// sampling.
    pub sampling_mtf: f64,
    /// Share of light a um^2, for pictures.
    #[serde(skip)]
    pub(super) image: Array2<f32>,
    /// Distance of its samples (um).
    #[serde(skip)]
    pub(super) step_um: f64,
}

impl WhiteChannel {
    /// Contrast along x and y at a frequency (line pairs a millimetre); no numbers if it is not one of those that were computed.
    pub fn contrast_at(&self, lp_mm: f64) -> [f64; 2] {
        let found = self.contrast.iter().find(|c| c.lp_mm == lp_mm);
        found.map_or([f64::NAN; 2], |c| c.mtf)
    }

    /// Contrast along the worse of x and y.
    pub fn least_contrast(&self, lp_mm: f64) -> f64 {
        let [x, y] = self.contrast_at(lp_mm);
        x.min(y)
    }

    /// Mean contrast of x and y at each frequency, from zero on.
    pub(super) fn curve(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let points = self.contrast.iter().map(|c| (c.lp_mm, 0.5 * (c.mtf[0] + c.mtf[1])));
        std::iter::once((0.0, 1.0)).chain(points)
    }
}

/// A PSF per unit of light that arrives at an element whose matched twin passes this power (um^2).
pub(super) fn per_light(landing_um: [f64; 2], mut psf: Psf, power_um2: f64) -> BandSample {
    let share = 1.0 / power_um2;
    psf.values *= share;
    if let Some(otf) = &mut psf.otf {
        otf.scale(|_| share);
        otf.power_um2 *= share;
    }
    BandSample { landing_um, psf }
}

/// Parts that channels are made of.
pub(super) struct Channels<'a> {
    pub point: Point,
    /// One at each wavelength of the sampling.
    pub samples: &'a [BandSample],
    /// Frequencies of the contrasts (line pairs a millimetre), those of the samples.
    pub lp_mm: &'a [f64],
    pub pixel_um: f64,
}

impl Channels<'_> {
    /// One channel from the PSFs of all wavelengths.
    ///
    /// # Errors
    /// If a wavelength does not reach the sensor.
    pub(crate) fn channel(&self, channel: &ChannelSampling) -> Result<WhiteChannel> {
        let landing = |nm: f64| self.point.landing_um(nm * 1e-3);
        let parts = channel.parts.iter().map(|p| {
            Ok(BandPart {
                weight: p.weight,
                landing_um: [landing(p.nm[0])?, landing(p.nm[1])?],
                place: p.place,
            })
        });
        let parts = parts.collect::<Result<Vec<_>>>()?;
        let found = polychromatic(self.samples, &parts)?;
        let pixel_um = self.pixel_um;
        let psf = &found.psf;
        let contrast: Vec<Contrast> = self
            .lp_mm
            .iter()
            .map(|&lp_mm| Contrast {
                lp_mm,
                mtf: [0, 1].map(|axis| psf.contrast(axis, lp_mm) * pixel_mtf(pixel_um, lp_mm)),
            })
            .collect();
        let [first, _, last] = found.landing_um;
        let (dx, dy) = (last[0] - first[0], last[1] - first[1]);
        let (_, peak_um) = psf.peak();
        let nm = |at: f64| {
            let i = (at as usize).min(channel.parts.len() - 1);
            let [from, to] = channel.parts[i].nm;
            from + (at - i as f64) * (to - from)
        };
        Ok(WhiteChannel {
            channel: channel.name.clone(),
            counted: channel.counted,
            incidence_sin: self.point.sines,
            wavelengths_nm: found.at_part.map(nm),
            chief_ray_um: found.landing_um,
            spread_um: dx.hypot(dy),
            spread_direction_deg: (dx != 0.0 || dy != 0.0).then(|| line_direction_deg(dx, dy)),
            peak_um,
            energy_1_pixel: psf.energy_in_square_um2(peak_um, pixel_um),
            energy_2_pixels: psf.energy_in_square_um2(peak_um, 2.0 * pixel_um),
            energy_passed: psf.otf.as_ref().map_or_else(|| psf.energy_um2(), |otf| otf.power_um2),
            sampling_mtf: self.sampling_error(&parts, &contrast)?,
            contrast,
            image: psf.values.mapv(|v| v.max(0.0) as f32),
            step_um: psf.window.step_um,
        })
    }

    /// Largest change of the contrasts without every second wavelength.
    fn sampling_error(&self, parts: &[BandPart], contrast: &[Contrast]) -> Result<f64> {
        let half: Vec<BandSample> = self.samples.iter().step_by(2).cloned().collect();
        let parts: Vec<BandPart> = parts
            .iter()
            .map(|p| BandPart {
                place: 0.5 * p.place,
                ..*p
            })
            .collect();
        let Some(otf) = band_otf(&half, &parts)? else {
            return Ok(0.0);
        };
        let changes = contrast.iter().enumerate().flat_map(|(j, c)| {
            let coarse = otf.contrast(j).map(|m| m * pixel_mtf(self.pixel_um, c.lp_mm));
            [0, 1].map(|axis| (coarse[axis] - c.mtf[axis]).abs())
        });
        Ok(changes.fold(0.0, f64::max))
    }
}

/// A point of the scene, and where an element sends its light.
pub(super) struct Point {
    pub wedge: Wedge,
    /// Direction sines of the light of all wavelengths.
    pub sines: [f64; 2],
    /// Distance from the pillar tops to the sensor (um).
    pub distance_um: f64,
}

impl Point {
    /// Point in the viewing direction of an element at the wavelength of its wedge.
    pub(super) fn of(element: &Element, distance_um: f64) -> Self {
        let (x, y) = element.wedge.looks_at(element.wedge.wavelength_um);
        Self {
            wedge: element.wedge,
            sines: [x, y],
            distance_um,
        }
    }

    /// Light of one wavelength.
    pub(crate) fn wave(&self, wavelength_um: f64) -> PlaneWave {
        PlaneWave {
            wavelength_um,
            sin_x: self.sines[0],
            sin_y: self.sines[1],
        }
    }

    /// Place where its chief ray of one wavelength lands, from the element's axis (um).
    ///
    /// # Errors
    /// If it does not reach the sensor.
    pub(crate) fn landing_um(&self, wavelength_um: f64) -> Result<[f64; 2]> {
        let wave = self.wave(wavelength_um);
        Ok(propagation::landing_um(&self.wedge, &wave, self.distance_um)?)
    }
}

/// Direction of a line from the x axis (degrees), above -90 to 90.
fn line_direction_deg(dx: f64, dy: f64) -> f64 {
    let angle = dy.atan2(dx).to_degrees();
    if angle > 90.0 {
        angle - 180.0
    } else if angle <= -90.0 {
        angle + 180.0
    } else {
        angle
    }
}
