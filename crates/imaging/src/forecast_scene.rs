//! A camera tried on a random scene: what a restoration may know of its own errors, and what it will reach, before there is
//! any picture.

use metalith_core::{Progress, Result};
use metalith_restoration::{FrameModel, RestorationMethod, SceneStatistics};
use ndarray::Array2;

use crate::colour::ChannelColours;
use crate::exposure::{counts_channel, expose};
use crate::forecast::{Exposed, Forecast, NaturalScenes};
use crate::imaging_system::ImagingSystem;
use crate::operator::{Detail, FrameOperator, SceneInputs};
use crate::operator_error::OperatorError;
use crate::scene::SceneImage;
use crate::spectra::rgb_basis;

/// Error of the operator of a restoration, found on a random scene with the statistics of photographs.
pub struct ForecastScene {
    /// Error of the operator of the restoration against the simulation.
    pub operator_error: OperatorError,
}

impl ImagingSystem {
    /// Samplings that a photograph in the pixels of the scenes of this system may have, the likeliest first.
    pub fn natural_scenes(&self) -> Vec<NaturalScenes> {
        NaturalScenes::of(&self.given, &self.view)
    }
}

/// Seed of the first scene of a kind and of its noise.
const SEED: u64 = 1;
/// Shorter side of a scene from which on one scene of leaves has edges everywhere (pixels). Below there are two: where a cell of a forecast
/// has no edges, the error of its neighbours counts as its own loss (4 dB for one of 21 photographs of 96 x 96 pixels). Three are as
/// good as two.
const EDGES_EVERYWHERE: usize = 192;

/// Scene of planes of red, green and blue.
fn scene_of(system: &ImagingSystem, planes: Vec<Array2<f32>>) -> SceneImage {
    SceneImage {
        name: "random".into(),
        view: system.view,
        basis: rgb_basis().to_vec(),
        planes,
        left_out: 0.0,
        depth_um: None,
    }
}

/// Light that a scene brings to the sensor, by all that the simulation knows.
fn light_of(system: &ImagingSystem, scene: &SceneImage) -> Vec<Array2<f32>> {
    let simulation = system.operator(Detail {
        inputs: SceneInputs::Spectra(system.primaries()),
        ..system.finest()
    });
    simulation.apply(&scene.planes)
}

impl ForecastScene {
    /// Forecast scene for the operator of a restoration.
    pub fn new(system: &ImagingSystem, restoration: &FrameOperator<'_>) -> Self {
        let shape = (system.view.rows, system.view.columns);
        let scene = scene_of(system, SceneStatistics::colours().random_scene(shape, SEED));
        let light = light_of(system, &scene);
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
        }
    }

    /// Forecast of what is lost of scenes by Tikhonov and all elements: everything that the simulation knows and the
    /// restoration does not, noise, and unfinished iterations. Scenes of leaves are restored without noise, the first with noise too: what
    /// noise adds does not grow with the power of a scene. Leaves have edges, as photographs have: of detail that is as strong
    /// everywhere, more is lost.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn forecast(
        &self,
        system: &ImagingSystem,
        restoration: &FrameOperator<'_>,
        progress: &dyn Progress,
    ) -> Result<Forecast> {
        let shape = (system.view.rows, system.view.columns);
        let error = &self.operator_error;
        let taken = |seed: u64| {
            let scene = scene_of(system, SceneStatistics::colours().leaf_scene(shape, seed));
            let light = light_of(system, &scene);
            let frame = expose(&system.camera, &system.exposure, &light, seed);
            let clean = system.restore_light(restoration, error, &frame, &light, progress)?;
            Ok((frame, [system.truth(&scene), clean]))
        };
        let scenes = if shape.0.min(shape.1) < EDGES_EVERYWHERE { 2 } else { 1 };
        let all = (0..scenes).map(|k| taken(SEED + k)).collect::<Result<Vec<_>>>()?;
        let (frame, [_, clean]) = &all[0];
        let noisy = system.restore(restoration, error, frame, RestorationMethod::Tikhonov, true, progress)?;
        let exposed = Exposed::of(frame.noise, frame.mean_signal());
        let pairs: Vec<_> = all.iter().map(|(_, pair)| pair.each_ref()).collect();
        Ok(Forecast::between(&pairs, &(noisy - clean), exposed))
    }
}
