//! Total variation by the alternating direction method of multipliers (Boyd et al., Foundations and Trends in Machine
//! Learning 3, 1 (2011), section 6.4): slopes are exponential instead of normal, so that edges cost no more than ramps.

use metalith_core::{Progress, Result};
use ndarray::Array2;

use super::normal::{NormalSystem, Planes, Terms, slopes, slopes_adjoint};
use super::tikhonov;

/// Rounds, and steps of conjugate gradients in each.
const ROUNDS: usize = 6;
const STEPS: usize = 2;
/// Of the grey plane of the statistics of scenes along one axis, and so of the others: photographs have 0.075.
const SLOPES: ExponentialSlopes = ExponentialSlopes { expected: 0.075 };

/// Slopes that follow an exponential law, split off from a picture.
#[derive(Clone, Copy, Debug)]
pub struct ExponentialSlopes {
    /// Root mean square along one axis, from one place to the next.
    pub expected: f64,
}

impl ExponentialSlopes {
    /// Penalty over that of normal slopes: the threshold is then a fifth of what is expected.
    const PENALTY: f64 = 5.0;

    /// Penalty of squared slopes, over the weight of values with this variance.
    pub fn penalty(&self, variance: f64) -> f64 {
        Self::PENALTY * variance / self.expected.powi(2)
    }

    /// Slopes shrink by so much: the price of a slope, at the mean square of a normal law, over its penalty.
    pub fn threshold(&self) -> f64 {
        std::f64::consts::SQRT_2 * self.expected / Self::PENALTY
    }
}

pub fn restore(system: &NormalSystem<'_>, progress: &dyn Progress) -> Result<Planes> {
    let terms = Terms {
        slopes: SLOPES.penalty(1.0) / system.scale,
        bends: 0.0,
        identity: 0.0,
    };
    let threshold = SLOPES.threshold() as f32;
    let mut x = tikhonov::restore(system, progress)?;
    progress.begin("restoring by total variation", (ROUNDS * STEPS) as u64);
    let zero = || Array2::<f32>::zeros(system.shape());
    let mut prices: Vec<[Array2<f32>; 2]> = (0..system.data.len()).map(|_| [zero(), zero()]).collect();
    for _ in 0..ROUNDS {
        let mut right = system.data.clone();
        for (c, price) in prices.iter_mut().enumerate() {
            let own = slopes(&x[c]);
            let sums = [0, 1].map(|a| &own[a] + &price[a]);
            let split = shrunk(&sums, threshold);
            let goal = [0, 1].map(|a| &split[a] * 2.0 - &sums[a]);
            *price = [0, 1].map(|a| &sums[a] - &split[a]);
            right[c].scaled_add(terms.slopes as f32, &slopes_adjoint(&goal));
        }
        x = system.solve(x, &right, terms, STEPS, progress)?;
    }
    Ok(x)
}

/// Slopes made shorter by the threshold, none below zero.
pub fn shrunk(slopes: &[Array2<f32>; 2], threshold: f32) -> [Array2<f32>; 2] {
    let mut out = slopes.clone();
    let [down, right] = &mut out;
    ndarray::Zip::from(down).and(right).for_each(|a, b| {
        let length = a.hypot(*b);
        let keep = if length > threshold {
            1.0 - threshold / length
        } else {
            0.0
        };
        *a *= keep;
        *b *= keep;
    });
    out
}
