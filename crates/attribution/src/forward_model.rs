//! Interface of a simulator for the statistics: parameters in, predictions and reference values out.

use metalith_core::{Progress, Result};

use crate::effect::{Slot, ValueError};
use crate::index::PerMeasurement;
use crate::measurements::Measurements;

/// A smooth change that stands for no effect. Null tests, intervals and the residual map are made of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothTerm {
    /// Coefficient at which the term is simulated, small enough for predictions to be linear in it.
    pub step: f64,
    /// The kind of error of the model that it is, a number of [`ModelError::sizes`]; none of a term that stands for
    /// nothing, which null tests are made of.
    pub kind: Option<usize>,
    /// True if its coefficient is another in each group of [`SmoothGroups`].
    pub by_group: bool,
}

/// Groups of measurements in which some smooth terms have their own coefficients.
#[derive(Clone, Debug)]
pub struct SmoothGroups {
    /// Group of each measurement.
    pub of: PerMeasurement<usize>,
    /// Number of groups.
    pub count: usize,
}

/// Error of the model, as one standard deviation.
#[derive(Clone, Debug)]
pub struct ModelError {
    /// Size of the coefficient of each smooth term of each kind.
    pub sizes: Vec<f64>,
    /// What such errors make of the numbers of a fit, over what terms at random of the same size would.
    pub likeness: f64,
    /// Shapes that the error of what effects change is spread over: the fewer, the more of it looks like an effect. No
    /// fewer than the smooth terms.
    pub shapes: f64,
    /// True if an effect is seen beside the smooth terms where these were simulated, at the stated parameters, and what is
    /// known of the values of each effect counts. If not, the effect is seen as it is where it was found: a prediction
    /// far from what was stated and the change of a stated one do not belong together, and are more alike than they
    /// should be.
    pub by_effect: bool,
}

/// Predictions, and those of models that are sampled more coarsely.
#[derive(Clone, Debug)]
pub struct Coarser<P> {
    pub fine: P,
    /// Each with the share of its difference that the model may err by.
    pub coarse: Vec<(f64, P)>,
}

/// Place at which a forward model is evaluated.
#[derive(Clone, Debug)]
pub struct ParameterPoint {
    /// Value of each parameter, by slot.
    pub theta: Vec<f64>,
    /// The number of a smooth term that is added at its [`SmoothTerm::step`].
    pub smooth: Option<usize>,
}

impl ParameterPoint {
    /// Place without a smooth term.
    pub fn new(theta: Vec<f64>) -> Self {
        Self { theta, smooth: None }
    }

    /// Place with a smooth term.
    pub fn with(theta: &[f64], term: usize) -> Self {
        Self {
            theta: theta.to_vec(),
            smooth: Some(term),
        }
    }
}

/// A forward model whose predictions are those of some measurements.
pub type Model<'a, M> = dyn ForwardModel<Prediction = <M as Measurements>::Prediction> + 'a;

/// A simulator of measurements whose parameters belong to effects.
pub trait ForwardModel: Send + Sync {
    /// Prediction of one measurement.
    type Prediction;

    /// Number of effects.
    fn effects(&self) -> usize;

    /// The name of an effect.
    fn effect_name(&self, effect: usize) -> String;

    /// All parameters of all effects.
    fn slots(&self) -> &[Slot];

    /// True if predictions have a kink where the parameters of an effect are zero, so that one side tells nothing
    /// of the other.
    fn kinked(&self, effect: usize) -> bool;

    /// True if some parameters of an effect change nothing while all are zero.
    fn dormant(&self, _effect: usize) -> bool {
        false
    }

    /// Relative error that the change of a prediction by an effect may have: the difference of correct programs.
    fn error_share(&self, _effect: usize) -> f64 {
        0.0
    }

    /// Error of the value that is found for an effect, besides noise and the smooth terms.
    fn value_error(&self, _effect: usize) -> ValueError {
        ValueError::NONE
    }

    /// Step of a parameter on whose multiples simulations are cheap, because parts of them are likely to be
    /// stored; none where every value costs the same.
    fn cheap_step(&self, slot: usize) -> Option<f64>;

    /// True if simulating other values of a parameter beside those in `about` is so dear that its changes are
    /// rather taken to add to theirs.
    fn is_dear_beside(&self, about: &[f64], slot: usize) -> bool;

    /// Approximate memory of the predictions of all measurements at one point (bytes).
    fn prediction_bytes(&self) -> f64 {
        0.0
    }

    /// Advice to the user on how to need less memory.
    fn memory_hint(&self) -> String {
        "give fewer or smaller measurements, or try fewer effects".into()
    }

    /// Smooth terms that stand for no effect, those of no kind first; none where there are no such terms.
    fn smooth_terms(&self) -> Vec<SmoothTerm>;

    /// Groups of measurements in which smooth terms may have their own coefficients.
    fn smooth_groups(&self) -> SmoothGroups;

    /// Error of the model.
    fn model_error(&self) -> ModelError;

    /// Largest error of the model: a claim must hold in spite of it.
    fn cautious_model_error(&self) -> ModelError {
        self.model_error()
    }

    /// True if a search has taken all the work that it may: it ends, and keeps the best that it found.
    fn is_spent(&self) -> bool {
        false
    }

    /// Predictions at some parameters, and the same with each part of the model sampled more coarsely, with the share of the
    /// difference that the model itself may err by, as one standard deviation. None where no part can be sampled so.
    ///
    /// # Errors
    /// If a simulation fails, or the user stopped it.
    fn coarser(
        &self,
        _theta: &[f64],
        _progress: &dyn Progress,
    ) -> Result<Option<Coarser<PerMeasurement<Self::Prediction>>>> {
        Ok(None)
    }

    /// Predictions of all measurements at each point, before nuisances.
    ///
    /// # Errors
    /// If a simulation fails, or the user stopped it.
    fn predictions(
        &self,
        points: &[ParameterPoint],
        progress: &dyn Progress,
    ) -> Result<Vec<PerMeasurement<Self::Prediction>>>;

    /// Change by the parameters of each value that another instrument measured; none of a value that the model does not
    /// predict.
    fn reference_values(&self, theta: &[f64]) -> Vec<Option<f64>>;

    /// The name of a parameter: the name of its effect, with its axis or number where the effect has several.
    fn slot_name(&self, slot: usize) -> String {
        let Slot { effect, index, .. } = self.slots()[slot];
        let name = self.effect_name(effect);
        match (self.slots_of(effect).len(), index) {
            (1, _) => name,
            (2, index) => format!("{name} {}", ["x", "y"][index]),
            (_, index) => format!("{name} {}", index + 1),
        }
    }

    /// The parameters of an effect.
    fn slots_of(&self, effect: usize) -> Vec<usize> {
        let slots = self.slots();
        (0..slots.len()).filter(|&s| slots[s].effect == effect).collect()
    }

    /// The parameters of some effects, in the order of these.
    fn slots_of_all(&self, effects: &[usize]) -> Vec<usize> {
        effects.iter().flat_map(|&e| self.slots_of(e)).collect()
    }
}
