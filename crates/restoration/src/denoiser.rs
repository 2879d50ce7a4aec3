//! Denoisers of a splitting.

use metalith_core::Result;
use ndarray::Array2;

use crate::frame_model::Planes;

/// A function that takes noise out of a picture.
pub trait Denoiser: Sync {
    /// Planes of a picture in linear light, white being one, without noise of this standard deviation, which is the same
    /// everywhere. `near` is the picture as it was known before, if it was.
    ///
    /// # Errors
    /// If it cannot take a picture of this size.
    fn denoise(&self, picture: &[Array2<f32>], near: Option<&[Array2<f32>]>, deviation: f64) -> Result<Planes>;

    /// Deviations of the noise that is left in the picture, round by round.
    fn schedule(&self) -> Schedule;
}

/// Rounds of a splitting.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    /// Deviation of the noise in the first round and after the last, in linear light; between them it falls evenly in its
    /// logarithm.
    pub deviations: [f64; 2],
    pub rounds: usize,
    /// Steps of conjugate gradients in each.
    pub steps: usize,
    /// Weight of the denoised picture: over one by the variance of the noise.
    pub weight: f64,
}

impl Schedule {
    /// Deviation of the noise before a round.
    pub(crate) fn deviation(&self, round: usize) -> f64 {
        let [first, last] = self.deviations;
        first * (last / first).powf(round as f64 / self.rounds as f64)
    }
}
