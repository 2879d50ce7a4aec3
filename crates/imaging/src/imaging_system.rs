//! A chip, its camera and the field of a scene: everything that pictures of it need, made once or taken from the disk.

use std::borrow::Cow;

use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_design::phase::OpenAreas;
use metalith_restoration::{
    FrameModel, LearnedDenoiser, Recorded, RestorationMethod, SceneStatistics, restore_joint, restore_samples,
    restore_separate,
};
use metalith_sensor::{Camera, ChannelSampling};
use ndarray::{Array2, Array3};
use sha2::{Digest, Sha256};

use crate::approximation_set::ApproximationSet;
use crate::colour::ChannelColours;
use crate::exposure::{ChosenExposure, Frame, expose};
use crate::geometry::{ElementView, SceneSpace, SceneView};
use crate::kernels::KernelBank;
use crate::layout::PillarCount;
use crate::operator::{BetweenNodes, Detail, FrameOperator, SceneInputs, ScenePoints};
use crate::operator_error::OperatorError;
use crate::scene::SceneImage;
use crate::spectra::{SceneSpectrum, rgb_basis};
use crate::stray_light::StrayLight;

/// Imaging system that takes pictures: a chip, its kernels and a camera.
#[derive(Clone)]
pub struct ImagingSystem {
    pub design: Design,
    pub camera: Camera,
    pub bank: KernelBank,
    /// Rule for the kernels between the nodes of the bank, as scenes are simulated.
    pub between: BetweenNodes,
    /// Every how many-th of these nodes a restoration knows.
    pub(crate) restored_step: usize,
    pub stray_light: StrayLight,
    pub elements: Vec<ElementView>,
    pub channels: Vec<ChannelSampling>,
    /// Spectra of the bank: those of the scenes, and the primaries of the restoration among or after them.
    pub basis: Vec<SceneSpectrum>,
    /// Number of them that are the scenes'.
    pub(crate) scene_spectra: usize,
    /// Index where the primaries begin.
    pub(crate) primaries: usize,
    /// View of scenes as they are simulated, and of the pictures that are restored.
    pub view: SceneView,
    /// View of scenes as they are given: another one if their pixels are finer than the points that the sensor's pixels
    /// look at. Then their means over larger ones are simulated, and are the truth that pictures are held to.
    pub given: SceneView,
    /// Count of the pillars of its design that the layout has, if it was counted.
    pub pillars: Option<PillarCount>,
    /// Exposure of the camera behind this chip.
    pub exposure: ChosenExposure,
    pub colours: ChannelColours,
    /// True if kernels and stray light were found on the disk.
    pub from_cache: [bool; 2],
    /// Assumptions in place of what is known; none, unless asked for.
    pub assumed: ApproximationSet,
    /// Learned denoiser, trained on photographs: the shipped one, unless another is put here.
    pub prior: LearnedDenoiser,
}

/// Times what the operator errs by that Tikhonov's method by all elements counts. A wrong kernel errs alike at pixels next to
/// one another, and trust in pixels that are taken to err each for itself is too high. Of 1, 2 and 3 two photographs of
/// 800 x 800 have 20.62, 20.65 and 20.56 dB with all of the physics, and 25.19, 25.91 and 26.28 dB under the paper's
/// assumptions. What starts from such a picture and has its own prior does better with 1 (`prior` 22.33 and 22.14 dB).
const TOGETHER: f64 = 2.0;

impl ImagingSystem {
    /// This system with the exposure that the camera asks for behind it.
    pub(crate) fn exposed(mut self) -> Result<Self> {
        let operator = self.restoration();
        let white = operator.apply(&operator.white());
        drop(operator);
        let lens_um2 = OpenAreas::of(&self.design).lens_um2;
        self.exposure = ChosenExposure::new(&self.camera, &self.channels, &white, lens_um2)?;
        Ok(self)
    }

    /// The way from the planes of a scene to a frame.
    pub fn operator(&self, detail: Detail) -> FrameOperator<'_> {
        self.operator_in(&SceneSpace::flat(&self.view), detail)
    }

    fn operator_in(&self, space: &SceneSpace, detail: Detail) -> FrameOperator<'_> {
        let detail = Detail {
            assumed: self.assumed,
            ..detail
        };
        FrameOperator::new(
            &self.bank,
            &self.stray_light,
            &self.elements,
            &self.camera,
            space,
            detail,
        )
    }

    /// Detail of scenes as finely as they are known.
    pub(crate) fn finest(&self) -> Detail {
        Detail {
            between: self.between,
            ..Detail::simulation(self.scene_spectra)
        }
    }

    /// The way from flat scenes to frames, as finely as it is known: what is taken for the truth.
    pub fn simulation(&self) -> FrameOperator<'_> {
        self.operator(self.finest())
    }

    /// Operator for one scene, with the distances of its pixels if it has them.
    pub fn simulation_of(&self, scene: &SceneImage) -> FrameOperator<'_> {
        let scene = self.simulated(scene);
        let space = match &scene.depth_um {
            Some(depth) => SceneSpace::with_depth(&self.view, depth),
            None => SceneSpace::flat(&self.view),
        };
        self.operator_in(&space, self.finest())
    }

    /// Operator of a restoration, which takes colours of a scene for sums of three primaries. A camera that
    /// distinguishes no colours sees grey.
    pub fn restoration(&self) -> FrameOperator<'_> {
        let primaries = self.primaries();
        let inputs = if self.colours.has_colours() {
            SceneInputs::Spectra(primaries)
        } else {
            SceneInputs::Channels(primaries)
        };
        self.operator(Detail {
            node_step: self.restored_step,
            statistics: self.colours.has_colours().then(|| SceneStatistics::colours().mixing()),
            ..Detail::restoration(ScenePoints::OneASquare, inputs)
        })
    }

    /// Range of the spectra of the bank that are the primaries of a restoration: red, green and blue.
    pub fn primaries(&self) -> std::ops::Range<usize> {
        self.primaries..self.primaries + rgb_basis().len()
    }

    /// A scene in the pixels that it is simulated in: the same scene, unless its own are finer than the sensor tells.
    pub fn simulated<'s>(&self, scene: &'s SceneImage) -> Cow<'s, SceneImage> {
        if scene.view == self.given && self.given != self.view {
            Cow::Owned(scene.averaged(&self.view))
        } else {
            Cow::Borrowed(scene)
        }
    }

    /// The frame that the sensor records of a scene, noise drawn from a seed.
    ///
    /// # Errors
    /// If the scene has other spectra or another field than this was opened for.
    pub fn record(&self, operator: &FrameOperator<'_>, scene: &SceneImage, seed: u64) -> Result<Frame> {
        self.record_in(operator, scene, &self.exposure, seed)
    }

    /// The frame that the sensor records of a scene in an exposure, noise drawn from a seed.
    ///
    /// # Errors
    /// As [`ImagingSystem::record`].
    pub fn record_in(
        &self,
        operator: &FrameOperator<'_>,
        scene: &SceneImage,
        exposure: &ChosenExposure,
        seed: u64,
    ) -> Result<Frame> {
        let scene = self.simulated(scene);
        if scene.view != self.view || scene.basis[..] != self.basis[..self.scene_spectra] {
            return Err(Error::refused(
                "scene/views-differ",
                format!(
                    "the scene `{}` has another size, field or spectra than the first",
                    scene.name
                ),
                "give scenes of one size and field at a time",
            ));
        }
        let light = operator.apply(&scene.planes);
        Ok(expose(&self.camera, exposure, &light, seed))
    }

    /// SHA-256 of all that decides the frame of a scene but its noise: kernels and stray light, elements, camera, field, exposure.
    pub fn digest(&self) -> [u8; 32] {
        let mut hasher = Sha256::new();
        let distinct = self.bank.distinct.iter().map(|d| &d.values);
        for number in distinct.chain([&self.stray_light.values]).flatten() {
            hasher.update(number.to_le_bytes());
        }
        let camera = serde_json::to_vec(&self.camera).expect("plain data serialises");
        hasher.update(camera);
        hasher.update(format!(
            "{:?} {:?} {:?} {:?} {}",
            self.bank.elements,
            self.elements,
            self.view,
            self.exposure.gain,
            self.assumed.digest_text()
        ));
        if self.between != BetweenNodes::Linear {
            hasher.update(format!("{:?}", self.between));
        }
        hasher.finalize().into()
    }

    /// The picture restored from a frame, linear sRGB `[row, column, colour]`.
    ///
    /// # Errors
    /// If the frame is of another camera, or the user stopped it.
    pub fn restore(
        &self,
        operator: &FrameOperator<'_>,
        error: &OperatorError,
        frame: &Frame,
        method: RestorationMethod,
        joint: bool,
        progress: &dyn Progress,
    ) -> Result<Array3<f64>> {
        let [light, inverse_variance] = match (method, joint) {
            (RestorationMethod::Tikhonov, true) => self.known(operator, &error.times(TOGETHER), frame)?,
            _ => self.known(operator, error, frame)?,
        };
        let recorded = self.recorded(operator, &light, &inverse_variance);
        let planes = if joint {
            restore_joint(&recorded, method, progress)?
        } else {
            restore_separate(&recorded, method, progress)?
        };
        Ok(self.picture(operator, &planes))
    }

    /// Picture by Tikhonov's method and all elements of other light on the pixels of a frame, each trusted as far as that of the frame.
    ///
    /// # Errors
    /// As [`ImagingSystem::restore`].
    pub(crate) fn restore_light(
        &self,
        operator: &FrameOperator<'_>,
        error: &OperatorError,
        frame: &Frame,
        light: &[Array2<f32>],
        progress: &dyn Progress,
    ) -> Result<Array3<f64>> {
        let [_, inverse_variance] = self.known(operator, &error.times(TOGETHER), frame)?;
        let recorded = self.recorded(operator, light, &inverse_variance);
        let planes = restore_joint(&recorded, RestorationMethod::Tikhonov, progress)?;
        Ok(self.picture(operator, &planes))
    }

    /// Pictures that a frame may be of, one for each seed, linear sRGB `[row, column, colour]`.
    ///
    /// # Errors
    /// If the frame is of another camera, or the user stopped it.
    pub fn samples(
        &self,
        operator: &FrameOperator<'_>,
        error: &OperatorError,
        frame: &Frame,
        seeds: std::ops::Range<u64>,
        progress: &dyn Progress,
    ) -> Result<Vec<Array3<f64>>> {
        let [light, inverse_variance] = self.known(operator, error, frame)?;
        let recorded = self.recorded(operator, &light, &inverse_variance);
        let drawn = restore_samples(&recorded, seeds, progress)?;
        Ok(drawn.iter().map(|planes| self.picture(operator, planes)).collect())
    }

    fn recorded<'a>(
        &'a self,
        operator: &'a FrameOperator<'_>,
        light: &'a [Array2<f32>],
        inverse_variance: &'a [Array2<f32>],
    ) -> Recorded<'a> {
        Recorded {
            operator,
            light,
            inverse_variance,
            prior: &self.prior,
        }
    }

    /// Light of a frame, and the weight of each pixel.
    fn known(
        &self,
        operator: &FrameOperator<'_>,
        error: &OperatorError,
        frame: &Frame,
    ) -> Result<[Vec<Array2<f32>>; 2]> {
        frame.is_of(operator.frame(), self.exposure.gain.len())?;
        let (light, inverse_variance) = frame.light(&self.camera, error);
        if inverse_variance.iter().flatten().any(|t| *t > 0.0) {
            Ok([light, inverse_variance])
        } else {
            Err(Error::refused(
                "restore/all-saturated",
                "the frame has no information on the scene: every pixel is at full scale",
                "give a scene of which white is 1, or a lower `white` in [exposure] of the camera",
            ))
        }
    }

    /// Planes of a restoration in linear sRGB `[row, column, colour]`.
    pub fn picture(&self, operator: &FrameOperator<'_>, planes: &[Array2<f32>]) -> Array3<f64> {
        if operator.sees_colours() {
            Array3::from_shape_fn((self.view.rows, self.view.columns, 3), |(y, x, c)| {
                f64::from(planes[c][[y, x]])
            })
        } else {
            self.colours.rgb(planes)
        }
    }

    /// A frame as a picture without any restoration, linear sRGB `[row, column, colour]`: pixels where they look, over those
    /// of a white scene.
    pub fn unrestored(&self, operator: &FrameOperator<'_>, frame: &Frame) -> Array3<f64> {
        let (light, inverse_variance) = frame.light(&self.camera, &OperatorError::none(self.exposure.gain.len()));
        self.colours.rgb(&operator.unrestored(&light, &inverse_variance))
    }

    /// Image of a scene by a perfect camera with these channels: the truth that pictures are compared with.
    pub fn truth(&self, scene: &SceneImage) -> Array3<f64> {
        self.colours
            .rgb(&ChannelColours::ideal(&self.channels, &self.simulated(scene)))
    }
}
