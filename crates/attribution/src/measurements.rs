//! Interface of measurements for the statistics: residuals, derivatives and nuisances as normal equations, and groups.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::index::{MeasurementIndex, PerMeasurement};

/// Measurements with their noise and their nuisances.
///
/// Nuisances are of two kinds. Those of one measurement alone (where it was taken, for one) are eliminated from its normal
/// equations. Those that measurements share (a gain, an offset) stand first in all normal equations. A prediction is what
/// the forward model says of one measurement before any nuisance acts: an element of a vector space.
pub trait Measurements: Clone + Send + Sync {
    /// Result of the forward model for one measurement.
    type Prediction: Clone + Send + Sync;
    /// The values of all nuisances.
    type Nuisances: Clone + Send + Sync;
    /// The normal equations of one measurement.
    type Equations: MeasurementEquations + Clone + Send + Sync;

    /// The sum of predictions of one measurement, each with its factor.
    fn combine(parts: &[(&Self::Prediction, f32)]) -> Self::Prediction;

    /// The mean square of a prediction or of a change of one.
    fn mean_square(prediction: &Self::Prediction) -> f64;

    /// Number of measurements.
    fn count(&self) -> usize;

    /// Number of points of a measurement that count.
    fn points(&self, measurement: MeasurementIndex) -> usize;

    /// Number of shared nuisances.
    fn shared(&self) -> usize;

    /// Ways of leaving measurements out: for each, the group number of every measurement. Where no way tells any two
    /// measurements apart, each measurement is left out alone in the last way.
    fn folds(&self) -> Vec<PerMeasurement<usize>>;

    /// The cluster of each measurement: those of one cluster are not independent, and are drawn together.
    fn clusters(&self) -> PerMeasurement<usize>;

    /// Ways of giving a parameter a value for each group of measurements: for each, the group number of every measurement.
    fn groupings(&self) -> Vec<PerMeasurement<usize>>;

    /// The nuisances that fit the predictions; measurements that are not `used` do not affect what is shared.
    fn fitted_nuisances(
        &self,
        predictions: &PerMeasurement<Self::Prediction>,
        used: &PerMeasurement<bool>,
    ) -> Self::Nuisances;

    /// Prior knowledge of the shared nuisances, as normal equations of `size` columns about the present values.
    fn prior(&self, nuisances: &Self::Nuisances, size: usize) -> DMatrix<f64>;

    /// The normal equations of a measurement with this prediction; `derivatives` are those of the prediction by further
    /// parameters.
    fn equations(
        &self,
        measurement: MeasurementIndex,
        nuisances: &Self::Nuisances,
        prediction: &Self::Prediction,
        derivatives: &[Self::Prediction],
    ) -> Self::Equations;

    /// Move the nuisances by a step of the shared ones and of further parameters; those of each measurement follow.
    fn advance(
        &self,
        nuisances: &mut Self::Nuisances,
        equations: &PerMeasurement<Self::Equations>,
        step: &DVector<f64>,
    );

    /// Values that another instrument measured.
    fn references(&self) -> &References;

    /// All measurements.
    fn indices(&self) -> impl Iterator<Item = MeasurementIndex> + use<Self> {
        (0..self.count()).map(MeasurementIndex::from)
    }

    /// One value for each measurement, computed in parallel.
    fn for_each<T: Send>(&self, of: impl Fn(MeasurementIndex) -> T + Sync + Send) -> PerMeasurement<T> {
        let all: Vec<T> = (0..self.count())
            .into_par_iter()
            .map(|m| of(MeasurementIndex::from(m)))
            .collect();
        all.into()
    }
}

/// The normal equations of one measurement: inner products of its whitened columns.
pub trait MeasurementEquations {
    /// The products after the nuisances of this measurement alone have been eliminated: shared nuisances, further
    /// parameters, and the residual last.
    fn reduced(&self) -> DMatrix<f64>;
}

/// The inner products that stay when the first `own` columns have been eliminated.
pub fn eliminate(gram: &DMatrix<f64>, own: usize) -> DMatrix<f64> {
    let n = gram.nrows() - own;
    let inner = inverse_of_first(gram, own);
    let cross = gram.view((0, own), (own, n));
    gram.view((own, own), (n, n)) - cross.transpose() * inner * cross
}

/// The best step of the first `own` parameters after those that follow have moved by `step`.
pub fn own_step(gram: &DMatrix<f64>, own: usize, step: &DVector<f64>) -> DVector<f64> {
    let last = gram.ncols() - 1;
    let mut rhs = gram.view((0, last), (own, 1)).into_owned();
    for (j, s) in step.iter().enumerate() {
        for k in 0..own {
            rhs[k] -= gram[(k, own + j)] * s;
        }
    }
    let step = inverse_of_first(gram, own) * rhs;
    step.column(0).into_owned()
}

fn inverse_of_first(gram: &DMatrix<f64>, own: usize) -> DMatrix<f64> {
    let a = gram.view((0, 0), (own, own)).into_owned();
    a.try_inverse().unwrap_or_else(|| DMatrix::zeros(own, own))
}

/// A value that another instrument measured, which the forward model predicts without its own nuisances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceValue {
    /// Measured less stated.
    pub deviation: f64,
    /// One standard deviation.
    pub sigma: f64,
}

/// Values that another instrument measured, with an offset that they share.
#[derive(Clone, Debug)]
pub struct References {
    pub values: Vec<ReferenceValue>,
    /// Standard deviation of the offset.
    pub offset_sigma: f64,
}
