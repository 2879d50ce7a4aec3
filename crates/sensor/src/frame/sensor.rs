//! Contributions of the sensor to frames.

use ndarray::{Array2, Zip};

use super::{Orientation, saturated};
use crate::{Colour, ColourPixels, RelayCamera};

/// A mean frame of the sensor by itself.
pub struct SensorFrame {
    /// Values as recorded, black level included (DN).
    pub dn: Array2<f32>,
    /// Frames that it is the mean of.
    pub frames: u32,
    /// Variance that it was rounded with (DN^2).
    pub rounding_dn2: f64,
}

impl SensorFrame {
    /// Variance of a pixel (DN^2) that shows so much above black.
    fn variance_dn2(&self, camera: &RelayCamera, signal_dn: f64) -> f64 {
        camera.variance_dn2(signal_dn, self.frames) + self.rounding_dn2
    }
}

/// A sensor without light, for so long as one exposure takes.
#[derive(PartialEq)]
pub struct DarkPixels {
    /// Black level included (DN).
    dn: Array2<f32>,
    /// Variance of that (DN^2).
    noise: Array2<f64>,
}

impl DarkPixels {
    /// Dark pixels by a dark frame, with their uncertainty.
    pub fn new(frame: &SensorFrame, camera: &RelayCamera) -> Self {
        let variance = |v: &f32| frame.variance_dn2(camera, f64::from(v - camera.black_level_dn as f32));
        Self {
            noise: frame.dn.map(variance),
            dn: frame.dn.clone(),
        }
    }
}

/// Frames without light and in even light: what the sensor adds by itself.
#[derive(Default)]
pub struct SensorFrames {
    /// Frame without light, black level included: for the exposures that have no dark frame of their own, and for the
    /// flat frame.
    pub dark: Option<SensorFrame>,
    /// Frame in even light, dark frame included.
    pub flat: Option<SensorFrame>,
    /// True if the dark frame holds for exposures of any time.
    pub dark_of_any_exposure: bool,
    /// Orientation of frames in their files.
    pub orientation: Orientation,
}

impl SensorFrames {
    /// Pixels of a camera by these frames; `None` without any such frame.
    pub fn pixels(&self, camera: &RelayCamera) -> Option<SensorPixels> {
        let shape = self.dark.as_ref().or(self.flat.as_ref())?.dn.dim();
        let black = camera.black_level_dn as f32;
        let (dark, dark_noise) = match self.dark.as_ref().map(|d| DarkPixels::new(d, camera)) {
            Some(DarkPixels { dn, noise }) => (dn, Some(noise)),
            None => (Array2::from_elem(shape, black), None),
        };
        let flat = self.flat.as_ref().map(|flat| {
            let lit = &flat.dn - &dark;
            let level = levels(&lit, camera);
            let full = camera.full_dn() as f32;
            // How much brighter than that a full pixel was, nobody knows: it tells nothing.
            let response = Zip::from(&lit).and(&level).and(&flat.dn);
            FlatPixels {
                response: response.map_collect(|lit, level, dn| if *dn < full { lit / level } else { 0.0 }),
                noise: flat.dn.map(|v| flat.variance_dn2(camera, f64::from(v - black))),
                level,
            }
        });
        Some(SensorPixels {
            camera: *camera,
            dark,
            dark_noise,
            flat,
        })
    }
}

/// Mean of the even light at the pixels that have the filter of a pixel, at each pixel: colours of a light are unlike, and
/// `scale_dn` is that of the pixels of one filter.
fn levels(lit: &Array2<f32>, camera: &RelayCamera) -> Array2<f32> {
    let group = |(y, x): (usize, usize)| camera.filter.colour_at(y, x).map(|colour| colour as usize);
    let mut sums = [(0.0f64, 0usize); Colour::CHOICES.len()];
    for (at, v) in lit.indexed_iter() {
        let sum = &mut sums[group(at).unwrap_or(0)];
        *sum = (sum.0 + f64::from(*v), sum.1 + 1);
    }
    let means = sums.map(|(sum, n)| (sum / n.max(1) as f64) as f32);
    Array2::from_shape_fn(lit.dim(), |at| means[group(at).unwrap_or(0)])
}

/// Pixels by dark and flat frames, with their uncertainty.
pub struct SensorPixels {
    camera: RelayCamera,
    /// Values without light, black level included (DN).
    dark: Array2<f32>,
    /// Variance of that (DN^2); none where the stated black level stands in.
    dark_noise: Option<Array2<f64>>,
    flat: Option<FlatPixels>,
}

struct FlatPixels {
    /// Relative to the mean of the pixels of one filter.
    response: Array2<f32>,
    /// This mean (DN above dark).
    level: Array2<f32>,
    /// Variance of the flat frame (DN^2).
    noise: Array2<f64>,
}

impl SensorPixels {
    /// A sensor that nothing is known of but its black level.
    pub fn even(camera: &RelayCamera, shape: (usize, usize)) -> Self {
        Self {
            camera: *camera,
            dark: Array2::from_elem(shape, camera.black_level_dn as f32),
            dark_noise: None,
            flat: None,
        }
    }

    /// Take both frames out of a measurement: every pixel has the stated black level and the mean response after. Pixels that tell
    /// nothing: those that were saturated or beside one that was, and dead ones with those beside them. They stay saturated. With
    /// `filter` pixels under others are not dead: light of a flat frame may be of one colour. `own`: the dark frame of this exposure,
    /// here and below, in the place of that of all.
    pub fn take_out(
        &self,
        dn: &mut Array2<f32>,
        filter: Option<ColourPixels>,
        own: Option<&DarkPixels>,
    ) -> Array2<bool> {
        let dark = self.dark_of(own);
        let (black, full) = (self.camera.black_level_dn as f32, self.camera.saturation_dn);
        let counts = |at| filter.is_none_or(|pixels| pixels.has(at));
        for (at, v) in dn.indexed_iter_mut() {
            let response = self.response(at);
            // Without light there is no response to speak of.
            if counts(at) && (response.is_nan() || response <= LEAST_RESPONSE) {
                *v = full as f32;
            }
        }
        // By what was recorded: pixels that see little may stand for more than the sensor counts to.
        let masked = saturated(dn, full);
        for (at, v) in dn.indexed_iter_mut() {
            *v = if f64::from(*v) >= self.camera.full_dn() {
                full as f32
            } else {
                black + (*v - dark[at]) / self.response(at)
            };
        }
        masked
    }

    /// Variance of a corrected pixel by the noise of its own exposure (DN^2), which shows `signal_dn` above black in the mean of
    /// so many frames: shot noise of all that was recorded, dark current included, and read noise, both divided by the response.
    /// The recorded mean was rounded with `rounding_dn2` (DN^2).
    pub fn own_variance_dn2(
        &self,
        at: (usize, usize),
        signal_dn: f64,
        (frames, rounding_dn2): (u32, f64),
        own: Option<&DarkPixels>,
    ) -> f64 {
        let response = f64::from(self.response(at));
        let recorded = response * signal_dn + f64::from(self.dark_of(own)[at]) - self.camera.black_level_dn;
        (self.camera.variance_dn2(recorded, frames) + rounding_dn2) / (response * response)
    }

    /// Errors of a corrected pixel that shows `signal_dn` if the dark frame of all exposures, the flat frame, and the
    /// dark frame of its own are too bright by one standard deviation (DN). A dark frame that is too bright takes too
    /// much out of the capture, that of all also makes the pixel look less sensitive; a flat frame that is too bright
    /// makes it look more so. Exposures share the first two.
    pub fn shared_errors_dn(&self, at: (usize, usize), signal_dn: f64, own: Option<&DarkPixels>) -> [f64; 3] {
        let response = f64::from(self.response(at));
        let of_level = self.flat.as_ref().map_or(0.0, |f| signal_dn / f64::from(f.level[at]));
        let sigma = |noise: Option<&Array2<f64>>| noise.map_or(0.0, |n| n[at].sqrt());
        let taken_out = if own.is_some() { 0.0 } else { 1.0 };
        [
            (of_level - taken_out) / response * sigma(self.dark_noise.as_ref()),
            -of_level / response * sigma(self.flat.as_ref().map(|f| &f.noise)),
            -1.0 / response * sigma(own.map(|d| &d.noise)),
        ]
    }

    /// Values of the pixels without light in an exposure.
    fn dark_of<'a>(&'a self, own: Option<&'a DarkPixels>) -> &'a Array2<f32> {
        own.map_or(&self.dark, |d| &d.dn)
    }

    fn response(&self, at: (usize, usize)) -> f32 {
        self.flat.as_ref().map_or(1.0, |f| f.response[at])
    }
}

/// Response of a pixel, relative to the mean, below which it is dead.
const LEAST_RESPONSE: f32 = 0.1;

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::ColourFilter;

    pub(crate) fn camera() -> RelayCamera {
        RelayCamera {
            pixel_um: 1.0,
            rows: 2,
            cols: 3,
            black_level_dn: 40.0,
            gain_e_per_dn: 1.0,
            read_noise_dn: 1.0,
            saturation_dn: 1000.0,
            registration_sigma_px: 0.5,
            flux_sigma: 0.01,
            relay_blur_um: 0.0,
            filter: ColourFilter::None,
        }
    }

    fn frames(dark: Array2<f32>, flat: Array2<f32>, frames: u32) -> SensorFrames {
        let frame = |dn| {
            Some(SensorFrame {
                dn,
                frames,
                rounding_dn2: 0.0,
            })
        };
        SensorFrames {
            dark: frame(dark),
            flat: frame(flat),
            dark_of_any_exposure: false,
            orientation: Orientation::Upright,
        }
    }

    #[test]
    fn dark_and_flat_frames_are_taken_out() {
        // Responses of 0.5 and 1.5 of the mean, and a dead pixel.
        let frames = frames(
            ndarray::arr2(&[[41.0, 40.0, 40.0], [40.0, 40.0, 40.0]]),
            ndarray::arr2(&[[91.0, 190.0, 240.0], [240.0, 40.0, 240.0]]),
            1,
        );
        let mean: f32 = (50.0 + 150.0 + 200.0 + 200.0 + 0.0 + 200.0) / 6.0;
        let mut dn = ndarray::arr2(&[[66.0, 115.0, 999.0], [140.0, 50.0, 140.0]]);
        let masked = frames.pixels(&camera()).unwrap().take_out(&mut dn, None, None);
        // All are beside the dead pixel or the full one.
        assert!(masked.iter().all(|m| *m));
        // Single precision.
        const ROUNDING: f32 = 1e-3;
        for (at, want) in [
            ((0, 0), 40.0 + 25.0 * mean / 50.0),
            ((0, 1), 40.0 + 75.0 * mean / 150.0),
            ((0, 2), 1000.0),
            ((1, 0), 40.0 + 100.0 * mean / 200.0),
            ((1, 1), 1000.0),
        ] {
            assert!((dn[at] - want).abs() < ROUNDING, "{at:?}: {}", dn[at]);
        }
    }

    /// A pixel that sees half of the mean is recorded far from full, and stands for more than the sensor counts to.
    #[test]
    fn a_pixel_that_sees_little_is_masked_by_what_it_recorded() {
        let frames = frames(
            Array2::from_elem((2, 3), 40.0),
            ndarray::arr2(&[[110.0, 180.0, 180.0], [180.0, 180.0, 180.0]]),
            1,
        );
        let mut dn = Array2::from_elem((2, 3), 100.0);
        dn[(0, 0)] = 700.0;
        let masked = frames.pixels(&camera()).unwrap().take_out(&mut dn, None, None);
        assert!(dn[(0, 0)] > 1000.0 && masked.iter().all(|m| !*m), "{dn}");
    }

    /// A flat frame that was too bright somewhere tells nothing there, and dead pixels of other filters no matter.
    #[test]
    fn pixels_that_a_flat_frame_does_not_tell_of_are_dead() {
        let green = ColourFilter::Rggb.pixels_of(Some(Colour::Green)).unwrap();
        let camera = RelayCamera {
            filter: ColourFilter::Rggb,
            ..camera()
        };
        let shape = (8, 8);
        // Light of green alone; one green pixel is full.
        let mut flat = Array2::from_shape_fn(shape, |at| if green.has(at) { 240.0 } else { 40.0 });
        let full = (0..8).map(|x| (0, x)).find(|at| green.has(*at)).unwrap();
        flat[full] = 1000.0;
        let pixels = frames(Array2::from_elem(shape, 40.0), flat, 1).pixels(&camera).unwrap();
        let masked = pixels.take_out(&mut Array2::from_elem(shape, 140.0), Some(green), None);
        for (at, masked) in masked.indexed_iter() {
            let near = at.0.abs_diff(full.0) <= 1 && at.1.abs_diff(full.1) <= 1;
            assert_eq!(*masked, near, "{at:?}");
        }
    }

    /// Even light that is not white: pixels of unlike filters are as bright as their filter, and none is a better pixel.
    #[test]
    fn responses_are_relative_to_the_pixels_of_one_filter() {
        let camera = RelayCamera {
            filter: ColourFilter::Rggb,
            ..camera()
        };
        // Red 100, green 300 but for one of 200, blue 50.
        let flat = ndarray::arr2(&[[140.0, 340.0, 140.0], [340.0, 90.0, 240.0]]);
        let frames = frames(Array2::from_elem((2, 3), 40.0), flat, 1);
        let pixels = frames.pixels(&camera).unwrap();
        let green = (300.0 + 300.0 + 200.0) / 3.0;
        // Single precision.
        const ROUNDING: f32 = 1e-6;
        for (at, want) in [
            ((0, 0), 1.0),
            ((0, 1), 300.0 / green),
            ((1, 0), 300.0 / green),
            ((1, 2), 200.0 / green),
            ((1, 1), 1.0),
        ] {
            assert!((pixels.response(at) / want - 1.0).abs() < ROUNDING, "{at:?}");
        }
    }

    /// A pixel that is recorded and corrected many times, with a dark and a flat frame of its own each time, scatters as stated.
    #[test]
    fn the_scatter_of_a_corrected_pixel_is_its_variance() {
        use rand::{RngExt, SeedableRng};
        const DRAWS: usize = 20_000;
        /// Relative: four standard deviations of a variance from so many draws, and that a pixel is part of the mean response.
        const TOLERANCE: f64 = 0.05;
        /// Pixels along an edge: one of them is a hundredth of the mean response.
        const EDGE: usize = 10;
        let camera = camera();
        let (lit, dark_current, signal) = (120.0, 150.0, 60.0);
        let (of_sensor, of_measurement) = (4, 8);
        let even = |dn: f32| Array2::from_elem((EDGE, EDGE), dn);
        let (mut dark, mut flat, mut measurement) = (even(40.0), even(240.0), even(100.0));
        let black = camera.black_level_dn;
        dark[(0, 0)] = (black + dark_current) as f32;
        flat[(0, 0)] = (black + dark_current + lit) as f32;
        let expected = frames(dark.clone(), flat.clone(), of_sensor).pixels(&camera).unwrap();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        // Uniform noise of the variance that a camera has at this level.
        let mut recorded = |dn: f64, frames: u32| {
            let sigma = camera.variance_dn2(dn, frames).sqrt();
            (black + dn + sigma * 12f64.sqrt() * (rng.random::<f64>() - 0.5)) as f32
        };
        let mut values = Vec::new();
        for _ in 0..DRAWS {
            dark[(0, 0)] = recorded(dark_current, of_sensor);
            flat[(0, 0)] = recorded(dark_current + lit, of_sensor);
            measurement[(0, 0)] = recorded(dark_current + signal, of_measurement);
            let mut dn = measurement.clone();
            frames(dark.clone(), flat.clone(), of_sensor)
                .pixels(&camera)
                .unwrap()
                .take_out(&mut dn, None, None);
            values.push(f64::from(dn[(0, 0)]) - black);
        }
        let mean = values.iter().sum::<f64>() / DRAWS as f64;
        let scatter = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / DRAWS as f64;
        let own = expected.own_variance_dn2((0, 0), mean, (of_measurement, 0.0), None);
        let [of_dark, of_flat, _] = expected.shared_errors_dn((0, 0), mean, None).map(|e| e * e);
        let stated = own + of_dark + of_flat;
        assert!((scatter / stated - 1.0).abs() < TOLERANCE, "{scatter} {stated}");
        // None of the three is beside the point.
        for part in [own, of_dark, of_flat] {
            assert!(part > 2.0 * TOLERANCE * stated, "{own} {of_dark} {of_flat}");
        }
    }

    /// A dark frame of its own takes the place of that of all, which the response still rests on.
    #[test]
    fn an_exposure_may_have_a_dark_frame_of_its_own() {
        const ROUNDING: f64 = 1e-5;
        let even = |dn: f32| Array2::from_elem((2, 3), dn);
        let pixels = frames(even(50.0), even(250.0), 4).pixels(&camera()).unwrap();
        // 300 DN of dark current in 16 frames of a long exposure.
        let own = SensorFrame {
            dn: even(340.0),
            frames: 16,
            rounding_dn2: 0.0,
        };
        let own = DarkPixels::new(&own, &camera());
        let mut dn = even(440.0);
        pixels.take_out(&mut dn, None, Some(&own));
        assert!(
            dn.iter().all(|v| (f64::from(*v) - 140.0).abs() < ROUNDING * 140.0),
            "{dn}"
        );
        // What is recorded has the noise of its dark current.
        let variance = pixels.own_variance_dn2((0, 0), 100.0, (8, 0.0), Some(&own));
        assert!((variance - (400.0 + 1.0) / 8.0).abs() < ROUNDING, "{variance}");
        // Half of what the even light shows, over a response of one.
        let errors = pixels.shared_errors_dn((0, 0), 100.0, Some(&own)).map(|e| e * e);
        let want = [
            0.25 * (10.0 + 1.0) / 4.0,
            0.25 * (210.0 + 1.0) / 4.0,
            (300.0 + 1.0) / 16.0,
        ];
        for (error, want) in errors.into_iter().zip(want) {
            assert!((error / want - 1.0).abs() < ROUNDING, "{error} {want}");
        }
    }
}
