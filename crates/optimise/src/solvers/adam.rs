//! Adam (Kingma and Ba, 2015) on the phases of the rings, under the limit on their steps.

use crate::rings::phase_step_limit::StepLimit;

/// Decay of the running means of the gradient and of its square, as published.
const DECAY: (f64, f64) = (0.9, 0.999);
/// Keeps the division finite where a gradient has always been zero.
const EPSILON: f64 = 1e-12;

/// Adam under way: phases, and the running means. What a checkpoint holds.
#[derive(Clone, Debug)]
pub struct Adam {
    waves: Vec<f64>,
    mean: Vec<f64>,
    square: Vec<f64>,
    step: u32,
    limit: StepLimit,
    steps: u32,
    rate_waves: f64,
}

impl Adam {
    /// Begin at `waves`, brought within the limit, to climb for `steps` steps. A phase moves by about
    /// `rate_waves` a step at first; the rate falls to a hundredth along half a cosine.
    pub fn new(mut waves: Vec<f64>, limit: StepLimit, steps: u32, rate_waves: f64) -> Self {
        limit.enforce(&mut waves);
        Self {
            mean: vec![0.0; waves.len()],
            square: vec![0.0; waves.len()],
            waves,
            step: 0,
            limit,
            steps,
            rate_waves,
        }
    }

    /// Phase of each ring (waves); every step keeps the limit.
    pub fn waves(&self) -> &[f64] {
        &self.waves
    }

    /// Steps done.
    pub fn step(&self) -> u32 {
        self.step
    }

    /// True if all steps are done.
    pub fn finished(&self) -> bool {
        self.step >= self.steps
    }

    /// The running means, for a checkpoint.
    pub fn means(&self) -> (&[f64], &[f64]) {
        (&self.mean, &self.square)
    }

    /// Go on from a checkpoint: the same result as if never interrupted.
    #[must_use]
    pub fn resume(mut self, step: u32, waves: Vec<f64>, mean: Vec<f64>, square: Vec<f64>) -> Self {
        (self.step, self.waves, self.mean, self.square) = (step, waves, mean, square);
        self
    }

    /// One step up a gradient (1/turn), taken at [`Adam::waves`].
    pub fn climb(&mut self, gradient: &[f64]) {
        self.step += 1;
        let progress = f64::from(self.step) / f64::from(self.steps.max(1));
        let rate = self.rate_waves * (0.505 + 0.495 * (std::f64::consts::PI * progress.min(1.0)).cos());
        let count = f64::from(self.step);
        let (bias1, bias2) = (1.0 - DECAY.0.powf(count), 1.0 - DECAY.1.powf(count));
        for (i, &g) in gradient.iter().enumerate() {
            self.mean[i] = DECAY.0 * self.mean[i] + (1.0 - DECAY.0) * g;
            self.square[i] = DECAY.1 * self.square[i] + (1.0 - DECAY.1) * g * g;
            self.waves[i] += rate * (self.mean[i] / bias1) / ((self.square[i] / bias2).sqrt() + EPSILON);
        }
        self.limit.enforce(&mut self.waves);
    }
}
