//! Half-quadratic splitting with any denoiser:
//!
//! I = argmin 1/2 |A I - S|^2 + mu/2 |I - z|^2, z = denoised(I), with mu growing from round to round.

use metalith_core::{Progress, Result};
use ndarray::Array2;

use crate::denoiser::{Denoiser, Schedule};
use crate::frame_model::Planes;
use crate::learned::LearnedDenoiser;
use crate::normal_system::NormalSystem;
use crate::scene_statistics::Terms;
use crate::tikhonov;

/// Rounds before samples are drawn.
const DRAWN_AFTER: usize = 2;

/// State of a splitting.
#[derive(Clone)]
struct SplittingState {
    /// Planes of the system.
    x: Planes,
    /// The picture as the denoiser last gave it.
    near: Option<Planes>,
    rounds: usize,
}

impl SplittingState {
    fn begin(system: &NormalSystem<'_>, progress: &dyn Progress) -> Result<Self> {
        let x = tikhonov::restore(system, progress)?;
        Ok(Self {
            x,
            near: None,
            rounds: 0,
        })
    }

    /// One round; `z` makes a clean picture of one with noise of a deviation.
    fn round(
        &mut self,
        system: &NormalSystem<'_>,
        schedule: &Schedule,
        progress: &dyn Progress,
        z: impl FnOnce(&[Array2<f32>], Option<&[Array2<f32>]>, f64) -> Result<Planes>,
    ) -> Result<()> {
        let statistics = system.statistics();
        let deviation = schedule.deviation(self.rounds);
        let near = z(&statistics.picture(&self.x), self.near.as_deref(), deviation)?;
        let terms = nearness(system, schedule, deviation);
        self.x = fitted(system, &near, terms, schedule.steps, progress)?;
        self.near = Some(near);
        self.rounds += 1;
        Ok(())
    }

    /// All rounds that are left, and a last look of the denoiser: the fitted picture, and the clean one.
    fn finish(
        mut self,
        system: &NormalSystem<'_>,
        denoiser: &dyn Denoiser,
        progress: &dyn Progress,
    ) -> Result<[Planes; 2]> {
        let schedule = denoiser.schedule();
        while self.rounds < schedule.rounds {
            self.round(system, &schedule, progress, |p, near, d| denoiser.denoise(p, near, d))?;
        }
        let statistics = system.statistics();
        let picture = statistics.picture(&self.x);
        let last = denoiser.denoise(&picture, self.near.as_deref(), schedule.deviation(self.rounds))?;
        Ok([self.x, statistics.independent(&last)])
    }
}

/// Weight of the picture that a fitted one stays near, whose noise has a deviation.
pub(crate) fn nearness(system: &NormalSystem<'_>, schedule: &Schedule, deviation: f64) -> Terms {
    Terms {
        identity: schedule.weight / (deviation * deviation * system.scale),
        ..Terms::none()
    }
}

/// Planes of the system that explain the frame and stay near a picture.
pub(crate) fn fitted(
    system: &NormalSystem<'_>,
    near: &[Array2<f32>],
    terms: Terms,
    steps: usize,
    progress: &dyn Progress,
) -> Result<Planes> {
    let statistics = system.statistics();
    let mut right = system.data.clone();
    for (r, z) in right.iter_mut().zip(statistics.adjoint(near)) {
        r.scaled_add(terms.identity as f32, &z);
    }
    system.solve(statistics.independent(near), &right, terms, steps, progress)
}

/// Restores by rounds of both steps: planes of the system by Tikhonov, with which it begins, of the last picture that was fitted to the
/// frame, and of the last clean one.
pub(crate) fn restore(
    system: &NormalSystem<'_>,
    denoiser: &dyn Denoiser,
    progress: &dyn Progress,
) -> Result<[Planes; 3]> {
    let schedule = denoiser.schedule();
    let standing = SplittingState::begin(system, progress)?;
    let first = standing.x.clone();
    progress.begin("restoring by splitting", (schedule.rounds * schedule.steps) as u64);
    let [explaining, clean] = standing.finish(system, denoiser, progress)?;
    Ok([first, explaining, clean])
}

/// Pictures that the frame may be of, one for each seed: after some rounds of the splitting one clean picture is drawn in
/// place of the expected one, and the rest of the rounds holds it to the frame.
pub(crate) fn samples(
    system: &NormalSystem<'_>,
    denoiser: &LearnedDenoiser,
    seeds: std::ops::Range<u64>,
    progress: &dyn Progress,
) -> Result<Vec<Planes>> {
    let schedule = denoiser.schedule();
    let mut standing = SplittingState::begin(system, progress)?;
    let left = schedule.rounds - DRAWN_AFTER;
    let count = (seeds.end - seeds.start) as usize;
    progress.begin(
        "drawing samples",
        ((DRAWN_AFTER + count * left) * schedule.steps) as u64,
    );
    for _ in 0..DRAWN_AFTER {
        standing.round(system, &schedule, progress, |p, near, d| denoiser.denoise(p, near, d))?;
    }
    seeds
        .map(|seed| {
            let mut own = standing.clone();
            own.round(system, &schedule, progress, |p, near, d| {
                denoiser.draw(p, near, d, seed)
            })?;
            let [_, clean] = own.finish(system, denoiser, progress)?;
            Ok(clean)
        })
        .collect()
}
