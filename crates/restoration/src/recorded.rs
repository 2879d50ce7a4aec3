//! A frame and what is known of it.

use ndarray::Array2;

use crate::frame_model::FrameModel;
use crate::learned::LearnedDenoiser;
use crate::normal_system::NormalSystem;

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

impl<'a> Recorded<'a> {
    /// Linear system of some of the elements, with or without the stray light.
    pub(crate) fn system(&self, elements: &[usize], stray_light: bool) -> NormalSystem<'a> {
        let known = [self.light, self.inverse_variance];
        NormalSystem::new(self.operator, known, elements, stray_light)
    }
}
