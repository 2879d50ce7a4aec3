//! From a frame back to a picture, classically: in linear light, with kernels that are known.
//!
//! | method | file |
//! | --- | --- |
//! | Tikhonov: the most likely picture where slopes are normal, as a Wiener filter has it for a spectrum of 1 / f^2 | `tikhonov` |
//! | total variation, by the alternating direction method of multipliers | `total_variation` |
//! | Richardson and Lucy | `lucy` |
//! | half-quadratic splitting with any denoiser | `splitting` |
//! | each element alone, blended | `separate` |
//!
//! What is beyond the sensor is not known: pixels that do not exist have no weight, and none is made up. The linear
//! systems of all of them are one, in `normal`.

mod lucy;
mod normal;
mod separate;
mod splitting;
mod tikhonov;
mod total_variation;

use std::str::FromStr;

use metalith_core::{Error, Progress, Result};
use ndarray::Array2;

use crate::operator::FrameOperator;

pub use splitting::{Denoiser, SlopeDenoiser};

/// How a picture is restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestorationMethod {
    Tikhonov,
    TotalVariation,
    RichardsonLucy,
    HalfQuadratic,
}

impl RestorationMethod {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Tikhonov,
        Self::TotalVariation,
        Self::RichardsonLucy,
        Self::HalfQuadratic,
    ];

    /// Name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tikhonov => "tikhonov",
            Self::TotalVariation => "tv",
            Self::RichardsonLucy => "richardson-lucy",
            Self::HalfQuadratic => "hqs",
        }
    }
}

impl FromStr for RestorationMethod {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| {
            Error::invalid(
                format!("`{text}` is no way to restore a picture"),
                "use tikhonov, tv, richardson-lucy or hqs",
            )
        })
    }
}

/// A frame to be restored.
pub struct Recorded<'a> {
    pub operator: &'a FrameOperator<'a>,
    /// Light of each channel in the unit of the operator.
    pub light: &'a [Array2<f32>],
    /// One over the variance of the light of each pixel; zero where nothing is known.
    pub trust: &'a [Array2<f32>],
}

/// Root mean square difference of neighbouring pixels of a picture, in linear light, that is expected: photographs of 500
/// to 800 pixels an axis have 0.03 to 0.08.
pub const EXPECTED_SLOPE: f64 = 0.05;

/// Restore by all elements at once: one scene that explains the whole frame. Planes by channel, white being one.
///
/// # Errors
/// If the user stopped it.
pub fn restore_joint(
    recorded: &Recorded<'_>,
    method: RestorationMethod,
    progress: &dyn Progress,
) -> Result<Vec<Array2<f32>>> {
    let all: Vec<usize> = (0..recorded.operator.elements()).collect();
    restore_by(recorded, method, &all, true, progress)
}

/// Restore by each element alone, then blend.
///
/// # Errors
/// If the user stopped it.
pub fn restore_separate(
    recorded: &Recorded<'_>,
    method: RestorationMethod,
    progress: &dyn Progress,
) -> Result<Vec<Array2<f32>>> {
    separate::restore(recorded, method, progress)
}

/// Variance of the light of each channel at some places of a picture restored by all elements, without any picture: by
/// place, then channel. Trust is that of a frame like the one that is expected.
pub fn expected_variances(recorded: &Recorded<'_>, places: &[(usize, usize)]) -> Vec<Vec<f64>> {
    use rayon::prelude::*;
    let all: Vec<usize> = (0..recorded.operator.elements()).collect();
    let system = normal::NormalSystem::new(recorded, &all, true);
    let terms = tikhonov::terms(&system);
    places.par_iter().map(|p| system.expected_variance(*p, terms)).collect()
}

fn restore_by(
    recorded: &Recorded<'_>,
    method: RestorationMethod,
    elements: &[usize],
    veil: bool,
    progress: &dyn Progress,
) -> Result<Vec<Array2<f32>>> {
    match method {
        RestorationMethod::RichardsonLucy => lucy::restore(recorded, elements, veil, progress),
        _ => {
            let system = normal::NormalSystem::new(recorded, elements, veil);
            match method {
                RestorationMethod::Tikhonov => tikhonov::restore(&system, progress),
                RestorationMethod::TotalVariation => total_variation::restore(&system, progress),
                _ => splitting::restore(&system, &SlopeDenoiser::default(), progress),
            }
        }
    }
}
