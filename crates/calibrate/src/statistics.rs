//! The statistics of attribution, of the measurements of a set.

pub(crate) use metalith_attribution::{
    Coarser, EXPLAINED, ForwardModel, HeldOutErrors, IntervalParts, LEAST_GAIN, LinearTrend, Measurements, ModelError,
    ParameterPoint, Pattern, Rejection, SIGMAS_95, Slot, SmoothGroups, SmoothTerm, TriedEffect, attribute_set,
    cluster_groups, cosines, covariance, error_of_measurement, fit_of, half_widths, held_out, may_leave, mean_error,
    minimise,
};

use crate::data::Data;
use crate::optics::PixelGrid;

pub type FitProblem<'a> = metalith_attribution::FitProblem<'a, Data>;
pub type Fit = metalith_attribution::Fit<Data>;
pub type Surrogate = metalith_attribution::Surrogate<Data>;
pub(crate) type Finding = metalith_attribution::Finding<Data>;
pub type Evidence = metalith_attribution::Evidence<Data>;
pub(crate) type SearchState<'a> = metalith_attribution::SearchState<'a, Data>;
pub(crate) type EndsSearch<'f> = metalith_attribution::EndsSearch<'f, Data>;
pub(crate) type Model<'a> = dyn ForwardModel<Prediction = PixelGrid> + 'a;

/// Refuse measurements whose images a calibration could not hold, before any work is spent on them.
///
/// # Errors
/// With what they would take, and what takes less.
pub fn check_calibration_fits(model: &Model<'_>) -> metalith_core::Result<()> {
    metalith_attribution::check_fits_into_memory::<Data>(model)
}
