//! Attribution: from measurements that a model does not predict to the effects that explain the residual.
//!
//! The statistics know no physics. Whoever owns the measurements implements two traits:
//!
//! - [`Measurements`]: the data with their noise, the nuisances of each measurement, which are eliminated, the nuisances
//!   that measurements share, and the groups that measurements form;
//! - [`ForwardModel`]: the effects with their parameters, and predictions of all measurements for parameter values.
//!
//! [`Surrogate`] interpolates the forward model, [`FitProblem`] fits it, and [`attribute_set`] names effects: an effect is
//! taken if it predicts measurements that were left out of the fit, beyond what random smooth terms gain (null test).
//!
//! | file or folder | holds | may use |
//! | --- | --- | --- |
//! | `index`, `effect`, `measurements`, `forward_model` | what the owner of the measurements provides | |
//! | `surrogate` | the forward model, interpolated | the former |
//! | `fit` | least squares, cross-validation, intervals, null test | `surrogate` |
//! | `search` | which effects explain a residual | `fit` |
//! | `linear_trend`, `extent` | values that are linear over a plane | `fit` |
//! | `declared_parameter` | parameters of effects that a file declares | |
//! | `names`, `verdict` | names of effects as users write them, verdict on a set | |
//! | `refit` | selection for forward models that are fitted in full for each candidate | `fit` |

mod declared_parameter;
mod effect;
mod extent;
mod fit;
mod forward_model;
mod index;
mod linear_trend;
mod measurements;
mod names;
mod refit;
mod search;
mod surrogate;
#[cfg(test)]
mod test_model;
mod verdict;

pub use declared_parameter::{DeclaredParameter, MOST_PARAMETERS, keys_of_declared_effects, read_declared_effects};
pub use effect::{Parameter, Slot, ValueError};
pub use extent::Extent;
pub use fit::{
    Fit, FitProblem, Gain, HeldOutErrors, IntervalParts, ModelError, NormalEquations, SIGMAS_95, cautious_half_widths,
    change_energy, cluster_groups, covariance, error_of_measurement, gain, half_widths, held_out, mean_error, minimise,
    null_gain, projected,
};
pub use forward_model::{Coarser, ForwardModel, Model, ParameterPoint, SmoothGroups, SmoothTerm};
pub use index::{MeasurementIndex, PerMeasurement};
pub use linear_trend::LinearTrend;
pub use measurements::{MeasurementEquations, Measurements, ReferenceValue, References, eliminate, own_step};
pub use names::{ConditionalEffect, RENAMED, check_names};
pub use refit::{
    Belonging, GroupValue, LeaveOut, RefitEffect, RefitEquations, RefitErrors, RefitFinding, RefitModel,
    RefitParameter, RefitPlan, RefitRejection, RefitScope, RefitTried, select, try_beside,
};
pub use search::{
    Alternative, EXPLAINED, EndsSearch, Evidence, Finding, LEAST_GAIN, Pattern, REFERENCES_DECIDE, RandomNoise,
    Rejection, SearchState, TriedEffect, attribute_set, cosines, fit_of, may_leave,
};
pub use surrogate::{Surrogate, check_fits_into_memory};
pub use verdict::SetVerdict;
