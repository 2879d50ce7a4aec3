//! From a frame back to a picture, in linear light, with kernels that are known.
//!
//! | method | file |
//! | --- | --- |
//! | what is known of pictures beforehand | `prior` |
//! | Tikhonov: the most likely picture where light is normal, as a Wiener filter has it | `tikhonov` |
//! | total variation, by the alternating direction method of multipliers | `total_variation` |
//! | Richardson and Lucy | `lucy` |
//! | half-quadratic splitting with any denoiser | `splitting` |
//! | denoisers for it: least total variation, and the learnt prior | `slope`, `learned` |
//! | each element alone, blended | `separate` |
//!
//! What is beyond the sensor is not known: pixels that do not exist have no weight, and none is made up. The linear
//! systems of all of them are one, in `normal`, and `precondition` makes them easier.

mod learned;
mod lucy;
mod normal;
mod precondition;
mod prior;
mod separate;
mod slope;
mod splitting;
mod tikhonov;
mod total_variation;

use std::str::FromStr;

use metalith_core::{Error, Progress, Result};
use ndarray::Array2;

use crate::operator::FrameOperator;

pub use learned::LearnedDenoiser;
pub use prior::{SceneStatistics, squared_frequencies};
pub use separate::{Blend, restore_each, without_veil};
pub use slope::SlopeDenoiser;
pub use splitting::{Denoiser, Schedule};
pub use total_variation::ExponentialSlopes;

/// How a picture is restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestorationMethod {
    Tikhonov,
    TotalVariation,
    RichardsonLucy,
    HalfQuadratic,
    /// Half-quadratic splitting with the learnt prior.
    LearnedPrior,
}

impl RestorationMethod {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Tikhonov,
        Self::TotalVariation,
        Self::RichardsonLucy,
        Self::HalfQuadratic,
        Self::LearnedPrior,
    ];

    /// Those that are named, each once; `wiener` is another name of `tikhonov`, which knows the spectrum of scenes.
    ///
    /// # Errors
    /// If one is no way to restore.
    pub fn of_names(names: &[String]) -> Result<Vec<Self>> {
        let mut methods = Vec::new();
        for name in names {
            let method = name.parse()?;
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        Ok(methods)
    }

    /// Name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tikhonov => "tikhonov",
            Self::TotalVariation => "tv",
            Self::RichardsonLucy => "richardson-lucy",
            Self::HalfQuadratic => "hqs",
            Self::LearnedPrior => "prior",
        }
    }
}

impl FromStr for RestorationMethod {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let known = |m: &Self| m.name() == text || (*m == Self::Tikhonov && text == "wiener");
        Self::ALL.into_iter().find(known).ok_or_else(|| {
            Error::refused(
                "restore/unknown-method",
                format!("`{text}` is no way to restore a picture"),
                "use tikhonov (or wiener, which is the same here), tv, richardson-lucy, hqs or prior",
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
    /// What is known of pictures from photographs.
    pub prior: &'a LearnedDenoiser,
}

/// Restore by all elements at once: one scene that explains the whole frame. Planes as those that go into the operator, white
/// being one.
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

/// Pictures that a frame may be of, one for each seed, by the learnt prior and all elements at once.
///
/// # Errors
/// If the user stopped it.
pub fn restore_samples(
    recorded: &Recorded<'_>,
    seeds: std::ops::Range<u64>,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Array2<f32>>>> {
    let all: Vec<usize> = (0..recorded.operator.elements()).collect();
    let system = normal::NormalSystem::new(recorded, &all, true);
    let drawn = splitting::samples(&system, recorded.prior, seeds, progress)?;
    Ok(drawn.iter().map(|planes| system.statistics().picture(planes)).collect())
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
            let independent = match method {
                RestorationMethod::Tikhonov => tikhonov::restore(&system, progress),
                RestorationMethod::TotalVariation => total_variation::restore(&system, progress),
                RestorationMethod::LearnedPrior => splitting::restore(&system, recorded.prior, progress),
                _ => splitting::restore(&system, &SlopeDenoiser::new(system.statistics()), progress),
            };
            Ok(system.statistics().picture(&independent?))
        }
    }
}
