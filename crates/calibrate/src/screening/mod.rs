//! Measurement screening: frames that nothing can be learned from.

mod window_offsets;

use ndarray::Array2;

use crate::data::Nuisances;
use crate::set::{MeasuredSet, MeasurementIndex};
use crate::statistics::{FitProblem, Measurements};
use window_offsets::window_offsets;

/// Share of pixels that are saturated or beside such past which a measurement is left out; fewer are masked. What surrounds a
/// lost peak still tells of distance, path and width; a window that is fuller was exposed for something else.
const MOST_SATURATED: f64 = 0.5;

/// Share of the expected light below which a shutter was closed or a lamp off.
const LEAST_LIGHT: f64 = 0.1;

/// A window this many standard deviations away was moved.
const MOST_SIGMAS: f64 = 8.0;

/// A measurement that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct UnusableMeasurement {
    pub measurement: MeasurementIndex,
    /// Reason, for people.
    pub reason: String,
}

/// Measurements that cannot be used, by a fit of the nuisances to the set as stated.
pub(crate) fn unusable_measurements(
    set: &MeasuredSet,
    problem: &FitProblem<'_>,
    nuisances: &Nuisances,
) -> Vec<UnusableMeasurement> {
    let mut out = Vec::new();
    let registration = set.camera.registration_sigma_px;
    let beyond = window_offsets(set, nuisances);
    for ((c, measurement), beyond) in set.measurements.iter_enumerated().zip(beyond) {
        let pixels = set.seeing_pixels(c);
        let lost = pixels - problem.data.points(c);
        let model = problem.prediction(&problem.surrogate.about, c).pixels([0.0; 2]);
        // Over the pixels that count: a lost peak is no lost light.
        let counted = |light: &Array2<f32>| {
            let pairs = light.iter().zip(&problem.data.weight[c]);
            f64::from(pairs.filter(|(_, w)| **w > 0.0).map(|(v, _)| *v).sum::<f32>())
        };
        let expected = counted(&model) * measurement.scale_dn;
        let seen = counted(&problem.data.signal[c]);
        let reason = if lost as f64 > MOST_SATURATED * pixels as f64 {
            format!("{lost} of its {pixels} pixels are saturated or beside one that is")
        } else if seen < LEAST_LIGHT * expected {
            format!("it holds {:.1} % of the expected light", 100.0 * seen / expected)
        } else if beyond > MOST_SIGMAS * registration {
            format!("its window is {beyond:.1} pixels off; the stated standard deviation is {registration} pixels")
        } else {
            continue;
        };
        out.push(UnusableMeasurement { measurement: c, reason });
    }
    out
}
