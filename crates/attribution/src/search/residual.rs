//! Limit above which a misfit counts as a residual: the search continues above it, and the verdict uses it.

use crate::fit::{Fit, FitProblem, change_energy};
use crate::measurements::Measurements;

/// Smaller gains of reduced chi-square per point are within the error of the forward model itself: two
/// independent programs differ by 0.005 on an object without effects.
pub const LEAST_GAIN: f64 = 0.006;

/// Nothing is left unexplained if the reduced chi-square per point is this, or less: objects with nothing undeclared have up to
/// 1.01, and a weak effect, such as a half of every object displaced by a little, leaves little more.
pub const EXPLAINED: f64 = 1.05;

/// Or what the model may err by in what it found: so many standard deviations of what the effects change, and no more than the other
/// number. A wall that leans by a degree leaves 1.08.
const SIGMAS: f64 = 2.5;
const MOST: f64 = 1.1;

/// The reduced chi-square per point up to which a fit leaves nothing unexplained.
pub fn may_leave<M: Measurements>(problem: &FitProblem<'_, M>, fit: &Fit<M>) -> f64 {
    with_error(change_energy(problem, fit) / problem.points().max(1.0))
}

/// The same where what was found may err by such a reduced chi-square.
fn with_error(energy: f64) -> f64 {
    (1.0 + SIGMAS.powi(2) * energy).clamp(EXPLAINED, MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn little_may_be_left_of_what_is_known_well_and_never_much() {
        assert_eq!([0.0, 0.002, 0.007].map(with_error), [EXPLAINED; 3]);
        assert!((with_error(0.012) - 1.075).abs() < 1e-12);
        assert_eq!(with_error(1.0), MOST);
    }
}
