//! Total variation by the alternating direction method of multipliers ([`SlopeSplit`]): slopes are exponential instead of normal, so that edges cost no more than ramps.

use metalith_core::{Progress, Result};

use crate::frame_model::Planes;
use crate::normal_system::NormalSystem;
use crate::scene_statistics::Terms;
use crate::slope_split::{ExponentialSlopes, SlopeBorder, SlopeLength, SlopeSplit};
use crate::tikhonov;

/// Rounds, and steps of conjugate gradients in each.
const ROUNDS: usize = 6;
const STEPS: usize = 2;
/// Slopes of the grey plane of the statistics of scenes along one axis, and so of the others: photographs have 0.075.
const SLOPES: ExponentialSlopes = ExponentialSlopes { expected: 0.075 };

pub(crate) fn restore(system: &NormalSystem<'_>, progress: &dyn Progress) -> Result<Planes> {
    let terms = Terms {
        slopes: SLOPES.penalty(1.0) / system.scale,
        bends: 0.0,
        identity: 0.0,
    };
    let mut x = tikhonov::restore(system, progress)?;
    progress.begin("restoring by total variation", (ROUNDS * STEPS) as u64);
    let split = || SlopeSplit::new(system.shape(), SLOPES, SlopeLength::Isotropic, SlopeBorder::Even);
    let mut splits: Vec<SlopeSplit> = system.data.iter().map(|_| split()).collect();
    for _ in 0..ROUNDS {
        let mut right = system.data.clone();
        for ((right, split), x) in right.iter_mut().zip(&mut splits).zip(&x) {
            right.scaled_add(terms.slopes as f32, &split.next_goal(x));
        }
        x = system.solve(x, &right, terms, STEPS, progress)?;
    }
    Ok(x)
}
