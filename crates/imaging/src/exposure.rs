//! Exposure: from light in the pixels to the numbers that a camera records.

use metalith_core::{Error, Result};
use metalith_report::sig;
use metalith_sensor::Noise;
use metalith_sensor::{Camera, ChannelSampling, ColourFilter};
use metalith_wave::kernels::box_sums;
use ndarray::{Array2, Array3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::operator_error::OperatorError;

/// A frame as it was recorded.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Signals as shares of full scale, quantised; one plane for a sensor with a colour filter array, else one for each
    /// channel.
    pub planes: Vec<Array2<f32>>,
    pub filter: ColourFilter,
    /// Signal, of full scale, of a unit of light in each channel.
    pub gain: Vec<f64>,
    pub noise: Noise,
    /// Largest signal that is recorded, of full scale: what stands in `planes` where more than that fell.
    pub full: f32,
    /// Pixels at full scale.
    pub saturated: usize,
}

/// Exposure of a camera behind its optics: the time, and what a white scene gives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChosenExposure {
    /// Time (s).
    pub time_s: f64,
    /// Signal, of full scale, of a unit of light in each channel.
    pub gain: Vec<f64>,
    /// Electrons that the light of a white scene gives in the brightest pixel of each channel, whatever fills that.
    pub white_e: Vec<f64>,
}

impl ChosenExposure {
    /// Exposure of a camera to a scene that is white: the time of the camera file, or with `auto` that after which the brightest
    /// pixel has the signal `white`, unless this takes longer than the longest time. `etendue`: area times projected solid angle of a
    /// unit of light in a pixel (um^2 sr).
    ///
    /// # Errors
    /// If no light of a white scene reaches the sensor.
    pub fn new(camera: &Camera, channels: &[ChannelSampling], white: &[Array2<f32>], etendue: f64) -> Result<Self> {
        let counted: Vec<f64> = channels
            .iter()
            .map(|c| c.parts.iter().map(|p| p.weight).sum())
            .collect();
        let brightest = |frame: &Array2<f32>| f64::from(frame.iter().copied().fold(0.0, f32::max));
        let brightest: Vec<f64> = white.iter().map(brightest).collect();
        if brightest.iter().all(|b| *b <= 0.0) {
            return Err(Error::refused(
                "scene/no-light-on-sensor",
                "no light of the scene reaches the sensor",
                "check `offset_um`, `columns` and `rows` of the sensor against the chip, and the field of the scene",
            ));
        }
        let per_s: Vec<f64> = counted.iter().map(|c| camera.electrons_per_s(*c) * etendue).collect();
        let a_second = Self {
            time_s: 1.0,
            gain: per_s.iter().map(|e| e / camera.sensor.full_scale_e()).collect(),
            white_e: per_s.iter().zip(&brightest).map(|(e, b)| e * b).collect(),
        };
        Ok(a_second.in_light(camera, 1.0))
    }

    /// Exposure of the same camera in which a unit of light has a known signal in each channel.
    pub fn of_gain(camera: &Camera, gain: &[f64]) -> Self {
        Self {
            time_s: camera.exposure.time_s,
            gain: gain.to_vec(),
            white_e: gain.iter().map(|g| g * camera.sensor.full_scale_e()).collect(),
        }
    }

    /// Exposure of the same camera to a scene that is so many times as bright.
    #[must_use]
    pub fn in_light(&self, camera: &Camera, brighter: f64) -> Self {
        let exposure = &camera.exposure;
        let longest = brighter * exposure.time_s / self.time_s;
        let times = if exposure.auto {
            self.up_to_white(camera).min(longest)
        } else {
            longest
        };
        Self {
            time_s: self.time_s * times / brighter,
            ..self.times(times)
        }
    }

    /// This exposure of a scene whose light is unknown: as bright as brings its brightest pixel to the signal `white`.
    #[must_use]
    pub fn by_white(&self, camera: &Camera) -> Self {
        self.times(self.up_to_white(camera))
    }

    /// The light that brings the brightest pixel to the signal `white`, over the light of this exposure.
    fn up_to_white(&self, camera: &Camera) -> f64 {
        camera.exposure.white * camera.sensor.full_scale_e() / self.brightest_e()
    }

    fn times(&self, times: f64) -> Self {
        let all = |v: &[f64]| v.iter().map(|v| v * times).collect();
        Self {
            time_s: self.time_s,
            gain: all(&self.gain),
            white_e: all(&self.white_e),
        }
    }

    /// Electrons of the brightest pixel of a white scene.
    pub fn brightest_e(&self) -> f64 {
        self.white_e.iter().copied().fold(0.0, f64::max)
    }
}

/// Channel that a pixel counts; `None` for a sensor whose pixels count all.
pub fn channel_at(filter: ColourFilter, names: &[String], row: usize, column: usize) -> Option<usize> {
    let colour = filter.colour_at(row, column)?;
    names.iter().position(|n| n == colour.name())
}

/// True if a pixel counts a channel; pixels of a sensor without a filter count all.
pub fn counts_channel(filter: ColourFilter, names: &[String], [row, column]: [usize; 2], channel: usize) -> bool {
    channel_at(filter, names, row, column).is_none_or(|c| c == channel)
}

/// Expose a sensor to the light of each channel: photons and reading, full well, whole steps.
///
/// Noise of all pixels is drawn from `seed`, in reading order, channel by channel.
pub fn expose(camera: &Camera, exposure: &ChosenExposure, light: &[Array2<f32>], seed: u64) -> Frame {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise = camera.sensor.noise.of_exposure(exposure.time_s);
    let gain = &exposure.gain;
    let sensor = &camera.sensor;
    let names = camera.channel_names();
    let signal = |channel: usize, i: (usize, usize)| gain[channel] * f64::from(light[channel][i]);
    let ideal: Vec<Array2<f64>> = match sensor.filter {
        ColourFilter::None => (0..light.len())
            .map(|c| Array2::from_shape_fn(light[c].dim(), |i| signal(c, i)))
            .collect(),
        filter => vec![Array2::from_shape_fn(light[0].dim(), |(y, x)| {
            channel_at(filter, &names, y, x).map_or(0.0, |c| signal(c, (y, x)))
        })],
    };
    // Below zero stays: cameras add a level and subtract it again.
    let planes = ideal
        .iter()
        .map(|plane| noise.expose(plane, &mut random).mapv(|v| recorded(camera, v)));
    Frame::of_signals(camera, exposure, planes.collect())
}

/// The signal that a camera says for one that falls on its sensor, both of full scale.
pub(crate) fn recorded(camera: &Camera, signal: f64) -> f32 {
    let step = camera.sensor.step();
    ((signal.min(camera.sensor.largest_signal()) / step).round() * step) as f32
}

/// Number of planes of the frames of a camera: one behind a colour filter array, else one for each channel.
pub(crate) fn planes_of(camera: &Camera) -> usize {
    match camera.sensor.filter {
        ColourFilter::None => camera.channels.len(),
        _ => 1,
    }
}

impl Frame {
    /// Frame of signals that were recorded, as shares of full scale, in the planes that the sensor of a camera has.
    pub fn of_signals(camera: &Camera, exposure: &ChosenExposure, planes: Vec<Array2<f32>>) -> Self {
        let full = recorded(camera, f64::INFINITY);
        Self {
            saturated: planes.iter().flatten().filter(|v| **v >= full).count(),
            planes,
            filter: camera.sensor.filter,
            gain: exposure.gain.clone(),
            noise: camera.sensor.noise.of_exposure(exposure.time_s),
            full,
        }
    }

    /// Checks that the frame can be of a sensor of so many rows and columns behind so many channels.
    ///
    /// # Errors
    /// If it is of another camera.
    pub fn is_of(&self, rows_columns: [usize; 2], channels: usize) -> Result<()> {
        let [rows, columns] = rows_columns;
        let [own_rows, own_columns] = self.planes.first().map_or([0; 2], |p| [p.nrows(), p.ncols()]);
        if self.gain.len() == channels && self.planes.iter().all(|p| p.dim() == (rows, columns)) {
            return Ok(());
        }
        Err(Error::refused(
            "restore/camera-differs",
            format!(
                "the frame is of another camera: it has {own_columns} x {own_rows} pixels and {} channels, the camera {columns} x {rows} and {channels}",
                self.gain.len()
            ),
            "give the camera that it was recorded with",
        ))
    }

    /// Share of the pixels that are at full scale.
    pub fn saturated_share(&self) -> f64 {
        self.saturated as f64 / self.pixels() as f64
    }

    /// True if most pixels are at full scale: what is restored then says nothing of the camera.
    pub fn is_lost(&self) -> bool {
        self.saturated_share() > 0.5
    }

    /// Note on pixels at full scale, if there are more than a few; `truth` is the scene in linear sRGB.
    pub fn saturation_note(&self, truth: &Array3<f64>) -> Option<String> {
        /// Share that is reported.
        const TOLD: f64 = 0.01;
        /// Light that a scene has if its white is another number than one.
        const ABOVE_WHITE: f64 = 1.01;
        let share = self.saturated_share();
        let brightest = truth.iter().copied().fold(0.0, f64::max);
        let mut words = format!(
            "{:.1} % of the pixels are at full scale, and the restoration knows nothing of what fell on them",
            100.0 * share
        );
        if brightest > ABOVE_WHITE {
            words += &format!(
                "; the scene has light up to {}, where white is 1: divide it by its white",
                sig(brightest, 3)
            );
        }
        if self.is_lost() {
            words += "; the frame is lost, and no score of it says anything of the camera";
        }
        (share >= TOLD).then_some(words)
    }

    /// Mean over all pixels, of full scale.
    pub fn mean_signal(&self) -> f64 {
        let all = self.planes.iter().flatten();
        all.map(|v| f64::from(*v)).sum::<f64>() / self.pixels() as f64
    }

    /// Number of pixels, at least one: those of all planes.
    fn pixels(&self) -> usize {
        self.planes.iter().map(|p| p.len()).sum::<usize>().max(1)
    }

    /// Light of each channel as it was recorded, zero where a pixel does not count it: pixels at full scale have that of full scale,
    /// for a restoration that cannot leave pixels out.
    pub fn recorded_light(&self, camera: &Camera) -> Vec<Array2<f32>> {
        let names = camera.channel_names();
        let of = |(channel, gain): (usize, &f64)| {
            let plane = self.plane(channel);
            Array2::from_shape_fn(plane.dim(), |(y, x)| {
                if self.counts(channel, &names, y, x) {
                    (f64::from(plane[[y, x]]) / gain) as f32
                } else {
                    0.0
                }
            })
        };
        self.gain.iter().enumerate().map(of).collect()
    }

    /// Plane that a channel was recorded in.
    fn plane(&self, channel: usize) -> &Array2<f32> {
        &self.planes[if self.filter == ColourFilter::None { channel } else { 0 }]
    }

    /// True if a pixel counts a channel.
    fn counts(&self, channel: usize, names: &[String], row: usize, column: usize) -> bool {
        counts_channel(self.filter, names, [row, column], channel)
    }

    /// Light of each channel, and how much each pixel is to be trusted: one over the variance of its light, zero where it
    /// does not count the channel or is at full scale. To the noise comes what the operator of a restoration errs by, as
    /// a share of the light, by channel, and of no less than the mean light of the frame: light in dark places comes from
    /// bright ones. Both follow from the mean signal about a pixel: by its own, one that noise has
    /// made dark would be trusted more than its neighbours.
    pub fn light(&self, camera: &Camera, error: &OperatorError) -> (Vec<Array2<f32>>, Vec<Array2<f32>>) {
        let names = camera.channel_names();
        let (mut light, mut inverse_variance) = (Vec::new(), Vec::new());
        for (channel, gain) in self.gain.iter().enumerate() {
            let plane = self.plane(channel);
            let known = |y: usize, x: usize| self.counts(channel, &names, y, x) && plane[[y, x]] < self.full;
            let known = Array2::from_shape_fn(plane.dim(), |(y, x)| f64::from(u8::from(known(y, x))));
            let signal = &known * &plane.mapv(f64::from);
            let (sums, numbers) = (box_sums(&signal, NEAR), box_sums(&known, NEAR));
            let overall = signal.sum() / known.sum().max(1.0);
            light.push(signal.mapv(|v| (v / gain) as f32));
            inverse_variance.push(Array2::from_shape_fn(plane.dim(), |at| {
                let mean = (sums[at] / numbers[at].max(1.0)).max(0.0);
                let variance = self.noise.variance(mean) + (error.about(channel, at) * mean.max(overall)).powi(2);
                (known[at] * gain * gain / variance.max(f64::MIN_POSITIVE)) as f32
            }));
        }
        (light, inverse_variance)
    }
}

/// Pixels on both sides over which a mean signal is taken: about what the window of a kernel holds.
const NEAR: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ElementView;
    use metalith_sensor::{Illuminant, Led, LightLevel, Response, SceneLight, SensorNoise};

    /// The camera equation: the illuminance on the axis behind a perfect lens is pi L / (4 N^2). In light of one wavelength its
    /// photons follow from lumens by hand.
    #[test]
    fn electrons_of_a_white_pixel_are_those_of_the_camera_equation() {
        const PERCENT: f64 = 0.01;
        let mut camera = Camera::three_bands(5.86);
        camera.channels.truncate(1);
        camera.channels[0].response = Response::Band {
            band_nm: [500.0, 600.0],
            efficiency: 0.6,
        };
        camera.illuminant = Illuminant::Leds(vec![Led {
            centre_nm: 555.0,
            width_nm: 2.0,
            power: 1.0,
        }]);
        camera.exposure.auto = false;
        let channels = camera.sampling([400.0, 700.0], 12.5).unwrap().channels;
        for (diameter_um, focal_um, lux, time_s) in [
            (1000.0, 2400.0, 500.0, 0.01),
            (250.0, 2400.0, 500.0, 0.01),
            (1000.0, 2400.0, 50.0, 0.01),
            (1000.0, 2400.0, 500.0, 0.003),
            (200.0, 1440.0, 5000.0, 0.1),
        ] {
            camera.exposure.time_s = time_s;
            camera.exposure.light = SceneLight {
                level: Some(LightLevel::IlluminanceLux(lux)),
                reflectance: 0.9,
            };
            let lens = ElementView::ahead([0.0; 2], focal_um);
            let light = lens.flux_per_um2([0.0; 2]) * camera.sensor.pixel_um.powi(2);
            let white = [Array2::from_elem((1, 1), light as f32)];
            let area_um2 = 0.25 * std::f64::consts::PI * diameter_um * diameter_um;
            let found = ChosenExposure::new(&camera, &channels, &white, area_um2).unwrap();
            let f_number = focal_um / diameter_um;
            let sensor_lux = 0.9 * lux / (4.0 * f_number * f_number);
            let joule = sensor_lux / 683.0 * (5.86e-6f64).powi(2) * time_s;
            let want = 0.6 * joule * 555e-9 / (6.626e-34 * 2.998e8);
            assert!((found.brightest_e() / want - 1.0).abs() < PERCENT, "{found:?} {want}");
            assert_eq!(found.time_s, time_s);
            let twice = found.in_light(&camera, 2.0);
            assert!(twice.time_s == time_s && (twice.brightest_e() / found.brightest_e() - 2.0).abs() < 1e-9);
        }
    }

    /// Time that follows the light up to the longest.
    #[test]
    fn an_automatic_exposure_ends_at_white_or_at_its_longest_time() {
        const ROUNDING: f64 = 1e-9;
        let camera = Camera::three_bands(5.86);
        let channels = camera.sampling([400.0, 700.0], 12.5).unwrap().channels;
        let white = vec![Array2::from_elem((2, 2), 1e-6f32); 3];
        let found = ChosenExposure::new(&camera, &channels, &white, 1e6).unwrap();
        let full_e = camera.sensor.full_scale_e();
        assert!((found.brightest_e() / full_e - 0.9).abs() < ROUNDING && found.time_s < 1.0);
        let bright = found.in_light(&camera, 10.0);
        assert!(
            (bright.time_s / found.time_s - 0.1).abs() < ROUNDING
                && (bright.gain[0] / found.gain[0] - 1.0).abs() < ROUNDING
        );
        let dark = found.in_light(&camera, 1e-6);
        assert!((dark.time_s - 1.0).abs() < ROUNDING && dark.brightest_e() < 0.1 * full_e);
        assert!((dark.by_white(&camera).brightest_e() / full_e - 0.9).abs() < ROUNDING);
        assert!((dark.in_light(&camera, 1e6).time_s / found.time_s - 1.0).abs() < ROUNDING);
    }

    /// Whole steps in single precision lie on either side of those in double precision.
    #[test]
    fn pixels_at_full_scale_are_not_trusted_whatever_a_step_is() {
        let mut camera = Camera::three_bands(5.86);
        camera.sensor.bits = 12;
        camera.sensor.noise = SensorNoise::Electrons {
            full_well_e: 32_000.0,
            read_noise_e: 0.0,
            dark_current_e_s: 0.0,
        };
        // The last two end at the well, between two steps and at one.
        for gain_e in [7.7, 7.8, 7.81, 7.85, 8.0] {
            camera.sensor.gain_e = gain_e;
            let light = [2.0, 2.0, 0.5].map(|v| Array2::from_elem((20, 20), v));
            let frame = expose(&camera, &ChosenExposure::of_gain(&camera, &[1.0; 3]), &light, 3);
            assert_eq!(frame.saturated, 800, "{gain_e}");
            assert_eq!(frame.saturated_share(), 2.0 / 3.0);
            let note = frame.saturation_note(&Array3::from_elem((1, 1, 3), 2.0)).unwrap();
            for words in ["66.7 %", "light up to 2", "the frame is lost"] {
                assert!(note.contains(words), "{note}");
            }
            let (light, inverse_variance) = frame.light(&camera, &OperatorError::none(3));
            // Unknown light is none; as it was recorded it is that of full scale.
            let recorded = frame.recorded_light(&camera);
            assert!(light[0].iter().all(|v| *v == 0.0) && recorded[1].iter().all(|v| *v == frame.full));
            assert!(light[2] == recorded[2]);
            assert!(
                inverse_variance[0]
                    .iter()
                    .chain(&inverse_variance[1])
                    .all(|t| *t == 0.0),
                "{gain_e}"
            );
            assert!(inverse_variance[2].iter().all(|t| *t > 0.0), "{gain_e}");
        }
    }

    #[test]
    fn a_frame_has_its_mosaic_its_steps_and_its_full_scale() {
        let mut camera = Camera::three_bands(5.86);
        camera.sensor.filter = ColourFilter::Rggb;
        camera.sensor.bits = 8;
        camera.sensor.noise = SensorNoise::Electrons {
            full_well_e: 10_000.0,
            read_noise_e: 0.0,
            dark_current_e_s: 0.0,
        };
        camera.sensor.gain_e = 10_000.0 / 256.0;
        for (channel, name) in camera.channels.iter_mut().zip(["blue", "green", "red"]) {
            channel.name = name.into();
        }
        let light: Vec<Array2<f32>> = [0.2, 0.5, 2.0].map(|v| Array2::from_elem((40, 40), v)).into();
        let frame = expose(&camera, &ChosenExposure::of_gain(&camera, &[1.0; 3]), &light, 3);
        let plane = &frame.planes[0];
        assert_eq!(frame.saturated, 400, "red is above full scale");
        let step = 1.0 / 256.0;
        assert!(
            plane
                .iter()
                .all(|v| ((f64::from(*v) / step).fract()).min(1.0 - (f64::from(*v) / step).fract()) < 1e-4)
        );
        let mean = |y: usize, x: usize| {
            plane
                .indexed_iter()
                .filter(|((i, j), _)| (i % 2, j % 2) == (y, x))
                .map(|(_, v)| f64::from(*v))
                .sum::<f64>()
                / 400.0
        };
        // 400 pixels with noise of 0.007: three standard errors.
        assert!((mean(1, 1) - 0.2).abs() < 1e-3 && (mean(0, 1) - 0.5).abs() < 1.2e-3);
        assert_eq!(
            expose(&camera, &ChosenExposure::of_gain(&camera, &[1.0; 3]), &light, 3).planes,
            frame.planes
        );
        // A quarter, of a scene whose white is one.
        let note = frame.saturation_note(&Array3::from_elem((1, 1, 3), 1.0)).unwrap();
        assert!(note.starts_with("25.0 %") && note.ends_with("fell on them"), "{note}");
        let (light, inverse_variance) = frame.light(&camera, &OperatorError::none(3));
        assert!(frame.is_of([40, 40], 3).is_ok());
        for (size, channels) in [([40, 41], 3), ([40, 40], 1)] {
            assert_eq!(frame.is_of(size, channels).unwrap_err().id(), "restore/camera-differs");
        }
        assert!(
            light[0][[1, 1]] > 0.1
                && inverse_variance[0][[1, 1]] > 0.0
                && inverse_variance[0][[0, 0]] == 0.0
                && inverse_variance[2][[0, 0]] == 0.0
        );
    }
}
