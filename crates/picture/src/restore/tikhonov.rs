//! The most likely picture where the slopes of scenes and the noise are normal.

use metalith_core::{Progress, Result};

use super::EXPECTED_SLOPE;
use super::normal::{NormalSystem, Planes, Terms};

/// Steps of conjugate gradients.
pub const ITERATIONS: usize = 8;

pub fn restore(system: &NormalSystem<'_>, progress: &dyn Progress) -> Result<Planes> {
    progress.begin("restoring", ITERATIONS as u64);
    system.solve(system.start(), &system.data, terms(system), ITERATIONS, progress)
}

/// The prior in the unit of the data term.
pub fn terms(system: &NormalSystem<'_>) -> Terms {
    Terms {
        slopes: 1.0 / (EXPECTED_SLOPE.powi(2) * system.scale),
        identity: 0.0,
    }
}
