//! Restoration of a picture from a frame, in linear light, for any linear model of the frame ([`FrameModel`]).
//!
//! ```text
//! FrameModel, light of a frame, inverse variance of each pixel  ->  Recorded
//! Recorded, RestorationMethod                                   ->  planes of the picture
//! ```
//!
//! | question | file |
//! | --- | --- |
//! | what a restoration knows of a camera | `frame_model` |
//! | what is known of pictures beforehand | `scene_statistics` |
//! | random scenes of objects that hide one another | `leaf_scene` |
//! | which methods there are | `method` |
//! | Tikhonov: the most likely picture where light is normal, as a Wiener filter has it | `tikhonov` |
//! | a picture of a coarse model in more pixels | `enlarge` |
//! | total variation, by the alternating direction method of multipliers | `total_variation`, `slope_split` |
//! | Richardson and Lucy | `richardson_lucy` |
//! | half-quadratic splitting with any denoiser | `half_quadratic`, `denoiser` |
//! | its half that fits a picture to a frame, with its adjoint | `frame_fit` |
//! | denoisers for it: least total variation, and the learnt prior | `slope_denoiser`, `learned` |
//! | each element alone, blended | `separate` |
//! | how near one picture is to another | `quality` |
//!
//! Pixels beyond the sensor have no weight, and no light is made up for them. The linear systems of all methods are one, in
//! `normal_system`, and `precondition` makes them easier.

mod denoiser;
mod enlarge;
mod frame_fit;
mod frame_model;
mod half_quadratic;
mod leaf_scene;
mod learned;
mod method;
mod normal_system;
mod precondition;
mod quality;
mod recorded;
mod richardson_lucy;
mod scene_statistics;
mod separate;
mod slope_denoiser;
mod slope_split;
mod tikhonov;
mod total_variation;

use metalith_core::{Progress, Result};

use method::restore_elements;

pub use denoiser::{Denoiser, Schedule};
pub use frame_fit::FrameFit;
pub use frame_model::{FrameModel, Planes};
pub use learned::LearnedDenoiser;
pub use method::RestorationMethod;
pub use normal_system::sums_of_blocks;
pub use quality::{psnr_db, ssim, ssim_colour};
pub use recorded::Recorded;
pub use scene_statistics::{
    GREY_POWER, MEAN_LIGHT, PHOTOGRAPH_PIXELS, SceneStatistics, natural_power, squared_frequencies,
};
pub use separate::{Blend, restore_each, without_stray_light};
pub use slope_denoiser::SlopeDenoiser;
pub use slope_split::{ExponentialSlopes, SlopeBorder, SlopeLength, SlopeSplit};

/// Restore by all elements at once: one scene that explains the whole frame. Planes as those that go into the operator, white
/// being one.
///
/// # Errors
/// If the user stopped it.
pub fn restore_joint(recorded: &Recorded<'_>, method: RestorationMethod, progress: &dyn Progress) -> Result<Planes> {
    let all = recorded.operator.all_elements();
    restore_elements(recorded, method, &all, true, progress)
}

/// Restore by each element alone, then blend.
///
/// # Errors
/// If the user stopped it.
pub fn restore_separate(recorded: &Recorded<'_>, method: RestorationMethod, progress: &dyn Progress) -> Result<Planes> {
    separate::restore(recorded, method, progress)
}

/// Pictures of a splitting with the learnt prior by all elements at once.
#[derive(Clone, Debug)]
pub struct SplittingPictures {
    /// By Tikhonov: what the splitting begins with.
    pub first: Planes,
    /// Fitted to the frame in the last round.
    pub fitted: Planes,
    /// Result: what the denoiser makes of the fitted one.
    pub clean: Planes,
}

/// Restore by the learnt prior and all elements at once, with the pictures on the way.
///
/// # Errors
/// If the user stopped it.
pub fn restore_by_prior(recorded: &Recorded<'_>, progress: &dyn Progress) -> Result<SplittingPictures> {
    let system = recorded.system(&recorded.operator.all_elements(), true);
    let pictures = half_quadratic::restore(&system, recorded.prior, progress)?;
    let [first, fitted, clean] = pictures.map(|planes| system.statistics().picture(&planes));
    Ok(SplittingPictures { first, fitted, clean })
}

/// Pictures that a frame may be of, one for each seed, by the learnt prior and all elements at once.
///
/// # Errors
/// If the user stopped it.
pub fn restore_samples(
    recorded: &Recorded<'_>,
    seeds: std::ops::Range<u64>,
    progress: &dyn Progress,
) -> Result<Vec<Planes>> {
    let all = recorded.operator.all_elements();
    let system = recorded.system(&all, true);
    let drawn = half_quadratic::samples(&system, recorded.prior, seeds, progress)?;
    Ok(drawn.iter().map(|planes| system.statistics().picture(planes)).collect())
}
