//! Interface of a camera that can be compared.

use metalith_core::{Progress, Result};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{Frame, LightStatement};
use metalith_prior::PictureFit;
use ndarray::Array3;
use serde::{Deserialize, Serialize};

use crate::post_processing::StageKind;

/// One way of making a picture of a frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Method {
    /// Name of the method.
    pub method: String,
    /// True if by all elements at once, false if by each alone; `None` where there is one element.
    pub joint: Option<bool>,
}

impl Method {
    /// Words for tables.
    pub fn words(&self) -> String {
        match self.joint {
            None => self.method.clone(),
            Some(true) => format!("{}, joint", self.method),
            Some(false) => format!("{}, each alone", self.method),
        }
    }
}

/// A camera that is ready to take scenes of one size and field.
pub trait BaselineCamera {
    /// Ways of making a picture of its frames.
    fn methods(&self) -> Vec<Method>;

    /// Names of its channels, in the order of the planes of a frame without a colour filter array.
    fn channel_names(&self) -> Vec<String>;

    /// Limit of its restorations, for a person; `None` where it is the light and the noise of its frames alone.
    fn limits(&self) -> Option<String> {
        None
    }

    /// The frame that its sensor records of a scene, noise drawn from a seed.
    ///
    /// # Errors
    /// If the scene has another size or field than the camera was made ready for.
    fn record(&self, scene: &SceneImage, seed: u64) -> Result<Frame> {
        self.record_in(scene, 1.0, seed)
    }

    /// The frame that its sensor records of a scene in light that is so many times as bright, noise drawn from a seed.
    ///
    /// # Errors
    /// As [`BaselineCamera::record`].
    fn record_in(&self, scene: &SceneImage, brighter: f64, seed: u64) -> Result<Frame>;

    /// Light, time and electrons of its exposure.
    fn light(&self) -> LightStatement;

    /// Image by a perfect camera of the same channels, linear sRGB `[row, column, colour]`.
    fn truth(&self, scene: &SceneImage) -> Array3<f64>;

    /// The frame as a picture, where it is one: linear sRGB of the size of the scene.
    fn unrestored(&self, frame: &Frame) -> Option<Array3<f64>>;

    /// The picture restored from a frame in one of its ways, by its index.
    ///
    /// # Errors
    /// If the frame is of another camera, or the user stopped it.
    fn restore(&self, frame: &Frame, way: usize, progress: &dyn Progress) -> Result<Array3<f64>>;

    /// Pictures of a frame that a learnt last stage sees, linear sRGB, in their order.
    ///
    /// # Errors
    /// If there is no such stage for this camera, the frame is of another one, or the user stopped it.
    fn pictures(&self, frame: &Frame, kind: StageKind, progress: &dyn Progress) -> Result<Vec<Array3<f64>>>;

    /// Fit of pictures to a frame, for stages that are trained through it.
    ///
    /// # Errors
    /// If no stage of this camera needs one, or the frame is of another one.
    fn fit(&self, _frame: &Frame) -> Result<Box<dyn PictureFit + '_>> {
        no_stage(StageKind::RefinedPrior, "this camera")
    }
}

/// Error that a camera has no such last stage.
pub(crate) fn no_stage<T>(kind: StageKind, camera: &str) -> Result<T> {
    Err(metalith_core::Error::refused(
        "compare/stage-not-for-camera",
        format!("the last stage `{}` cannot be used with {camera}", kind.name()),
        "flatnet is for FlatCam, unrolled-diffuser for DiffuserCam, multi-wiener, blending and refined-prior for arrays in colour",
    ))
}
