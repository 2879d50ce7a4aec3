//! Steps down a gradient (Kingma and Ba, Adam, arXiv:1412.6980).

/// Share of what was that stays in the mean of gradients, and in that of their squares.
const BETAS: [f32; 2] = [0.9, 0.999];
/// Keeps a weight without gradient where it is.
const LEAST: f32 = 1e-8;

/// Means of the gradient so far.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Adam {
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl Adam {
    /// Before the first step.
    pub(crate) fn new(weights: usize) -> Self {
        Self {
            first: vec![0.0; weights],
            second: vec![0.0; weights],
        }
    }

    /// Step number `step`, counted from one, of length `rate` a weight.
    pub(crate) fn step(&mut self, weights: &mut [f32], gradient: &[f32], step: u64, rate: f32) {
        let missing = BETAS.map(|s| 1.0 - f64::from(s).powf(step as f64) as f32);
        let means = self.first.iter_mut().zip(&mut self.second);
        for ((weight, g), (first, second)) in weights.iter_mut().zip(gradient).zip(means) {
            *first = BETAS[0] * *first + (1.0 - BETAS[0]) * g;
            *second = BETAS[1] * *second + (1.0 - BETAS[1]) * g * g;
            *weight -= rate * (*first / missing[0]) / ((*second / missing[1]).sqrt() + LEAST);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_finds_the_bottom_of_a_valley_of_unequal_slopes() {
        let mut weights = vec![3.0f32, -2.0];
        let mut adam = Adam::new(2);
        for step in 1..=2000u64 {
            let gradient = [2.0 * (weights[0] - 1.0), 200.0 * (weights[1] - 0.5)];
            adam.step(&mut weights, &gradient, step, 0.02 * (1.0 - step as f32 / 2000.0));
        }
        // A tenth of the length of a step at the beginning.
        assert!(
            (weights[0] - 1.0).abs() < 2e-3 && (weights[1] - 0.5).abs() < 2e-3,
            "{weights:?}"
        );
    }
}
