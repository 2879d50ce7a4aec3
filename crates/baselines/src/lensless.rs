//! Parts that cameras without a lens share: a sensor, light of a flat scene on its pixels, exposure, colours.

use metalith_core::{Error, Progress, Result};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::spectra::{SceneSpectrum, rgb_basis};
use metalith_imaging::{
    ChannelColours, ChosenExposure, Frame, LightStatement, SceneView, counts_channel, expose, without_dispersion,
};
use metalith_sensor::{Camera, Sampling};
use ndarray::{Array2, Array3, Zip};

use crate::baseline_camera::{BaselineCamera, Method, no_stage};
use crate::post_processing::{Stage, StageKind};

/// A sensor in the light of scenes of one size and field, whatever stands before it.
pub struct LenslessBench {
    pub camera: Camera,
    pub view: SceneView,
    pub sampling: Sampling,
    colours: ChannelColours,
    /// Fall-off of light at sines far from the normal, at each pixel of the scene.
    falloff: Array2<f32>,
    exposure: ChosenExposure,
}

/// A camera without a lens: what stands before its sensor, and how a picture is made of its frame.
pub trait Lensless {
    /// The sensor.
    fn bench(&self) -> &LenslessBench;

    /// Name of its method of restoration.
    fn method(&self) -> &'static str;

    /// Light of each channel in each pixel.
    fn light(&self, scene: &SceneImage) -> Vec<Array2<f32>>;

    /// Sent light of each channel from a frame.
    ///
    /// # Errors
    /// If the user stopped it.
    fn sent(&self, frame: &Frame, progress: &dyn Progress) -> Result<Vec<Array2<f32>>>;

    /// Kind of the learnt last stage that can follow.
    fn stage_kind(&self) -> StageKind;

    /// The one that does.
    fn stage(&self) -> Option<&Stage>;

    /// Sent light of each channel from a frame for each of the pictures that this stage sees.
    ///
    /// # Errors
    /// If the user stopped it.
    fn stage_light(&self, frame: &Frame, progress: &dyn Progress) -> Result<Vec<Vec<Array2<f32>>>>;
}

impl<T: Lensless> BaselineCamera for T {
    fn methods(&self) -> Vec<Method> {
        let learnt = self.stage().map(|stage| stage.kind.words());
        let way = |method: &str| Method {
            method: method.into(),
            joint: None,
        };
        [self.method()].into_iter().chain(learnt).map(way).collect()
    }

    fn channel_names(&self) -> Vec<String> {
        self.bench().channel_names()
    }

    fn record_in(&self, scene: &SceneImage, brighter: f64, seed: u64) -> Result<Frame> {
        let bench = self.bench();
        bench.sees(scene)?;
        let exposure = bench.exposure.in_light(&bench.camera, brighter);
        Ok(expose(&bench.camera, &exposure, &Lensless::light(self, scene), seed))
    }

    fn light(&self) -> LightStatement {
        LightStatement::of(&self.bench().camera, &self.bench().exposure, None)
    }

    fn truth(&self, scene: &SceneImage) -> Array3<f64> {
        self.bench().truth(scene)
    }

    fn unrestored(&self, _frame: &Frame) -> Option<Array3<f64>> {
        None
    }

    fn restore(&self, frame: &Frame, way: usize, progress: &dyn Progress) -> Result<Array3<f64>> {
        let bench = self.bench();
        if let Some(stage) = self.stage().filter(|_| way > 0) {
            stage.finish(&self.pictures(frame, stage.kind, progress)?, None)
        } else {
            frame.is_of(bench.frame(), bench.channels())?;
            Ok(bench.picture(&self.sent(frame, progress)?))
        }
    }

    fn pictures(&self, frame: &Frame, kind: StageKind, progress: &dyn Progress) -> Result<Vec<Array3<f64>>> {
        let bench = self.bench();
        if kind != self.stage_kind() {
            return no_stage(kind, "a camera without a lens of another kind");
        }
        frame.is_of(bench.frame(), bench.channels())?;
        let all = self.stage_light(frame, progress)?;
        Ok(all.iter().map(|sent| bench.picture(sent)).collect())
    }
}

/// Wavelengths that visible light is simulated over (nm).
const BAND_NM: [f64; 2] = [400.0, 700.0];

/// A camera of the same kind whose channels count one wavelength each of the light that cameras without a lens are simulated with.
///
/// # Errors
/// If a channel counts no visible light.
pub(crate) fn of_one_wavelength(camera: &Camera) -> Result<Camera> {
    let [low, high] = BAND_NM;
    Ok(without_dispersion(
        camera,
        &camera.sampling(BAND_NM, high - low)?.channels,
    ))
}

/// Field that a flat scene can fill.
const WIDEST_DEG: f64 = 150.0;

impl LenslessBench {
    /// Bench for scenes of this size and field, at wavelengths at most `step_nm` apart. It still has to be given its
    /// exposure.
    ///
    /// # Errors
    /// If a channel counts no visible light, the camera distinguishes no three colours, the sensor is one line of
    /// pixels, or the scene is near.
    pub fn new(camera: &Camera, view: SceneView, step_nm: f64) -> Result<Self> {
        if !(view.field_deg > 0.0 && view.field_deg < WIDEST_DEG) {
            return Err(Error::refused(
                "scene/field-out-of-range",
                format!("a field of {} degrees", view.field_deg),
                format!("give a field of more than 0 and less than {WIDEST_DEG} degrees"),
            ));
        }
        let [rows, columns] = [camera.sensor.rows, camera.sensor.columns];
        if rows.min(columns) < 2 {
            return Err(Error::refused(
                "lensless/sensor-too-small",
                format!("the sensor has {columns} x {rows} pixels, too few for a camera without a lens"),
                "give a sensor of at least 2 x 2 pixels: each colour has its own in a square of these",
            ));
        }
        let sampling = camera.sampling(BAND_NM, step_nm)?;
        let colours = ChannelColours::of(&sampling.channels);
        if !colours.has_colours() {
            return Err(Error::refused(
                "lensless/sensor-without-colours",
                format!("camera `{}` does not record three colours", camera.name),
                "give a camera file with three colour channels",
            ));
        }
        if view.distance_um.is_finite() {
            return Err(Error::refused(
                "lensless/scene-too-near",
                "the scene is at a finite distance, which cameras without a lens are not simulated for",
                "leave out the distance of the scene",
            ));
        }
        let falloff = Array2::from_shape_fn((view.rows, view.columns), |(y, x)| {
            let [tx, ty] = view.tangents(y as f64, x as f64);
            // Light of a far scene arrives at every pixel under the angle of its place.
            let response = camera
                .sensor
                .angular_response
                .at_cosine((1.0 + tx * tx + ty * ty).sqrt().recip());
            (falloff([tx, ty]) * response.max(LEAST_RESPONSE)) as f32
        });
        Ok(Self {
            camera: camera.clone(),
            view,
            sampling,
            colours,
            falloff,
            exposure: ChosenExposure::of_gain(camera, &[]),
        })
    }

    /// This bench with the exposure that the camera asks for in the light of a white scene. `etendue`: area times projected solid
    /// angle of a unit of light in a pixel (um^2 sr).
    ///
    /// # Errors
    /// If none of it reaches the sensor.
    pub fn exposed(mut self, white: &[Array2<f32>], etendue: f64) -> Result<Self> {
        self.exposure = ChosenExposure::new(&self.camera, &self.sampling.channels, white, etendue)?;
        Ok(self)
    }

    /// A white scene.
    pub fn white(&self) -> SceneImage {
        self.scene_of(vec![Array2::ones((self.view.rows, self.view.columns)); 3])
    }

    /// A scene of these planes of red, green and blue.
    pub fn scene_of(&self, planes: Vec<Array2<f32>>) -> SceneImage {
        SceneImage {
            name: String::new(),
            view: self.view,
            basis: rgb_basis().to_vec(),
            planes,
            left_out: 0.0,
            depth_um: None,
        }
    }

    /// Share of what a channel counts that a surface of a spectrum sends it, by wavelength of the sampling; the sum for a
    /// white surface is one.
    pub fn weights(&self, channel: usize, spectrum: &SceneSpectrum) -> Vec<f64> {
        let mut weights = vec![0.0; self.sampling.wavelengths_nm.len()];
        let parts = &self.sampling.channels[channel].parts;
        let all: f64 = parts.iter().map(|p| p.weight).sum();
        let last = weights.len() - 1;
        for part in parts {
            let light = part.weight * spectrum.at(0.5 * (part.nm[0] + part.nm[1])) / all;
            let (i, s) = ((part.place.floor() as usize).min(last), part.place.fract());
            weights[i] += (1.0 - s) * light;
            weights[(i + 1).min(last)] += s * light;
        }
        weights
    }

    /// Weights for a grey surface.
    pub fn grey_weights(&self, channel: usize) -> Vec<f64> {
        let own: Vec<Vec<f64>> = rgb_basis().iter().map(|b| self.weights(channel, b)).collect();
        (0..own[0].len()).map(|i| own.iter().map(|w| w[i]).sum()).collect()
    }

    /// Light that each place of a plane of the scene sends to a flat sensor: less at the border, by the fourth power of
    /// the cosine.
    pub fn sent(&self, plane: &Array2<f32>) -> Array2<f32> {
        plane * &self.falloff
    }

    /// A picture from planes of sent light, one for each channel: linear sRGB `[row, column, colour]`.
    pub fn picture(&self, sent: &[Array2<f32>]) -> Array3<f64> {
        self.colours.rgb(&self.unsent(sent))
    }

    /// Planes of the scene from planes of sent light.
    pub fn unsent(&self, sent: &[Array2<f32>]) -> Vec<Array2<f32>> {
        let one = |plane: &Array2<f32>| Zip::from(plane).and(&self.falloff).map_collect(|p, f| p / f);
        sent.iter().map(one).collect()
    }

    /// Image by a perfect camera with these channels.
    pub fn truth(&self, scene: &SceneImage) -> Array3<f64> {
        self.colours.rgb(&self.ideal(scene))
    }

    /// Light of each channel at each place of the scene, white being one.
    pub fn ideal(&self, scene: &SceneImage) -> Vec<Array2<f32>> {
        ChannelColours::ideal(&self.sampling.channels, scene)
    }

    /// Names of the channels.
    pub fn channel_names(&self) -> Vec<String> {
        self.camera.channel_names()
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.sampling.channels.len()
    }

    /// Rows and columns of the scene.
    pub fn shape(&self) -> (usize, usize) {
        (self.view.rows, self.view.columns)
    }

    /// Rows and columns of the sensor.
    pub fn frame(&self) -> [usize; 2] {
        [self.camera.sensor.rows as usize, self.camera.sensor.columns as usize]
    }

    /// Record light.
    pub fn record(&self, light: &[Array2<f32>], seed: u64) -> Frame {
        expose(&self.camera, &self.exposure, light, seed)
    }

    /// Checks that a scene is one of those that this bench is for.
    ///
    /// # Errors
    /// If it has another size or field.
    pub fn sees(&self, scene: &SceneImage) -> Result<()> {
        if scene.view == self.view {
            Ok(())
        } else {
            Err(Error::refused(
                "scene/views-differ",
                format!("the scene `{}` has another size or field than the first", scene.name),
                "give scenes of one size and field at a time",
            ))
        }
    }

    /// Places of the square of two by two pixels that count a channel; all four where there is no colour filter array.
    pub fn places(&self, channel: usize) -> Vec<[usize; 2]> {
        let names = self.channel_names();
        let filter = self.camera.sensor.filter;
        let all = [[0, 0], [0, 1], [1, 0], [1, 1]];
        all.into_iter()
            .filter(|p| counts_channel(filter, &names, *p, channel))
            .collect()
    }
}

/// Least response by angle: planes of the scene are divided by it.
const LEAST_RESPONSE: f64 = 1e-3;

/// Light of a surface of unit radiance under these tangents, for a unit of tangents and of the sensor, over that along the
/// normal: the projected solid angle d^2 sines / d^2 tangents.
pub(crate) fn falloff([tx, ty]: [f64; 2]) -> f64 {
    (1.0 + tx * tx + ty * ty).powi(-2)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use metalith_restoration::SceneStatistics;
    use metalith_sensor::ColourFilter;

    /// A small camera, a scene of the statistics of photographs.
    pub(crate) fn small(pixels: usize, columns: u32, rows: u32) -> (Camera, SceneImage) {
        let mut camera = Camera::three_bands(5.86);
        (camera.sensor.columns, camera.sensor.rows) = (columns, rows);
        camera.sensor.filter = ColourFilter::Rggb;
        for (channel, name) in camera.channels.iter_mut().zip(["blue", "green", "red"]) {
            channel.name = name.into();
        }
        let view = SceneView {
            rows: pixels,
            columns: pixels,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        };
        let bench = LenslessBench::new(&camera, view, 50.0).unwrap();
        let planes = SceneStatistics::colours().random_scene((view.rows, view.columns), 7);
        let scene = bench.scene_of(planes.iter().map(|p| p.mapv(|v| v.clamp(0.0, 1.0))).collect());
        (camera, scene)
    }

    #[test]
    fn what_a_surface_sends_falls_with_the_fourth_power_of_the_cosine() {
        let angle = 30f64.to_radians();
        // Rounding.
        assert!((falloff([angle.tan(), 0.0]) - angle.cos().powi(4)).abs() < 1e-12);
        let (camera, scene) = small(32, 200, 160);
        let bench = LenslessBench::new(&camera, scene.view, 50.0).unwrap();
        let back = bench.unsent(&[bench.sent(&scene.planes[0])]);
        // Single precision.
        assert!(back[0].iter().zip(&scene.planes[0]).all(|(a, b)| (a - b).abs() < 1e-6));
        for channel in 0..3 {
            assert!((bench.grey_weights(channel).iter().sum::<f64>() - 1.0).abs() < 1e-6);
        }
        assert_eq!(bench.places(1), [[0, 1], [1, 0]]);
    }
}
