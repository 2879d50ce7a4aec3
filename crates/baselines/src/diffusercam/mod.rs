//! A camera with a rough surface in place of a lens: what a point of the scene throws on the sensor is the caustic of the
//! surface, wherever the point is, moved and cut off at the border (Antipa et al., Optica 5, 1 (2018)).
//!
//! The simulation has one caustic for each channel and primary of the scene, on the pixels of the sensor. The restoration
//! knows one for each channel, of a grey surface, and the scene on every second pixel.

mod admm;
mod grid;
mod surface;

use admm::{Deconvolution, Descent};
use grid::{CoarseGrid, FineGrid, on_scene};
use metalith_core::{Error, Progress, Result};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::spectra::rgb_basis;
use metalith_imaging::{Frame, OperatorError, SceneView};
use metalith_restoration::SceneStatistics;
use metalith_sensor::Camera;
use ndarray::Array2;
use rayon::prelude::*;
use surface::RoughSurface;

use crate::lensless::{Lensless, LenslessBench};
use crate::post_processing::{PICTURES, Stage, StageKind};

/// A rough surface before a sensor.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DiffuserSpec {
    /// Distance from the surface to the sensor (um).
    pub distance_um: f64,
    /// Distance of the random numbers that the surface is made of (um): bumps are about twice as wide.
    pub grain_um: f64,
    /// Root mean square of what the bumps focus, along one axis, over what would focus on the sensor.
    pub power: f64,
    /// Width and height of its opening, over those of the sensor.
    pub opening: f64,
    /// Seed of its random numbers.
    pub seed: u64,
}

impl DiffuserSpec {
    /// Standard surface: as thin as the array of a prototype; bumps that focus on the sensor; of the openings 0.4,
    /// 0.15, 0.1 and 0.05 the one with the best pictures. Smaller ones are better still, and pinholes.
    pub fn standard() -> Self {
        Self {
            distance_um: 2400.0,
            grain_um: 75.0,
            power: 1.0,
            opening: 0.05,
            seed: 1,
        }
    }

    /// Otherwise the same, at this distance, of this grain (um), with this opening.
    ///
    /// # Errors
    /// If the lengths are not from 1 to 100 000 um, the opening not from 0.01 to 2, or the grain finer than 5 um.
    pub fn new(distance_um: f64, grain_um: f64, opening: f64) -> Result<Self> {
        let lengths = (1.0..=1e5).contains(&distance_um) && (5.0..=1e5).contains(&grain_um);
        if lengths && (0.01..=2.0).contains(&opening) {
            Ok(Self {
                distance_um,
                grain_um,
                opening,
                ..Self::standard()
            })
        } else {
            Err(Error::refused(
                "diffusercam/geometry-out-of-range",
                format!(
                    "the rough surface has a grain of {grain_um} um, a distance of {distance_um} um and an opening of {opening}: one is out of range"
                ),
                "give a distance from 1 to 100000 um, a grain from 5 to 100000 um and an opening from 0.01 to 2",
            ))
        }
    }
}

/// Distance of the wavelengths that caustics are traced at (nm).
const STEP_NM: f64 = 50.0;
/// Material of the surface.
const MATERIAL: &str = "fused_silica_malitson_1965";
/// Rounds for the pictures that the learnt last stage sees: few rounds each, as unrolled networks have, and penalties
/// of slopes from weak to strong, the one that follows from the noise first.
const STAGE_ROUNDS: usize = 10;
const STAGE_SLOPES: [f32; PICTURES] = [1.0, 0.25, 4.0, 0.0625, 16.0];
/// Places along an axis of the scene and the caustic together: 256 MB a plane.
const MOST_PLACES: usize = 8192;
/// Seed of the random scene and of its noise.
const SEED: u64 = 1;

/// A rough surface before a sensor, ready for scenes of one size and field.
pub struct DiffuserCam {
    bench: LenslessBench,
    spec: DiffuserSpec,
    fine: FineGrid,
    /// Solvers by channel.
    solvers: Vec<Deconvolution>,
    /// Error of the operator of the restoration, as a share of the light, by channel.
    error: OperatorError,
    stage: Option<Stage>,
}

impl DiffuserCam {
    /// Camera of a surface before the sensor of a camera.
    ///
    /// # Errors
    /// If the camera distinguishes no colours, the scene is near, no light reaches the sensor, or scene and caustic
    /// have too many places.
    pub fn new(spec: &DiffuserSpec, camera: &Camera, view: SceneView, progress: &dyn Progress) -> Result<Self> {
        let bench = LenslessBench::new(camera, view, STEP_NM)?;
        let pixel = camera.sensor.pixel_um;
        let opening = bench.frame().map(|n| (n as f64 * spec.opening).round() as usize);
        let surface = RoughSurface::new(spec, opening.map(|n| n as f64 * pixel));
        let step = pixel / spec.distance_um;
        let caustic = opening.map(|n| n + 2 * surface.border(pixel));
        let places = FineGrid::places(&view, step, caustic);
        if places > MOST_PLACES {
            return Err(Error::refused(
                "diffusercam/too-large",
                format!("scene and caustic need {places} samples along an axis, more than {MOST_PLACES}"),
                "bring the rough surface nearer to the sensor, make its grain finer, or give a narrower field",
            ));
        }
        let glass = metalith_rcwa::Material::named(MATERIAL)?;
        progress.begin("caustics", bench.sampling.wavelengths_nm.len() as u64);
        let caustics = bench
            .sampling
            .wavelengths_nm
            .par_iter()
            .map(|nm| {
                let bent = spec.distance_um * (glass.index(nm * 1e-3)?.re - 1.0);
                let own = surface.caustic(opening, pixel, bent);
                progress.advance(1);
                Ok(own)
            })
            .collect::<Result<Vec<Array2<f32>>>>()?;
        let mixed = |weights: &[f64]| {
            let mut sum = Array2::<f32>::zeros(caustics[0].dim());
            for (caustic, w) in caustics.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
                sum.scaled_add(*w as f32, caustic);
            }
            sum
        };
        let kernels: Vec<Vec<Array2<f32>>> = (0..bench.channels())
            .map(|c| rgb_basis().iter().map(|b| mixed(&bench.weights(c, b))).collect())
            .collect();
        let fine = FineGrid::new(&view, step, bench.frame(), &kernels);
        let solvers = (0..bench.channels())
            .into_par_iter()
            .map(|c| {
                let grey = mixed(&bench.grey_weights(c));
                let coarse = CoarseGrid::new(&fine, &grey, &bench.places(c));
                Deconvolution::new(coarse)
            })
            .collect();
        let mut camera = Self {
            bench,
            spec: *spec,
            fine,
            solvers,
            error: OperatorError::default(),
            stage: None,
        };
        let white = camera.light(&camera.bench.white());
        // A caustic is a share of the light of the opening, from a place of the scene a step wide.
        let open_um2 = (opening[0] * opening[1]) as f64 * pixel * pixel;
        camera.bench = camera.bench.exposed(&white, open_um2 * step * step)?;
        camera.error = camera.operator_error();
        Ok(camera)
    }

    /// This camera with a learnt last stage behind it.
    #[must_use]
    pub fn with_stage(mut self, stage: Option<Stage>) -> Self {
        self.stage = stage;
        self
    }

    /// Light of each channel sent by the scene, by descent.
    fn sent_by(&self, frame: &Frame, descents: &[Descent], progress: &dyn Progress) -> Result<Vec<Vec<Array2<f32>>>> {
        let (_, inverse_variance) = frame.light(&self.bench.camera, &self.error);
        let light = frame.recorded_light(&self.bench.camera);
        let rounds: usize = descents.iter().map(|d| d.rounds).sum();
        progress.begin("restoring by total variation", (rounds * light.len()) as u64);
        let step = 2.0 * self.bench.camera.sensor.pixel_um / self.spec.distance_um;
        let one = |descent: &Descent| {
            light
                .par_iter()
                .zip(&inverse_variance)
                .zip(&self.solvers)
                .map(|((light, inverse_variance), solver)| {
                    let variance = solver.grid().variance(inverse_variance);
                    let found = solver.solve(&solver.grid().data(light), variance, *descent, progress)?;
                    Ok(on_scene(&found, step, &self.bench.view))
                })
                .collect()
        };
        descents.iter().map(one).collect()
    }

    /// Root mean square difference of what the restoration knows and the simulation on a random scene, over the light.
    fn operator_error(&self) -> OperatorError {
        let planes = SceneStatistics::colours().random_scene(self.bench.shape(), SEED);
        let scene = self.bench.scene_of(planes);
        let light = self.light(&scene);
        let ideal = self.bench.ideal(&scene);
        let overall = (0..light.len())
            .into_par_iter()
            .map(|c| {
                let solver = &self.solvers[c];
                let seen = solver.grid().data(&light[c]);
                let known = solver.seen(&solver.grid().sampled(&self.bench.sent(&ideal[c]), &self.bench.view));
                let off: f64 = seen.iter().zip(&known).map(|(a, b)| f64::from(a - b).powi(2)).sum();
                let all: f64 = seen.iter().map(|v| f64::from(*v).powi(2)).sum();
                (off / all.max(f64::MIN_POSITIVE)).sqrt()
            })
            .collect();
        OperatorError::uniform(overall)
    }
}

impl Lensless for DiffuserCam {
    fn bench(&self) -> &LenslessBench {
        &self.bench
    }

    fn method(&self) -> &'static str {
        "tv"
    }

    fn light(&self, scene: &SceneImage) -> Vec<Array2<f32>> {
        let sent: Vec<Array2<f32>> = scene
            .planes
            .par_iter()
            .map(|p| self.fine.sampled(&self.bench.sent(p), &scene.view))
            .collect();
        self.fine.frames(&sent)
    }

    fn sent(&self, frame: &Frame, progress: &dyn Progress) -> Result<Vec<Array2<f32>>> {
        Ok(self.sent_by(frame, &[Descent::WHOLE], progress)?.remove(0))
    }

    fn stage_kind(&self) -> StageKind {
        StageKind::UnrolledDiffuser
    }

    fn stage(&self) -> Option<&Stage> {
        self.stage.as_ref()
    }

    fn stage_light(&self, frame: &Frame, progress: &dyn Progress) -> Result<Vec<Vec<Array2<f32>>>> {
        let descents = STAGE_SLOPES.map(|slopes| Descent {
            rounds: STAGE_ROUNDS,
            slopes,
        });
        self.sent_by(frame, &descents, progress)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline_camera::BaselineCamera;
    use crate::lensless::tests::small;
    use metalith_core::Silent;
    use metalith_imaging::scores;

    #[test]
    fn a_picture_comes_out_of_a_caustic() {
        /// A flat picture of the right brightness has 14 dB.
        const LEAST_DB: f64 = 19.0;
        /// Between the grid of the simulation and that of the restoration, twice as coarse.
        const OPERATOR: f64 = 0.1;
        let (camera, scene) = small(64, 300, 260);
        let spec = DiffuserSpec {
            distance_um: 400.0,
            grain_um: 40.0,
            opening: 0.4,
            ..DiffuserSpec::standard()
        };
        let diffuser = DiffuserCam::new(&spec, &camera, scene.view, &Silent).unwrap();
        assert!(
            diffuser.error.overall.iter().all(|e| *e < OPERATOR),
            "{:?}",
            diffuser.error.overall
        );
        let frame = diffuser.record(&scene, 1).unwrap();
        let picture = diffuser.restore(&frame, 0, &Silent).unwrap();
        let found = scores(&picture, &diffuser.truth(&scene)).unwrap()[0];
        assert!(found.psnr_linear_db > LEAST_DB, "{found:?}");
        // Ten rounds of the eighty lose less than this.
        const UNROLLED_DB: f64 = 3.0;
        let all = diffuser.pictures(&frame, StageKind::UnrolledDiffuser, &Silent).unwrap();
        let first = scores(&all[0], &diffuser.truth(&scene)).unwrap()[0];
        assert!(all.len() == PICTURES && all[1] != all[0]);
        assert!(
            first.psnr_linear_db > found.psnr_linear_db - UNROLLED_DB,
            "{first:?} {found:?}"
        );
    }
}
