//! A forward model with closed forms, for tests: each parameter changes the predictions by one cosine pattern.
//!
//! All patterns have whole numbers of periods over the window: they are orthogonal to one another, to the
//! common base, to its slopes and to a constant. So the normal equations are diagonal, and everything
//! that the statistics answer can be written down.

mod samples;
mod waves;

use metalith_core::{Progress, Result, Silent};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) use samples::{SCALE, SIGMA, Samples, Setup};
pub(crate) use waves::{POINTS, Waves};

use crate::effect::{Parameter, Slot};
use crate::fit::FitProblem;
use crate::forward_model::{ForwardModel, ModelError, ParameterPoint, SmoothGroups, SmoothTerm};
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::References;
use crate::surrogate::Surrogate;

/// Contrast of the base along each axis; it gives the place of the window something to hold on to.
const BASE_CONTRAST: f64 = 0.4;

/// Smooth terms that stand for nothing, and those of each kind of error of the model.
pub(crate) const NULL_TERMS: usize = 11;
const TERMS_OF_KIND: usize = 3;

/// The kind of error whose first term has the pattern of [`ERROR_PERIODS`], and its size.
const ERROR_KIND: usize = 1;
pub(crate) const ERROR_SIZE: f64 = 0.0026;
pub(crate) const LIKENESS: f64 = 0.4;

/// Coefficient of a term of the error of the model at its step.
pub(crate) const ERROR_STEP: f64 = 0.03;

/// One effect of one parameter.
#[derive(Clone)]
pub(crate) struct Term {
    /// Amplitude of the patterns, as a function of the parameter.
    pub amplitude: fn(f64) -> f64,
    /// Patterns by their periods along x and y, each with a factor.
    pub patterns: Vec<([u32; 2], f64)>,
}

impl Term {
    /// Linear in its parameter: the amplitude of one pattern.
    pub(crate) fn linear(periods: [u32; 2]) -> Self {
        Self {
            amplitude: |theta| theta,
            patterns: vec![(periods, 1.0)],
        }
    }
}

/// Change by the first two terms together and by neither alone: the product of their parameters, on one pattern.
#[derive(Clone, Copy)]
pub(crate) struct Product {
    pub periods: [u32; 2],
    /// Amplitude for parameters of one; its sign is the other in every second object.
    pub factor: f64,
}

/// The model.
pub(crate) struct LinearModel {
    terms: Vec<Term>,
    product: Option<Product>,
    slots: Vec<Slot>,
    setup: PerMeasurement<Setup>,
}

/// Range and typical size of each parameter: amplitudes relative to the base.
pub(crate) const PARAMETER: Parameter = Parameter::new(-1.0, 1.0, 0.02);

/// Periods of the pattern of a smooth term that stands for nothing; no effect of a test may use these.
pub(crate) fn smooth_periods(term: usize) -> [u32; 2] {
    [term as u32 + 1, 9]
}

impl LinearModel {
    /// Effects `terms`, seen in measurements of which each is as `setup` says.
    pub(crate) fn new(terms: Vec<Term>, setup: Vec<Setup>) -> Self {
        let slots = (0..terms.len()).map(|effect| Slot {
            effect,
            index: 0,
            parameter: PARAMETER,
        });
        Self {
            slots: slots.collect(),
            terms,
            product: None,
            setup: setup.into(),
        }
    }

    /// The first two terms are the numbers of one effect, which do not merely add.
    #[must_use]
    pub(crate) fn with_first_two_joined(mut self, product: Product) -> Self {
        self.product = Some(product);
        for (s, slot) in self.slots.iter_mut().enumerate().skip(1) {
            (slot.effect, slot.index) = (s - 1, usize::from(s == 1));
        }
        self
    }

    /// The surrogate about zero, with smooth terms.
    pub(crate) fn surrogate(&self) -> Surrogate<Samples> {
        Surrogate::simulate(self, &vec![0.0; self.slots.len()], true, &Silent).unwrap()
    }

    /// Noise-free data, each measurement with its own parameters; `noise` is a seed.
    pub(crate) fn data(&self, theta: impl Fn(usize) -> Vec<f64>, noise: Option<u64>) -> Samples {
        let mut rng = ChaCha8Rng::seed_from_u64(noise.unwrap_or(0));
        let sigma = if noise.is_some() { SIGMA } else { 0.0 };
        let values = (0..self.setup.len()).map(|m| {
            let own = &self.setup[MeasurementIndex::from(m)];
            let values = self.prediction(&ParameterPoint::new(theta(m)), own).points([0.0; 2]);
            values
                .into_iter()
                .map(|v| SCALE * v + sigma * normal(&mut rng))
                .collect()
        });
        Samples {
            signal: values.collect::<Vec<_>>().into(),
            setup: self.setup.clone(),
            references: References {
                values: Vec::new(),
                offset_sigma: 1.0,
            },
        }
    }

    /// The problem of some data.
    pub(crate) fn problem<'a>(&'a self, data: &'a Samples) -> FitProblem<'a, Samples> {
        FitProblem::new(self, self.surrogate(), data)
    }

    /// The prediction of a measurement at a point.
    pub(crate) fn prediction(&self, point: &ParameterPoint, of: &Setup) -> Waves {
        let mut waves = vec![([1, 0], BASE_CONTRAST), ([0, 1], BASE_CONTRAST)];
        for (term, theta) in self.terms.iter().zip(&point.theta) {
            let amplitude = (term.amplitude)(*theta);
            waves.extend(term.patterns.iter().map(|(p, factor)| (*p, factor * amplitude)));
        }
        if let Some(Product { periods, factor }) = self.product {
            let sign = [1.0, -1.0][of.object % 2];
            waves.push((periods, sign * factor * point.theta[0] * point.theta[1]));
        }
        match point.smooth {
            Some(k) if k < NULL_TERMS => waves.push((smooth_periods(k), SMOOTH_STEP)),
            Some(k) if k == NULL_TERMS + ERROR_KIND * TERMS_OF_KIND => waves.push((ERROR_PERIODS, SMOOTH_STEP)),
            _ => {}
        }
        Waves::new(1.0, &waves)
    }
}

/// Periods of the pattern of an error of the model. Effects with this pattern have wide intervals.
pub(crate) const ERROR_PERIODS: [u32; 2] = [6, 7];

/// Amplitude of the pattern of a smooth term at its step.
pub(crate) const SMOOTH_STEP: f64 = 0.05;

/// Inner product of a pattern of unit amplitude with itself over one measurement, whitened: half the points.
pub(crate) fn information() -> f64 {
    0.5 * (POINTS * POINTS) as f64 * (SCALE / SIGMA).powi(2)
}

/// Measurements with so many gains, objects and runs, each combination once.
pub(crate) fn setups(gains: usize, objects: usize, runs: usize) -> Vec<Setup> {
    let mut out = Vec::new();
    for gain in 0..gains {
        for object in 0..objects {
            out.extend((0..runs).map(|run| Setup { gain, object, run }));
        }
    }
    out
}

impl ForwardModel for LinearModel {
    type Prediction = Waves;

    fn effects(&self) -> usize {
        self.slots.last().map_or(0, |slot| slot.effect + 1)
    }

    fn effect_name(&self, effect: usize) -> String {
        effect.to_string()
    }

    fn slots(&self) -> &[Slot] {
        &self.slots
    }

    fn kinked(&self, _: usize) -> bool {
        false
    }

    fn cheap_step(&self, _: usize) -> Option<f64> {
        None
    }

    fn is_dear_beside(&self, _: &[f64], _: usize) -> bool {
        false
    }

    fn smooth_terms(&self) -> Vec<SmoothTerm> {
        let nothing = SmoothTerm {
            step: 8.0,
            kind: None,
            by_group: false,
        };
        let of_kind = |kind| SmoothTerm {
            step: ERROR_STEP,
            kind: Some(kind),
            by_group: true,
        };
        let errors = [0, 1].into_iter().flat_map(|kind| vec![of_kind(kind); TERMS_OF_KIND]);
        vec![nothing; NULL_TERMS].into_iter().chain(errors).collect()
    }

    fn smooth_groups(&self) -> SmoothGroups {
        let of: PerMeasurement<usize> = self.setup.iter().map(|s| s.gain).collect();
        let count = of.iter().map(|g| g + 1).max().unwrap_or(1);
        SmoothGroups { of, count }
    }

    fn model_error(&self) -> ModelError {
        ModelError {
            sizes: vec![0.0005, ERROR_SIZE],
            likeness: LIKENESS,
            shapes: 8000.0,
            by_effect: true,
        }
    }

    fn cautious_model_error(&self) -> ModelError {
        ModelError {
            sizes: vec![0.003, 0.003],
            likeness: 1.0,
            shapes: 0.0,
            by_effect: false,
        }
    }

    fn predictions(&self, points: &[ParameterPoint], _: &dyn Progress) -> Result<Vec<PerMeasurement<Waves>>> {
        let all = points
            .iter()
            .map(|p| self.setup.iter().map(|own| self.prediction(p, own)).collect());
        Ok(all.collect())
    }

    fn reference_values(&self, _: &[f64]) -> Vec<Option<f64>> {
        Vec::new()
    }
}

/// A draw from the normal distribution.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// The smooth terms span as many patterns as there are terms.
#[test]
fn patterns_are_orthogonal() {
    /// Relative to the norms: rounding.
    const TOLERANCE: f64 = 1e-12;
    let mut all: Vec<[u32; 2]> = (0..NULL_TERMS).map(smooth_periods).collect();
    all.extend([[1, 0], [0, 1], [2, 3], [5, 4]]);
    let points: Vec<_> = all
        .iter()
        .map(|p| Waves::new(0.0, &[(*p, 1.0)]).points([0.0; 2]))
        .collect();
    let product = |a: usize, b: usize| {
        let pairs = points[a].iter().zip(&points[b]);
        pairs.map(|(x, y)| x * y).sum::<f64>() * (SCALE / SIGMA).powi(2)
    };
    for i in 0..all.len() {
        assert!((product(i, i) / information() - 1.0).abs() < TOLERANCE, "{:?}", all[i]);
        for j in 0..i {
            assert!(
                product(i, j).abs() < TOLERANCE * information(),
                "{:?} {:?}",
                all[i],
                all[j]
            );
        }
    }
}
