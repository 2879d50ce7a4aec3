//! A frame and what is known of it.

use ndarray::Array2;

use crate::frame_model::FrameModel;
use crate::learned::LearnedDenoiser;

/// A frame to be restored.
pub struct Recorded<'a> {
    pub operator: &'a dyn FrameModel,
    /// Light of each channel in the unit of the operator.
    pub light: &'a [Array2<f32>],
    /// One over the variance of the light of each pixel; zero where nothing is known.
    pub inverse_variance: &'a [Array2<f32>],
    /// Prior knowledge of pictures, learnt from photographs.
    pub prior: &'a LearnedDenoiser,
}
