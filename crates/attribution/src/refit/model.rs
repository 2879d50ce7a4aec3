//! Input of a selection: effects, a forward model, and the measurements that are fitted.

use nalgebra::DMatrix;

/// A parameter of an effect.
#[derive(Clone, Debug)]
pub struct RefitParameter {
    pub name: String,
    pub unit: &'static str,
    /// Value without an effect.
    pub neutral: f64,
    /// Value that a fit starts from.
    pub start: f64,
    /// Physical limits.
    pub range: (f64, f64),
    /// Number that is shown for a value, rising with it: the width of a blur for its variance.
    pub shown: fn(f64) -> f64,
}

/// An effect that may explain a residual.
#[derive(Clone, Debug)]
pub struct RefitEffect {
    pub name: String,
    /// Parameters, as slots of the model.
    pub slots: Vec<usize>,
    /// Effects that it changes, which must have been taken before.
    pub after: Vec<usize>,
    /// Way of leaving out whose groups have a value each, also those that are not fitted. It is tried after all others.
    pub across: Option<usize>,
}

/// Groups of a way of leaving out in which an effect has to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefitScope {
    /// All measurements together.
    Bench,
    /// Each group of a way: it may make none worse.
    Every { way: usize },
    /// One group of a way, so that the other groups do not predict it.
    One { way: usize, group: usize },
}

/// Normal equations of one measurement over active parameters and the residual, nuisances eliminated.
pub struct RefitEquations {
    /// Sums of squares that a fit minimises.
    pub fit: DMatrix<f64>,
    /// Sums of squares that a prediction is judged by.
    pub judged: DMatrix<f64>,
}

impl RefitEquations {
    /// Equations by which a prediction is fitted and judged alike.
    pub fn alike(form: DMatrix<f64>) -> Self {
        Self {
            judged: form.clone(),
            fit: form,
        }
    }
}

/// A forward model of measurements that is fitted in full for each candidate.
pub trait RefitModel: Sync {
    /// Parameters of all effects, by slot.
    fn parameters(&self) -> &[RefitParameter];

    /// Effects that are tried.
    fn effects(&self) -> &[RefitEffect];

    /// Number of measurements.
    fn count(&self) -> usize;

    /// Number of points of a measurement.
    fn points(&self, measurement: usize) -> f64;

    /// Normal equations of a measurement about parameter values.
    fn equations(&self, measurement: usize, active: &[usize], theta: &[f64]) -> RefitEquations;

    /// Names of the figures of merit that judge a prediction, each with its unit; smaller is better.
    fn figure_names(&self) -> Vec<(&'static str, &'static str)>;

    /// True if two effects at once are tried wherever none alone helps, and not only at the start: a fit must cost next to
    /// nothing.
    fn tries_pairs(&self) -> bool {
        false
    }

    /// True if a fit costs so much that pairs are not tried, and only the candidates that promise most are fitted in each step;
    /// in the last step all are.
    fn is_costly(&self) -> bool {
        false
    }

    /// Least share of the fitted mean square that an effect removes; below it is the error of a model.
    fn least_share(&self) -> f64 {
        0.004
    }

    /// Way of leaving out whose groups are the objects that an effect may belong to.
    fn objects(&self) -> usize {
        0
    }

    /// Number of points of a measurement, and of its repeats, whose residuals err together.
    fn correlated_points(&self, _measurement: usize, _theta: &[f64]) -> f64 {
        1.0
    }

    /// Root mean square that noise makes alone; none where nothing states it.
    fn noise(&self, _theta: &[f64]) -> Option<f64> {
        None
    }

    /// Root mean square by which the model itself errs; zero if it is exact.
    fn model_error(&self, _theta: &[f64]) -> f64 {
        0.0
    }

    /// Groups in which an effect has to hold.
    fn scope(&self, _effect: usize) -> RefitScope {
        RefitScope::Bench
    }

    /// Effect of all groups of which this is the effect of one group.
    fn common(&self, _effect: usize) -> Option<usize> {
        None
    }

    /// Place of a group of a way of leaving out in the order in which groups judge.
    fn group_order(&self, _way: usize, group: usize) -> usize {
        group
    }

    /// Values of the parameters of an effect from which a fit starts, all others as they are.
    fn start(&self, effect: usize, _theta: &[f64]) -> Vec<f64> {
        let slots = self.effects()[effect].slots.iter();
        slots.map(|&slot| self.parameters()[slot].start).collect()
    }

    /// True if the figure of several measurements is their mean; otherwise it is the root of the mean square.
    fn is_mean(&self, _figure: usize) -> bool {
        false
    }

    /// Figures of merit of a measurement.
    fn figures(&self, measurement: usize, theta: &[f64]) -> Vec<f64>;

    /// Name of a group in a way of leaving out.
    fn group_name(&self, _way: usize, group: usize) -> String {
        (group + 1).to_string()
    }

    /// True if a figure refuses an effect: it is of measurements that were never fitted, and the effect makes it worse.
    fn decides(&self, figure: usize) -> bool;
}

/// A way of leaving measurements out.
#[derive(Clone, Debug)]
pub struct LeaveOut {
    /// Common noun of a group: plate, field, height.
    pub name: String,
    /// Group of each measurement.
    pub groups: Vec<usize>,
}

/// Roles of measurements.
#[derive(Clone, Debug)]
pub struct RefitPlan {
    /// True for each measurement that is fitted; the others judge.
    pub fitted: Vec<bool>,
    pub ways: Vec<LeaveOut>,
}
