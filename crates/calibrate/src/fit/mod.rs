//! Least squares on captures: data, nuisances, the fit, and how far a fit can be trusted.
//!
//! Nothing here knows optics: predictions come from a [`ForwardModel`](crate::forward_model::ForwardModel)
//! through a [`Surrogate`](crate::surrogate::Surrogate).

mod capture_equations;
mod cross_validation;
mod data;
mod model_error;
mod normal_equations;
mod nuisances;
mod null_test;
mod problem;
mod registration;

mod widths;

pub use cross_validation::{
    Gain, HeldOutErrors, SIGMAS_95, beam_groups, cautious_half_widths, error_of_capture, gain, half_widths, held_out,
    mean_error,
};
pub use data::{CaptureSetup, Data};
#[cfg(test)]
pub use model_error::ModelError;
pub use model_error::{WidthParts, change_energy, projected};
pub use normal_equations::{covariance, minimise};
pub use nuisances::Nuisances;
pub use null_test::null_gain;
pub use problem::{Fit, FitProblem};
