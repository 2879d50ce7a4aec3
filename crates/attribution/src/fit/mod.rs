//! Least squares on measurements, and how far a fit can be trusted.

mod cross_validation;
mod intervals;
mod model_error;
pub(crate) mod normal_equations;
mod null_test;
mod problem;
mod references;

pub use crate::forward_model::ModelError;
pub use cross_validation::{Gain, HeldOutErrors, cluster_groups, error_of_measurement, gain, held_out, mean_error};
pub use intervals::{cautious_half_widths, half_widths};
pub(crate) use model_error::sampling_half_widths;
pub use model_error::{IntervalParts, change_energy};
pub use normal_equations::{NormalEquations, SIGMAS_95, covariance, minimise, projected};
pub use null_test::null_gain;
pub use problem::{Fit, FitProblem};
