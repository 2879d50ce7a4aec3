//! A surrogate of the forward model: every parameter simulated at a few values, and interpolated between them.
//!
//! Between the simulated values of a parameter, the change of a prediction is a polynomial. Changes of different
//! parameters add. This holds where effects are small; once an effect is found and a residual is left, the search
//! continues on a surrogate that is centred on what was found, with all other parameters simulated anew.

mod curve;
mod recentred;

use std::sync::Arc;

use metalith_core::{Error, Progress, Result};
use rayon::prelude::*;

use crate::effect::Parameter;
use crate::forward_model::{Model, ParameterPoint, SmoothGroups};
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::Measurements;
use curve::Curve;

/// Multiples of the typical size at which a parameter is simulated, on both sides.
const TWO_SIDED: [f64; 4] = [-2.5, -1.25, 1.25, 2.5];

/// And where it can only be positive.
const ONE_SIDED: [f64; 3] = [0.8, 1.8, 3.5];

/// And beside what was found, on both sides, and where it can only be positive.
const BESIDE: [f64; 2] = [-1.25, 1.25];
const BESIDE_ONE_SIDED: [f64; 2] = [0.8, 2.2];

/// Most that the predictions of one simulation of all parameters may take (bytes). Sets of 36 images of 128 x 128 pixels take
/// 0.4 GB so, and 0.5 to 0.8 GB in all: a search holds predictions about what it finds too.
const MOST_BYTES: f64 = 1.2e10;

/// Limit of extrapolation by a fit, as a multiple of the simulated range.
const EXTRAPOLATION: f64 = 1.6;

/// Predictions at a base point, and how every parameter changes them.
#[derive(Clone)]
pub struct Surrogate<M: Measurements> {
    /// Value of each parameter at the base point, by slot.
    pub about: Vec<f64>,
    /// Predictions there.
    pub base: Arc<PerMeasurement<M::Prediction>>,
    /// Changes with each parameter, by slot.
    curves: Vec<Curve<M>>,
    /// Changes for a unit of each smooth term; a term that differs by group is as many terms as there are groups.
    smooth: Arc<Vec<SmoothChange<M>>>,
    /// The surrogate that smooth terms were simulated with, where this one was centred elsewhere since.
    stated: Option<Arc<Surrogate<M>>>,
    /// True if all parameters that are not dear were simulated about the base point.
    renewed: bool,
    /// Simulations of another search of the same measurements: they are not repeated about the same point.
    elsewhere: Option<Arc<Elsewhere<M>>>,
}

/// Changes with each parameter about a point that another search found.
struct Elsewhere<M: Measurements> {
    /// Value of each parameter there, by slot.
    about: Vec<f64>,
    /// By slot; those of parameters that the other search did not know are not simulated.
    curves: Vec<Curve<M>>,
}

/// Changes of the predictions for a unit of a smooth term.
struct SmoothChange<M: Measurements> {
    /// The kind of error of the model that it is; none of a term that stands for nothing.
    kind: Option<usize>,
    /// None where the term does not act.
    changes: PerMeasurement<Option<M::Prediction>>,
}

impl<M: Measurements> Surrogate<M> {
    /// Simulate every parameter about the values `about`; if `smooth`, the smooth terms as well.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn simulate(model: &Model<'_, M>, about: &[f64], smooth: bool, progress: &dyn Progress) -> Result<Self> {
        Self::simulated(model, about, [&TWO_SIDED, &ONE_SIDED], smooth, progress)
    }

    /// As [`Surrogate::simulate`] with the fewest values of each parameter: enough for derivatives and for effects of about
    /// their typical size.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn beside(model: &Model<'_, M>, about: &[f64], smooth: bool, progress: &dyn Progress) -> Result<Self> {
        Self::simulated(model, about, [&BESIDE, &BESIDE_ONE_SIDED], smooth, progress)
    }

    /// With these multiples of the typical size: of parameters with two sides, and of those that can only be positive.
    fn simulated(
        model: &Model<'_, M>,
        about: &[f64],
        multiples: [&[f64]; 2],
        smooth: bool,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let nodes = nodes_of::<M>(model, about, multiples);
        check_memory::<M>(model, &nodes, smooth)?;
        let mut points = vec![ParameterPoint::new(about.to_vec())];
        for (s, own) in nodes.iter().enumerate() {
            points.extend(own.iter().map(|offset| point_at(about, s, *offset)));
        }
        let smooth_terms = if smooth { model.smooth_terms() } else { Vec::new() };
        points.extend((0..smooth_terms.len()).map(|term| ParameterPoint::with(about, term)));
        let mut predictions = model.predictions(&points, progress)?.into_iter();
        let base = predictions.next().expect("the first point is the base");
        let curves = nodes
            .into_iter()
            .enumerate()
            .map(|(s, nodes)| curve::<M>(model, (about, s), nodes, &mut predictions, &base))
            .collect();
        let mut terms = Vec::new();
        let groups = model.smooth_groups();
        for (predictions, term) in predictions.zip(smooth_terms) {
            let changes = change::<M>(&predictions, &base, 1.0 / term.step as f32);
            let kind = term.kind;
            let expanded = |changes| SmoothChange { kind, changes };
            if term.by_group {
                terms.extend(by_group::<M>(&changes, &groups).map(expanded));
            } else {
                terms.push(expanded(changes.into_iter().map(Some).collect()));
            }
        }
        Ok(Self {
            about: about.to_vec(),
            base: Arc::new(base),
            curves,
            smooth: Arc::new(terms),
            stated: None,
            renewed: false,
            elsewhere: None,
        })
    }

    /// The same predictions for a model with more parameters, of which `known` are simulated here already, by slot. Those that are new
    /// are simulated where the others are zero, as these must be here.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn widened(&self, model: &Model<'_, M>, known: &[Option<usize>], progress: &dyn Progress) -> Result<Self> {
        debug_assert!(self.about.iter().all(|v| *v == 0.0));
        let about = vec![0.0; known.len()];
        let mut points = Vec::new();
        let mut nodes = Vec::new();
        for (s, known) in known.iter().enumerate() {
            let own = match known {
                Some(_) => Vec::new(),
                None => offsets::<M>(model, &about, s, [&TWO_SIDED, &ONE_SIDED]),
            };
            points.extend(own.iter().map(|offset| point_at(&about, s, *offset)));
            nodes.push(own);
        }
        let mut predictions = model.predictions(&points, progress)?.into_iter();
        let curves = nodes.into_iter().zip(known).enumerate();
        let curves = curves.map(|(s, (nodes, known))| match known {
            Some(known) => self.curves[*known].clone(),
            None => curve::<M>(model, (&about, s), nodes, &mut predictions, &self.base),
        });
        Ok(Self {
            curves: curves.collect(),
            about,
            elsewhere: None,
            ..self.clone()
        })
    }

    /// The same, which knows what `other` simulated about its base, if all was simulated there; `known` are its parameters, by slot of
    /// this one.
    #[must_use]
    pub fn knowing(self, other: &Self, known: &[Option<usize>]) -> Self {
        let curves = known
            .iter()
            .map(|k| k.map_or_else(Curve::unknown, |k| other.curves[k].clone()));
        let about = known.iter().map(|k| k.map_or(0.0, |k| other.about[k]));
        let elsewhere = Elsewhere {
            about: about.collect(),
            curves: curves.collect(),
        };
        Self {
            elsewhere: other.renewed.then(|| Arc::new(elsewhere)),
            ..self
        }
    }

    /// Simulate one parameter at more values, where a fit has left the simulated range.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn extend(&mut self, model: &Model<'_, M>, slot: usize, values: &[f64], progress: &dyn Progress) -> Result<()> {
        let points: Vec<_> = values
            .iter()
            .map(|value| {
                let mut theta = self.about.clone();
                theta[slot] = *value;
                ParameterPoint::new(theta)
            })
            .collect();
        for (predictions, value) in model.predictions(&points, progress)?.into_iter().zip(values) {
            let change = change::<M>(&predictions, &self.base, 1.0);
            self.curves[slot].add(value - self.about[slot], change);
        }
        Ok(())
    }

    /// About the values at which smooth terms were simulated.
    #[must_use]
    pub fn stated(&self) -> Self {
        self.stated
            .as_ref()
            .map_or_else(|| self.clone(), |stated| (**stated).clone())
    }

    /// Predictions that no parameter changes.
    pub fn constant(base: PerMeasurement<M::Prediction>) -> Self {
        Self {
            about: Vec::new(),
            base: Arc::new(base),
            curves: Vec::new(),
            smooth: Arc::new(Vec::new()),
            stated: None,
            renewed: false,
            elsewhere: None,
        }
    }

    /// The prediction of a measurement at these parameters.
    pub fn prediction(&self, theta: &[f64], measurement: MeasurementIndex) -> M::Prediction {
        let mut parts = vec![(&self.base[measurement], 1.0)];
        for ((curve, t), about) in self.curves.iter().zip(theta).zip(&self.about) {
            if t != about {
                parts.extend(curve.change(t - about, measurement));
            }
        }
        M::combine(&parts)
    }

    /// Derivative by one of the parameters.
    pub fn derivative(&self, theta: &[f64], slot: usize, measurement: MeasurementIndex) -> M::Prediction {
        let parts: Vec<_> = self.curves[slot]
            .slope(theta[slot] - self.about[slot], measurement)
            .collect();
        M::combine(&parts)
    }

    /// Number of smooth terms that were simulated, in the order of [`ForwardModel::smooth_terms`](crate::ForwardModel::smooth_terms);
    /// each that differs by group counts once for every group.
    pub fn smooth_terms(&self) -> usize {
        self.smooth.len()
    }

    /// Number of smooth terms that stand for nothing: the first of all.
    pub fn null_terms(&self) -> usize {
        self.smooth.iter().take_while(|term| term.kind.is_none()).count()
    }

    /// The kind of error of the model that a smooth term is; none of a term that stands for nothing.
    pub fn kind_of_term(&self, term: usize) -> Option<usize> {
        self.smooth[term].kind
    }

    /// The change for a unit of a smooth term in a measurement with this prediction; zero where it does not act.
    pub fn smooth_term(&self, term: usize, measurement: MeasurementIndex, prediction: &M::Prediction) -> M::Prediction {
        let known = self.smooth[term].changes[measurement].clone();
        known.unwrap_or_else(|| M::combine(&[(prediction, 0.0)]))
    }

    /// Range of a parameter that was simulated.
    pub fn simulated_range(&self, slot: usize) -> (f64, f64) {
        let (low, high) = self.curves[slot].ends();
        (self.about[slot] + low, self.about[slot] + high)
    }

    /// Range of a parameter in which a fit may search.
    pub fn search_range(&self, slot: usize) -> (f64, f64) {
        let (low, high) = self.curves[slot].ends();
        (
            self.about[slot] + EXTRAPOLATION * low,
            self.about[slot] + EXTRAPOLATION * high,
        )
    }
}

/// Refuse measurements whose predictions a search could not hold, before any work is spent on them.
///
/// # Errors
/// With what they would take, and what takes less.
pub fn check_fits_into_memory<M: Measurements>(model: &Model<'_, M>) -> Result<()> {
    let nothing = vec![0.0; model.slots().len()];
    let nodes = nodes_of::<M>(model, &nothing, [&TWO_SIDED, &ONE_SIDED]);
    check_memory::<M>(model, &nodes, true)
}

/// Refuse predictions at these offsets of each parameter, and of smooth terms, that would take too much memory.
fn check_memory<M: Measurements>(model: &Model<'_, M>, nodes: &[Vec<f64>], smooth: bool) -> Result<()> {
    let smooth = if smooth { model.smooth_terms().len() } else { 0 };
    let simulated = 1 + nodes.iter().map(Vec::len).sum::<usize>() + smooth;
    let bytes = simulated as f64 * model.prediction_bytes();
    if bytes <= MOST_BYTES {
        return Ok(());
    }
    Err(Error::refused(
        "calibrate/too-much-memory",
        format!(
            "the predictions of these measurements for {simulated} points in parameters take about {:.0} GB of memory, and a search \
             as much again; at most {:.0} GB are taken for them",
            bytes * 1e-9,
            MOST_BYTES * 1e-9
        ),
        model.memory_hint(),
    ))
}

/// Offsets of each parameter from `about`.
fn nodes_of<M: Measurements>(model: &Model<'_, M>, about: &[f64], multiples: [&[f64]; 2]) -> Vec<Vec<f64>> {
    (0..model.slots().len())
        .map(|s| offsets::<M>(model, about, s, multiples))
        .collect()
}

/// Offsets of one parameter from `about` within its physical range; its ends, if all are beyond them. By multiples of the typical
/// size: where it has two sides, and where it can only be positive.
fn offsets<M: Measurements>(
    model: &Model<'_, M>,
    about: &[f64],
    s: usize,
    [two_sided, one_sided]: [&[f64]; 2],
) -> Vec<f64> {
    let parameter = &model.slots()[s].parameter;
    let Parameter { typical, range, .. } = *parameter;
    let only_positive = parameter.one_sided() && about[s] == 0.0;
    let multiples = if only_positive { one_sided } else { two_sided };
    let offsets = multiples.iter().map(|m| m * typical);
    let within: Vec<f64> = offsets
        .filter(|o| (range.0..=range.1).contains(&(about[s] + o)))
        .collect();
    if !within.is_empty() {
        return within;
    }
    let ends = [range.0 - about[s], range.1 - about[s]];
    ends.into_iter().filter(|o| *o != 0.0).collect()
}

/// Change of the predictions of a base point by one parameter: the next of `predictions` are those at its `nodes`.
fn curve<M: Measurements>(
    model: &Model<'_, M>,
    (about, s): (&[f64], usize),
    nodes: Vec<f64>,
    predictions: &mut impl Iterator<Item = PerMeasurement<M::Prediction>>,
    base: &PerMeasurement<M::Prediction>,
) -> Curve<M> {
    let own = predictions.take(nodes.len());
    let changes: Vec<_> = own.map(|p| change::<M>(&p, base, 1.0)).collect();
    let kinked = model.kinked(model.slots()[s].effect) && about.iter().all(|v| *v == 0.0);
    Curve::new(about[s], nodes, changes, kinked)
}

/// The point at such an offset.
fn point_at(about: &[f64], s: usize, offset: f64) -> ParameterPoint {
    let mut theta = about.to_vec();
    theta[s] += offset;
    ParameterPoint::new(theta)
}

fn change<M: Measurements>(
    predictions: &PerMeasurement<M::Prediction>,
    base: &PerMeasurement<M::Prediction>,
    factor: f32,
) -> PerMeasurement<M::Prediction> {
    let pairs = predictions.raw.par_iter().zip(&base.raw);
    let changes: Vec<M::Prediction> = pairs.map(|(i, b)| M::combine(&[(i, factor), (b, -factor)])).collect();
    changes.into()
}

/// One change for each group, which acts in the measurements of this group alone.
fn by_group<'a, M: Measurements>(
    changes: &'a PerMeasurement<M::Prediction>,
    groups: &'a SmoothGroups,
) -> impl Iterator<Item = PerMeasurement<Option<M::Prediction>>> + 'a {
    (0..groups.count).map(move |own| {
        let pairs = changes.iter().zip(&groups.of);
        pairs.map(|(c, g)| (*g == own).then(|| c.clone())).collect()
    })
}
