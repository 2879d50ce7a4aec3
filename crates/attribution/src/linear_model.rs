//! A forward model with closed forms, for tests: each parameter changes the predictions by one cosine pattern.
//!
//! All patterns have whole numbers of periods over the window: they are orthogonal to one another, to the
//! common base, to its slopes and to a constant. So the normal equations are diagonal, and everything
//! that the statistics answer can be written down.

use metalith_core::{Progress, Result, Silent};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::effect::{Parameter, Slot};
use crate::fit::{FitProblem, minimise};
use crate::forward_model::{ForwardModel, ModelError, ParameterPoint, SmoothGroups, SmoothTerm};
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::{MeasurementEquations, Measurements, References, eliminate, own_step};
use crate::surrogate::Surrogate;

/// Edge of the window in points.
pub(crate) const POINTS: usize = 32;

/// Units of the measurement for unit prediction, and one standard deviation of each point.
pub(crate) const SCALE: f64 = 1000.0;
pub(crate) const SIGMA: f64 = 10.0;

/// Contrast of the base along each axis; it gives the place of the window something to hold on to.
const BASE_CONTRAST: f64 = 0.4;

/// Standard deviation of the place of a window (points), of a gain, and of the offset.
const PLACE_SIGMA: f64 = 0.5;
const GAIN_SIGMA: f64 = 0.01;
const OFFSET_SIGMA: f64 = 0.5;

/// Nuisances of one measurement alone: its place along both axes.
const OWN: usize = 2;

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

/// What a measurement is of: measurements are grouped by this.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setup {
    /// Number of its gain.
    pub gain: usize,
    pub object: usize,
    pub run: usize,
}

/// A prediction: a constant and some cosines by their periods over the window along x and y.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Waves {
    pub constant: f64,
    pub waves: Vec<([u32; 2], f64)>,
}

impl Waves {
    pub(crate) fn new(constant: f64, waves: &[([u32; 2], f64)]) -> Self {
        let mut out = Self {
            constant,
            waves: Vec::new(),
        };
        out.add(waves, 1.0);
        out
    }

    fn add(&mut self, waves: &[([u32; 2], f64)], factor: f64) {
        for (periods, amplitude) in waves {
            match self.waves.iter_mut().find(|w| w.0 == *periods) {
                Some(own) => own.1 += factor * amplitude,
                None => self.waves.push((*periods, factor * amplitude)),
            }
        }
    }

    /// Values at the points of a window that is off by so much along x and y.
    pub(crate) fn points(&self, off: [f64; 2]) -> Vec<f64> {
        let mut out = vec![self.constant; POINTS * POINTS];
        for (periods, amplitude) in &self.waves {
            // cos(a + b) = cos a cos b - sin a sin b.
            add_products(&mut out, *amplitude, turned(*periods, off));
        }
        out
    }

    /// Derivatives of the values by the place of the window along an axis.
    fn slopes(&self, off: [f64; 2], axis: usize) -> Vec<f64> {
        let turn = std::f64::consts::TAU / POINTS as f64;
        let mut out = vec![0.0; POINTS * POINTS];
        for (periods, amplitude) in &self.waves {
            // sin(a + b) = sin a cos b + cos a sin b.
            let rate = -turn * f64::from(periods[axis]) * amplitude;
            let [[cx, sx], y] = turned(*periods, off);
            add_products(&mut out, rate, [[sx, cx.iter().map(|c| -c).collect()], y]);
        }
        out
    }
}

/// Cosines and sines of the phase of a wave along x, and along y.
fn turned(periods: [u32; 2], off: [f64; 2]) -> [[Vec<f64>; 2]; 2] {
    let turn = std::f64::consts::TAU / POINTS as f64;
    [0, 1].map(|axis| {
        let at = |i: usize| i as f64 - 0.5 * (POINTS as f64 - 1.0) + off[axis];
        let phase = |i: usize| turn * f64::from(periods[axis]) * at(i);
        [
            (0..POINTS).map(|i| phase(i).cos()).collect(),
            (0..POINTS).map(|i| phase(i).sin()).collect(),
        ]
    })
}

/// Add the first product of a line along x and one along y less the second.
fn add_products(to: &mut [f64], factor: f64, [x, y]: [[Vec<f64>; 2]; 2]) {
    for (row, to) in to.chunks_exact_mut(POINTS).enumerate() {
        let (first, second) = (factor * y[0][row], factor * y[1][row]);
        for ((to, p), q) in to.iter_mut().zip(&x[0]).zip(&x[1]) {
            *to += first * p - second * q;
        }
    }
}

/// Values at the points of each window, with noise.
#[derive(Clone)]
pub(crate) struct Samples {
    pub signal: PerMeasurement<Vec<f64>>,
    pub setup: PerMeasurement<Setup>,
    references: References,
}

/// The nuisances of [`Samples`].
#[derive(Clone)]
pub(crate) struct Nuisances {
    /// Place of each window along both axes (points).
    place: PerMeasurement<[f64; 2]>,
    gain: Vec<f64>,
    offset: f64,
}

/// The normal equations of a window: its place, all gains, the offset, further parameters, the residual.
#[derive(Clone)]
pub(crate) struct Equations(DMatrix<f64>);

impl MeasurementEquations for Equations {
    fn reduced(&self) -> DMatrix<f64> {
        eliminate(&self.0, OWN)
    }
}

impl Samples {
    fn gains(&self) -> usize {
        self.setup.iter().map(|s| s.gain + 1).max().unwrap_or(1)
    }

    fn by(&self, key: impl Fn(&Setup) -> usize) -> PerMeasurement<usize> {
        self.setup.iter().map(key).collect()
    }
}

impl Measurements for Samples {
    type Prediction = Waves;
    type Nuisances = Nuisances;
    type Equations = Equations;

    fn combine(parts: &[(&Waves, f32)]) -> Waves {
        let mut out = Waves::new(0.0, &[]);
        for (part, factor) in parts {
            out.constant += f64::from(*factor) * part.constant;
            out.add(&part.waves, f64::from(*factor));
        }
        out
    }

    fn mean_square(prediction: &Waves) -> f64 {
        let waves = prediction.waves.iter().map(|(_, a)| 0.5 * a * a);
        prediction.constant.powi(2) + waves.sum::<f64>()
    }

    fn count(&self) -> usize {
        self.signal.len()
    }

    fn points(&self, measurement: MeasurementIndex) -> usize {
        self.signal[measurement].len()
    }

    fn shared(&self) -> usize {
        self.gains() + 1
    }

    fn folds(&self) -> Vec<PerMeasurement<usize>> {
        vec![self.by(|s| s.gain), self.by(|s| s.object), self.by(|s| s.run)]
    }

    fn clusters(&self) -> PerMeasurement<usize> {
        let gains = self.gains();
        self.by(|s| s.object * gains + s.gain)
    }

    fn groupings(&self) -> Vec<PerMeasurement<usize>> {
        vec![self.by(|s| s.object), self.by(|s| s.gain), self.by(|s| s.run)]
    }

    fn fitted_nuisances(&self, predictions: &PerMeasurement<Waves>, used: &PerMeasurement<bool>) -> Nuisances {
        /// Gauss-Newton steps.
        const STEPS: usize = 4;
        let mut now = Nuisances {
            place: vec![[0.0; 2]; self.count()].into(),
            gain: vec![1.0; self.gains()],
            offset: 0.0,
        };
        let shared = self.shared();
        for _ in 0..STEPS {
            let equations = self.for_each(|m| self.equations(m, &now, &predictions[m], &[]));
            let counted = equations.iter().zip(used).filter(|(_, used)| **used);
            let form = counted.fold(self.prior(&now, shared + 1), |sum, (e, _)| sum + e.reduced());
            let (step, _) = minimise(&form, &(0..shared).collect::<Vec<_>>());
            self.advance(&mut now, &equations, &step);
        }
        now
    }

    fn prior(&self, nuisances: &Nuisances, size: usize) -> DMatrix<f64> {
        let mut form = DMatrix::zeros(size, size);
        let gains = nuisances.gain.iter().map(|g| (g - 1.0, GAIN_SIGMA));
        for (k, (off, sigma)) in gains.chain([(nuisances.offset, OFFSET_SIGMA)]).enumerate() {
            let weight = sigma.powi(-2);
            form[(k, k)] = weight;
            form[(k, size - 1)] = -off * weight;
            form[(size - 1, k)] = -off * weight;
            form[(size - 1, size - 1)] += off * off * weight;
        }
        form
    }

    fn equations(
        &self,
        measurement: MeasurementIndex,
        nuisances: &Nuisances,
        prediction: &Waves,
        derivatives: &[Waves],
    ) -> Equations {
        let (place, own) = (nuisances.place[measurement], self.setup[measurement].gain);
        let factor = SCALE * nuisances.gain[own];
        let values = prediction.points(place);
        let scaled =
            |values: Vec<f64>, factor: f64| values.into_iter().map(|v| factor * v / SIGMA).collect::<Vec<f64>>();
        let mut columns = vec![vec![0.0; values.len()]; OWN + self.shared()];
        for axis in [0, 1] {
            columns[axis] = scaled(prediction.slopes(place, axis), factor);
        }
        columns[OWN + own] = scaled(values.clone(), SCALE);
        columns[OWN + self.gains()] = vec![1.0 / SIGMA; values.len()];
        columns.extend(derivatives.iter().map(|d| scaled(d.points(place), factor)));
        let pairs = self.signal[measurement].iter().zip(&values);
        columns.push(
            pairs
                .map(|(s, v)| (s - factor * v - nuisances.offset) / SIGMA)
                .collect(),
        );
        let size = columns.len();
        let mut gram = DMatrix::zeros(size, size);
        for i in 0..size {
            for j in 0..=i {
                gram[(i, j)] = columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum();
                gram[(j, i)] = gram[(i, j)];
            }
        }
        for (axis, off) in place.into_iter().enumerate() {
            let weight = PLACE_SIGMA.powi(-2);
            gram[(axis, axis)] += weight;
            gram[(axis, size - 1)] -= off * weight;
            gram[(size - 1, axis)] -= off * weight;
            gram[(size - 1, size - 1)] += off * off * weight;
        }
        Equations(gram)
    }

    fn advance(&self, nuisances: &mut Nuisances, equations: &PerMeasurement<Equations>, step: &DVector<f64>) {
        for (place, Equations(gram)) in nuisances.place.iter_mut().zip(equations) {
            let by = own_step(gram, OWN, step);
            *place = [place[0] + by[0], place[1] + by[1]];
        }
        let gains = nuisances.gain.len();
        for (gain, by) in nuisances.gain.iter_mut().zip(step.iter()) {
            *gain += by;
        }
        nuisances.offset += step[gains];
    }

    fn references(&self) -> &References {
        &self.references
    }
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
