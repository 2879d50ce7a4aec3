//! A camera tried on a random scene: what a restoration may know of its own errors, and what it will reach, before there is
//! any picture.

use metalith_core::{Progress, Result};
use metalith_restoration::{FrameModel, SceneStatistics};
use ndarray::Array2;

use crate::colour::ChannelColours;
use crate::exposure::{counts_channel, expose};
use crate::forecast::{Exposed, Forecast, NaturalScenes};
use crate::imaging_system::ImagingSystem;
use crate::operator::{Detail, FrameOperator, SceneInputs};
use crate::operator_error::OperatorError;
use crate::scene::SceneImage;
use crate::spectra::rgb_basis;

/// A scene of the statistics of natural ones, and the light that it brings to the sensor.
pub struct ForecastScene {
    scene: SceneImage,
    light: Vec<Array2<f32>>,
    /// Error of the operator of the restoration against the simulation.
    pub operator_error: OperatorError,
}

impl ImagingSystem {
    /// Samplings that a photograph in the pixels of the scenes of this system may have, the likeliest first.
    pub fn natural_scenes(&self) -> Vec<NaturalScenes> {
        NaturalScenes::of(&self.given, &self.view)
    }
}

/// Seed of the scene and of its noise.
const SEED: u64 = 1;

impl ForecastScene {
    /// Forecast scene for the operator of a restoration.
    pub fn new(system: &ImagingSystem, restoration: &FrameOperator<'_>) -> Self {
        let scene = SceneImage {
            name: "random".into(),
            view: system.view,
            basis: rgb_basis().to_vec(),
            planes: SceneStatistics::colours().random_scene((system.view.rows, system.view.columns), SEED),
            left_out: 0.0,
            depth_um: None,
        };
        let simulation = system.operator(Detail {
            inputs: SceneInputs::Spectra(system.primaries()),
            ..system.finest()
        });
        let light = simulation.apply(&scene.planes);
        drop(simulation);
        let known = if restoration.sees_colours() {
            restoration.apply(&scene.planes)
        } else {
            restoration.apply(&ChannelColours::ideal(&system.channels, &scene))
        };
        let names = system.camera.channel_names();
        let filter = system.camera.sensor.filter;
        let counts = |channel, (y, x)| counts_channel(filter, &names, [y, x], channel);
        Self {
            operator_error: OperatorError::between(&light, &known, counts),
            scene,
            light,
        }
    }

    /// Forecast of what is lost of scenes by Tikhonov and all elements: everything that the simulation knows and the
    /// restoration does not, noise, and unfinished iterations. The random scene is restored twice, with and without
    /// noise: what noise adds does not grow with the power of a scene.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn forecast(
        &self,
        system: &ImagingSystem,
        restoration: &FrameOperator<'_>,
        progress: &dyn Progress,
    ) -> Result<Forecast> {
        let frame = expose(&system.camera, &system.exposure, &self.light, SEED);
        let error = &self.operator_error;
        let [noisy, clean] = system.restore_alike(restoration, error, &frame, &self.light, progress)?;
        let truth = system.truth(&self.scene);
        let exposed = Exposed::of(frame.noise, frame.mean_signal());
        Ok(Forecast::between(&truth, &clean, &(noisy - &clean), exposed))
    }
}
