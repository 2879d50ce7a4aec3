//! Least squares on captures: data, nuisances, the fit, and how far a fit can be trusted.
//!
//! Nothing here knows optics: predictions come from a [`ForwardModel`](crate::forward_model::ForwardModel)
//! through a [`Surrogate`](crate::surrogate::Surrogate).

mod capture_equations;
mod cross_validation;
mod data;
mod intervals;
mod model_error;
mod normal_equations;
mod nuisance_fit;
mod nuisances;
mod null_test;
mod problem;
mod registration;

mod widths;

pub use cross_validation::{Gain, HeldOutErrors, beam_groups, error_of_capture, gain, held_out, mean_error};
pub use data::{CaptureSetup, Data};
pub use intervals::{cautious_half_widths, half_widths};
#[cfg(test)]
pub use model_error::ModelError;
pub use model_error::{WidthParts, change_energy};
pub use normal_equations::{SIGMAS_95, covariance, minimise, projected};
pub use nuisances::Nuisances;
pub use null_test::null_gain;
pub use problem::{Fit, FitProblem};
