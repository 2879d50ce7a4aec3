//! The half of a splitting that fits a picture to a frame, and its adjoint.

use metalith_core::{Progress, Result, Silent};
use ndarray::Array2;

use crate::denoiser::Denoiser;
use crate::frame_model::{FrameModel, Planes};
use crate::half_quadratic::{fitted, nearness};
use crate::learned::LearnedDenoiser;
use crate::normal_system::NormalSystem;
use crate::scene_statistics::Terms;

/// Fit of pictures to one frame, by all elements at once: I = argmin 1/2 |A I - S|^2 + mu/2 |I - z|^2 for a picture z.
///
/// Strength and steps are those of the last round of a splitting with a learnt prior.
pub struct FrameFit<'a> {
    system: NormalSystem<'a>,
    terms: Terms,
    steps: usize,
}

impl<'a> FrameFit<'a> {
    /// Fit to a frame: light of each channel in the unit of the operator, and one over the variance of each pixel.
    pub fn new(
        operator: &'a dyn FrameModel,
        light: &[Array2<f32>],
        inverse_variance: &[Array2<f32>],
        prior: &LearnedDenoiser,
    ) -> Self {
        let system = NormalSystem::new(operator, [light, inverse_variance], &operator.all_elements(), true);
        let schedule = prior.schedule();
        Self {
            terms: nearness(&system, &schedule, schedule.deviation(schedule.rounds)),
            steps: schedule.steps,
            system,
        }
    }

    /// Planes of the picture that explains the frame near the planes `z` of another, both in linear light.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn fitted(&self, z: &[Array2<f32>], progress: &dyn Progress) -> Result<Planes> {
        let planes = fitted(&self.system, z, self.terms, self.steps, progress)?;
        Ok(self.system.statistics().picture(&planes))
    }

    /// Gradient over z from the gradient over the fitted picture.
    ///
    /// Conjugate gradients from z give z + P (r - B z), where B is A* W A, r the data, and P the inverse of B + mu as far as
    /// their steps reach. So the gradient g goes back as g - B P g: mu / (B + mu) of it where the steps converge, and all of it
    /// where they do not reach. That P depends on z in the steps is left out.
    pub fn adjoint(&self, gradient: &[Array2<f32>]) -> Planes {
        let statistics = self.system.statistics();
        let right = statistics.adjoint(gradient);
        let solved = self
            .system
            .solve(self.system.black(), &right, self.terms, self.steps, &Silent)
            .expect("nobody stops a silent solver");
        let mut seen = self.system.apply(&solved, Terms::none());
        for (plane, size) in seen.iter_mut().zip(statistics.sizes()) {
            *plane /= size as f32;
        }
        let mut back: Planes = gradient.to_vec();
        for (to, seen) in back.iter_mut().zip(statistics.picture(&seen)) {
            *to -= &seen;
        }
        back
    }
}
