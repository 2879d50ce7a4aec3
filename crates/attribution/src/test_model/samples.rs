//! Measurements of the test model: windows with noise, whose nuisances are a place, gains and an offset.

use nalgebra::{DMatrix, DVector};

use super::Waves;
use crate::fit::minimise;
use crate::index::{MeasurementIndex, PerMeasurement};
use crate::measurements::{MeasurementEquations, Measurements, References, eliminate, own_step};

/// Units of the measurement for unit prediction, and one standard deviation of each point.
pub(crate) const SCALE: f64 = 1000.0;
pub(crate) const SIGMA: f64 = 10.0;

/// Standard deviation of the place of a window (points), of a gain, and of the offset.
const PLACE_SIGMA: f64 = 0.5;
const GAIN_SIGMA: f64 = 0.01;
const OFFSET_SIGMA: f64 = 0.5;

/// Nuisances of one measurement alone: its place along both axes.
const OWN: usize = 2;

/// What a measurement is of: measurements are grouped by this.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setup {
    /// Number of its gain.
    pub gain: usize,
    pub object: usize,
    pub run: usize,
}

/// Values at the points of each window, with noise.
#[derive(Clone)]
pub(crate) struct Samples {
    pub signal: PerMeasurement<Vec<f64>>,
    pub setup: PerMeasurement<Setup>,
    pub references: References,
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
