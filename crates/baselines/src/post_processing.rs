//! Learnt last stages of cameras: which there are, what they see, and which camera each was trained for.

use std::path::Path;
use std::str::FromStr;

use metalith_core::text::hex;
use metalith_core::{Error, Result, srgb};
use metalith_imaging::SceneView;
use metalith_prior::{PictureFit, PostProcessor, Provenance};
use metalith_sensor::Camera;
use ndarray::Array3;
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Kind of the pictures that a network makes one picture of. All have the same layers and, but for the blend, the same
/// number of weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageKind {
    /// Pictures by Tikhonov of a mask's frame, by five strengths: after FlatNet (Khan et al., IEEE Trans. Pattern Anal. Mach.
    /// Intell. 44, 1934 (2022)), whose first stage learns the two matrices themselves.
    FlatNet,
    /// Pictures by a few rounds of total variation of a diffuser's frame, by five strengths: after the unrolled networks of
    /// Monakhova et al. (Opt. Express 27, 28075 (2019)) and Kingshott et al. (Opt. Express 30, 46324 (2022)), which learn the
    /// numbers or the operators of each round too.
    UnrolledDiffuser,
    /// Pictures by Wiener deconvolution of an array's frame, by the kernels of five places: after Multi-Wiener-Net (Yanny et
    /// al., Optica 9, 96 (2022)), which learns the kernels too.
    MultiWiener,
    /// The picture of each element alone, and their blend by the errors that are expected (Chakravarthula et al. 2023).
    Blending,
    /// Pictures of the learnt prior's splitting: the clean one, the one that was fitted to the frame, and the first, by Tikhonov. The
    /// network may be trained through further fits to the frame.
    RefinedPrior,
}

/// Pictures of a frame that the last stage of each baseline camera sees.
pub(crate) const PICTURES: usize = 5;

impl StageKind {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::FlatNet,
        Self::UnrolledDiffuser,
        Self::MultiWiener,
        Self::Blending,
        Self::RefinedPrior,
    ];

    /// Name in options and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::FlatNet => "flatnet",
            Self::UnrolledDiffuser => "unrolled-diffuser",
            Self::MultiWiener => "multi-wiener",
            Self::Blending => "blending",
            Self::RefinedPrior => "refined-prior",
        }
    }

    /// Name in tables: none is the published instrument.
    pub fn words(self) -> &'static str {
        match self {
            Self::FlatNet => "FlatNet-like",
            Self::UnrolledDiffuser => "unrolled ADMM, Kingshott-like",
            Self::MultiWiener => "Multi-Wiener-Net-like",
            Self::Blending => "blending network",
            Self::RefinedPrior => "prior, refined",
        }
    }

    /// True if it is of the chip of a design.
    pub fn is_of_design(self) -> bool {
        matches!(self, Self::MultiWiener | Self::Blending | Self::RefinedPrior)
    }
}

impl FromStr for StageKind {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|k| k.name() == text).ok_or_else(|| {
            Error::refused(
                "compare/unknown-stage",
                format!("there is no last stage `{text}`"),
                "use flatnet, unrolled-diffuser, multi-wiener, blending or refined-prior",
            )
        })
    }
}

/// A last stage with its weights.
#[derive(Clone, Debug)]
pub struct Stage {
    pub kind: StageKind,
    post_processor: PostProcessor,
}

impl Stage {
    /// Stage of a file that `metalith train --stage` wrote.
    ///
    /// # Errors
    /// If it cannot be read, is damaged, or is of another network.
    pub fn read(path: &Path) -> Result<Self> {
        let post_processor = PostProcessor::read(path)?;
        Ok(Self {
            kind: post_processor.provenance().kind.parse()?,
            post_processor,
        })
    }

    /// Provenance: what it was trained for.
    pub fn provenance(&self) -> &Provenance {
        self.post_processor.provenance()
    }

    /// One picture of those that were restored from a frame, all linear sRGB `[row, column, colour]`; `fit` is the fit to the frame of
    /// stages that were trained through it.
    ///
    /// # Errors
    /// If there are more or fewer than it was trained by.
    pub fn finish(&self, pictures: &[Array3<f64>], fit: Option<&dyn PictureFit>) -> Result<Array3<f64>> {
        let shown: Vec<Array3<f32>> = pictures.iter().map(encoded).collect();
        let found = match fit {
            Some(fit) => self.post_processor.finish_fitted(&shown, fit)?,
            None => self.post_processor.finish(&shown)?,
        };
        Ok(found.mapv(|v| srgb::linear(f64::from(v).clamp(0.0, 1.0))))
    }
}

/// Values of sRGB of a picture in linear light.
pub(crate) fn encoded(picture: &Array3<f64>) -> Array3<f32> {
    picture.mapv(|v| srgb::encoded(v) as f32)
}

/// SHA-256 of all that decides frames but the scene and the noise: what stands before the sensor, the sensor and its light, the field.
pub(crate) fn camera_digest(optics: &impl Serialize, camera: &Camera, view: &SceneView) -> Result<String> {
    let field = [view.rows as f64, view.columns as f64, view.field_deg];
    let mut camera = camera.clone();
    camera.exposure = camera.exposure.of_brightness();
    let text = serde_json::to_vec(&(optics, &camera, field))
        .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
    Ok(hex(&Sha256::digest(text)))
}
