//! The picture that each draw takes of a scene: how near the restored one comes to it.

use std::path::PathBuf;

use metalith_cell::BAND_ORDERS;
use metalith_core::document::{Limits, Section};
use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_gds::extract::Extraction;
use metalith_imaging::scene::{BuiltIn, SceneImage, chart, read_far_scene};
use metalith_imaging::{
    ForecastScene, Frame, FrameOperator, ImagingSystem, OperatorError, SCORED_SIDES, ScenePower, Zone, ZoneScore,
    check_scored, sampling_of, scores,
};
use metalith_optics::{AsBuiltChip, SimulationCase};
use metalith_restoration::RestorationMethod;
use metalith_sensor::Camera;
use ndarray::Array3;

/// Pixels an axis of a built-in scene, if nothing else is said.
const PIXELS: i64 = 512;
/// Angle from the left to the right edge of a scene, if nothing else is said (degrees), as `metalith picture` has it.
const FIELD_DEG: f64 = 90.0;

/// `[picture]` of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureSpec {
    /// The camera file.
    pub camera: PathBuf,
    pub scene: SceneChoice,
    /// Angle from the left to the right edge of the scene (degrees).
    pub field_deg: f64,
    pub method: RestorationMethod,
    pub kernels: KnownKernels,
    /// Places an axis of the field of each element at which kernels are formed; as `metalith picture` has them if left out.
    pub nodes: Option<usize>,
    /// Seed of the noise, equal in all draws: they differ by the chip alone.
    pub seed: u64,
}

/// Scene that pictures are taken of.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneChoice {
    /// A built-in scene of so many pixels an axis.
    BuiltIn(BuiltIn, usize),
    File(PathBuf),
}

/// Chip whose kernels the restoration uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownKernels {
    /// Kernels of the draw: every camera is calibrated.
    Draw,
    /// Kernels of the chip as designed, or as the model of the study has it: no camera is calibrated.
    Design,
}

/// The `[picture]` of a file.
pub(crate) fn picture_spec(s: &Section<'_, '_>) -> PictureSpec {
    let pixels = s.optional_integer(
        "pixels",
        *SCORED_SIDES.start() as i64..=*SCORED_SIDES.end() as i64,
        "pixels",
    );
    let scene = if let Ok(kind) = s.text("scene").parse() {
        SceneChoice::BuiltIn(kind, pixels.unwrap_or(PIXELS) as usize)
    } else {
        if pixels.is_some() {
            s.fault(
                "pixels",
                "an image has its own number of pixels",
                "leave it out, or name a built-in scene: chart, star, edge",
            );
        }
        SceneChoice::File(s.file("scene"))
    };
    let nodes = s.optional_integer("nodes", 3..=65, "places");
    if nodes.is_some_and(|n| n % 2 == 0) {
        s.fault(
            "nodes",
            "an even number of places has none on the axis",
            "give an odd number",
        );
    }
    let methods = RestorationMethod::ALL.map(|m| (m.name(), m));
    PictureSpec {
        camera: s.file("camera"),
        scene,
        field_deg: s.float_or("field_deg", Limits::new(1.0..=174.0, "degrees"), FIELD_DEG),
        method: s.choice("method", &methods, Some(RestorationMethod::Tikhonov)),
        kernels: s.choice(
            "kernels",
            &[("draw", KnownKernels::Draw), ("design", KnownKernels::Design)],
            Some(KnownKernels::Draw),
        ),
        nodes: nodes.map(|n| n as usize),
        seed: s.integer_or("seed", 0..=i64::MAX, "", 1) as u64,
    }
}

/// A scene before a camera, for the chips of all draws.
pub(crate) struct PictureBench {
    spec: PictureSpec,
    camera: Camera,
    scene: SceneImage,
}

/// The chip that a restoration knows when cameras are not calibrated.
pub(crate) struct KnownChip {
    system: ImagingSystem,
    operator_error: OperatorError,
}

/// The picture of one draw.
pub struct TakenPicture {
    /// Image by an ideal camera, linear sRGB `[row, column, colour]`.
    pub truth: Array3<f64>,
    pub frame: Frame,
    /// Linear sRGB `[row, column, colour]`.
    pub restored: Array3<f64>,
    /// Scores by zone.
    pub scores: Vec<ZoneScore>,
    /// Expected PSNR of linear light of scenes with the spectrum of this one (dB), by zone; none of methods without a forecast.
    pub forecast_db: Vec<f64>,
    /// Note on the restoration, if its operator limits it.
    pub note: Option<String>,
    /// Names of the channels of the camera.
    pub channels: Vec<String>,
}

impl PictureBench {
    /// Bench with the camera and the scene that are named.
    ///
    /// # Errors
    /// If one of them cannot be read, or the scene is too small to be scored.
    pub(crate) fn open(spec: &PictureSpec) -> Result<Self> {
        let far = f64::INFINITY;
        let scene = match &spec.scene {
            SceneChoice::BuiltIn(kind, pixels) => chart(*kind, *pixels, spec.field_deg, far),
            SceneChoice::File(path) => read_far_scene(path, spec.field_deg)?,
        };
        check_scored(&scene.view)?;
        Ok(Self {
            camera: Camera::read(&spec.camera)?,
            scene,
            spec: spec.clone(),
        })
    }

    /// Wavelengths (um) and orders at which pictures of a design ask for cells.
    pub(crate) fn colours(&self, design: &Design) -> Result<Vec<(f64, usize)>> {
        let nm = sampling_of(design, &self.camera)?.wavelengths_nm;
        Ok(nm.into_iter().map(|nm| (nm * 1e-3, BAND_ORDERS)).collect())
    }

    /// True if restorations know the chip as designed, not the chip of the draw.
    pub(crate) fn knows_design(&self) -> bool {
        self.spec.kernels == KnownKernels::Design
    }

    fn system(
        &self,
        design: &Design,
        extraction: &Extraction,
        chip: &AsBuiltChip,
        progress: &dyn Progress,
    ) -> Result<ImagingSystem> {
        let case = SimulationCase::from(chip);
        ImagingSystem::of_pillars(
            design,
            extraction,
            case,
            &self.camera,
            &self.scene,
            self.spec.nodes,
            progress,
        )
    }

    /// The chip that restorations of all draws know.
    ///
    /// # Errors
    /// As [`ImagingSystem::of_pillars`].
    pub(crate) fn known(
        &self,
        design: &Design,
        extraction: &Extraction,
        chip: &AsBuiltChip,
        progress: &dyn Progress,
    ) -> Result<KnownChip> {
        let system = self.system(design, extraction, chip, progress)?;
        let operator_error = ForecastScene::new(&system, &system.restoration()).operator_error;
        Ok(KnownChip { system, operator_error })
    }

    /// The picture that a chip takes; `known` is what its restoration knows, itself if left out.
    ///
    /// # Errors
    /// As [`ImagingSystem::of_pillars`] and [`ImagingSystem::restore`].
    pub(crate) fn take(
        &self,
        design: &Design,
        extraction: &Extraction,
        chip: &AsBuiltChip,
        known: Option<&KnownChip>,
        progress: &dyn Progress,
    ) -> Result<TakenPicture> {
        let system = self.system(design, extraction, chip, progress)?;
        let frame = system.record(&system.simulation(), &self.scene, self.spec.seed)?;
        let operator: FrameOperator<'_> = known.map_or(&system, |k| &k.system).restoration();
        let mut forecast_scene = ForecastScene::new(&system, &operator);
        if let Some(known) = known {
            // Nobody knows by how much this chip is another one.
            forecast_scene.operator_error.clone_from(&known.operator_error);
        }
        let method = self.spec.method;
        let restored = system.restore(
            &operator,
            &forecast_scene.operator_error,
            &frame,
            method,
            true,
            progress,
        )?;
        let truth = system.truth(&self.scene);
        let forecast_db = match method {
            RestorationMethod::Tikhonov => forecast_scene
                .forecast(&system, &operator, progress)?
                .psnr_linear_db(&ScenePower::of(&truth)),
            _ => Vec::new(),
        };
        let channels = self.camera.channel_names();
        Ok(TakenPicture {
            scores: scores(&restored, &truth)?,
            truth,
            frame,
            restored,
            forecast_db,
            note: forecast_scene.operator_error.note(&channels),
            channels,
        })
    }
}

impl TakenPicture {
    /// Figures of a draw, by key.
    pub fn figures(&self) -> Vec<(String, f64)> {
        let of = |figure: &str, zone: Zone| match zone {
            Zone::Whole => figure.to_owned(),
            _ => format!("{figure}_{}", zone.name()),
        };
        let each = self.scores.iter().flat_map(|s| {
            [
                (of("picture_psnr_db", s.zone), s.psnr_db),
                (of("picture_psnr_linear_db", s.zone), s.psnr_linear_db),
                (of("picture_ssim", s.zone), s.ssim),
            ]
        });
        let forecast = self.scores.iter().zip(&self.forecast_db);
        each.chain(forecast.map(|(s, db)| (of("forecast_psnr_linear_db", s.zone), *db)))
            .collect()
    }
}
