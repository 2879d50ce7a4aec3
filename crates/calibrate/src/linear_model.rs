//! A forward model with closed forms, for tests: each parameter changes the images by one cosine pattern.
//!
//! All patterns have whole numbers of periods over the window: they are orthogonal to one another, to the
//! common base image, to its slopes and to a constant. So the normal equations are diagonal, and everything
//! that the statistics answer can be written down.

use metalith_core::{Progress, Result, Silent};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::effects::Parameter;
use crate::fit::{CaptureSetup, Data, FitProblem};
use crate::forward_model::{ForwardModel, PATH_TERMS, ParameterPoint, Slot, SmoothTerm};
use crate::optics::{Optic, PixelGrid};
use crate::set::{CaptureIndex, PerCapture};
use crate::surrogate::Surrogate;

/// Edge of the window, and of its pixels one: pixels are 1 um wide.
pub const PIXELS: usize = 32;

/// DN for unit intensity, and one standard deviation of each pixel (DN).
pub const SCALE: f64 = 1000.0;
pub const SIGMA: f64 = 10.0;

/// Samples of the intensity (um), and how far they reach beyond the window on each side (um).
const STEP_UM: f64 = 0.5;
const MARGIN_UM: usize = 12;

/// Contrast of the base image along each axis; it gives registration something to hold on to.
const BASE_CONTRAST: f64 = 0.4;

/// One effect of one parameter.
#[derive(Clone)]
pub struct Term {
    /// Amplitude of the patterns, as a function of the parameter.
    pub amplitude: fn(f64) -> f64,
    /// Patterns by their periods along x and y, each with a factor.
    pub patterns: Vec<([u32; 2], f64)>,
}

impl Term {
    /// Linear in its parameter: the amplitude of one pattern.
    pub fn linear(periods: [u32; 2]) -> Self {
        Self {
            amplitude: |theta| theta,
            patterns: vec![(periods, 1.0)],
        }
    }
}

/// What the first two terms change together and neither alone: the product of their parameters, on one pattern.
#[derive(Clone, Copy)]
pub struct Product {
    pub periods: [u32; 2],
    /// Amplitude for parameters of one; its sign is the other in every second element.
    pub factor: f64,
}

/// The model.
pub struct LinearModel {
    terms: Vec<Term>,
    product: Option<Product>,
    slots: Vec<Slot>,
    beam: PerCapture<CaptureSetup>,
}

/// Range and typical size of each parameter: amplitudes relative to the base image.
pub const PARAMETER: Parameter = Parameter {
    range: (-1.0, 1.0),
    typical: 0.02,
    sound_end: 0.0,
};

/// Periods of the pattern of a smooth term; no effect of a test may use these.
pub fn smooth_periods(term: usize) -> [u32; 2] {
    [term as u32 + 1, 9]
}

impl LinearModel {
    /// Effects `terms`, seen in captures that are lit and placed as `beam` says.
    pub fn new(terms: Vec<Term>, beam: Vec<CaptureSetup>) -> Self {
        let slots = (0..terms.len()).map(|effect| Slot {
            effect,
            index: 0,
            parameter: PARAMETER,
        });
        Self {
            slots: slots.collect(),
            terms,
            product: None,
            beam: beam.into(),
        }
    }

    /// The first two terms are the numbers of one effect, which do not merely add.
    #[must_use]
    pub fn with_first_two_joined(mut self, product: Product) -> Self {
        self.product = Some(product);
        for (s, slot) in self.slots.iter_mut().enumerate().skip(1) {
            (slot.effect, slot.index) = (s - 1, usize::from(s == 1));
        }
        self
    }

    /// The surrogate about zero, with smooth terms.
    pub fn surrogate(&self) -> Surrogate {
        let led: PerCapture<_> = self.beam.iter().map(|b| b.led).collect();
        let leds = led.iter().map(|l| usize::from(*l) + 1).max().unwrap_or(1);
        Surrogate::simulate(self, &vec![0.0; self.slots.len()], Some((&led, leds)), &Silent).unwrap()
    }

    /// Noise-free data, each capture with parameters of its own; `noise` is a seed.
    pub fn data(&self, theta: impl Fn(usize) -> Vec<f64>, noise: Option<u64>) -> Data {
        let mut rng = ChaCha8Rng::seed_from_u64(noise.unwrap_or(0));
        let sigma = if noise.is_some() { SIGMA } else { 0.0 };
        let pixels = (0..self.beam.len()).map(|c| {
            let own = &self.beam[CaptureIndex::from(c)];
            let image = self.image(&ParameterPoint::new(theta(c)), own).pixels([0.0; 2]);
            image.mapv(|v| (SCALE * f64::from(v) + sigma * normal(&mut rng)) as f32)
        });
        let signal: PerCapture<_> = pixels.collect::<Vec<_>>().into();
        Data {
            weight: signal.iter().map(|s| s.mapv(|_| (1.0 / SIGMA) as f32)).collect(),
            beam: self.beam.clone(),
            scale: vec![SCALE; signal.len()].into(),
            leds: self.beam.iter().map(|b| usize::from(b.led) + 1).max().unwrap_or(1),
            pixel_um: 1.0,
            registration_um: 0.5,
            flux_sigma: 0.01,
            widths: Vec::new(),
            width_offset_sigma_nm: 1.0,
            signal,
        }
    }

    /// The problem of some data.
    pub fn problem<'a>(&'a self, data: &'a Data) -> FitProblem<'a> {
        FitProblem::new(self, self.surrogate(), data)
    }

    /// Image of a capture at a point.
    pub fn image(&self, point: &ParameterPoint, capture: &CaptureSetup) -> PixelGrid {
        let mut waves = vec![([1, 0], BASE_CONTRAST), ([0, 1], BASE_CONTRAST)];
        for (term, theta) in self.terms.iter().zip(&point.theta) {
            let amplitude = (term.amplitude)(*theta);
            waves.extend(term.patterns.iter().map(|(p, factor)| (*p, factor * amplitude)));
        }
        if let Some(Product { periods, factor }) = self.product {
            let sign = [1.0, -1.0][usize::from(capture.element) % 2];
            waves.push((periods, sign * factor * point.theta[0] * point.theta[1]));
        }
        match point.smooth {
            Some(SmoothTerm::Path(k)) => waves.push((smooth_periods(k), SMOOTH_STEP)),
            Some(SmoothTerm::Phase(0)) => waves.push((PHASE_PERIODS, SMOOTH_STEP)),
            _ => {}
        }
        image(1.0, &waves)
    }
}

/// Periods of the pattern of the first phase over width: what a model may err by. Effects with this pattern have wide
/// intervals.
pub const PHASE_PERIODS: [u32; 2] = [6, 7];

/// Amplitude of the pattern of a smooth term at its step.
pub const SMOOTH_STEP: f64 = 0.05;

/// Image of a constant and some cosines: periods over the window along x and y, amplitude.
pub fn image(constant: f64, waves: &[([u32; 2], f64)]) -> PixelGrid {
    let n = 2 * (PIXELS + 2 * MARGIN_UM);
    let at = |i: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * STEP_UM;
    let turn = std::f64::consts::TAU / PIXELS as f64;
    let samples: Vec<f32> = (0..n * n)
        .map(|i| {
            let (x, y) = (at(i % n), at(i / n));
            let wave = |(p, a): &([u32; 2], f64)| a * (turn * (f64::from(p[0]) * x + f64::from(p[1]) * y)).cos();
            (constant + waves.iter().map(wave).sum::<f64>()) as f32
        })
        .collect();
    let optic = Optic {
        pixel_um: 1.0,
        disc_um: [[0.0; 2]; 2],
        blur_um: 0.0,
    };
    PixelGrid::new(&samples, STEP_UM, &optic, PIXELS, PIXELS)
}

/// Inner product of a pattern of unit amplitude with itself over one capture, whitened: half the pixels, times
/// the squared transfer function of a pixel.
pub fn information(periods: [u32; 2]) -> f64 {
    let sinc = |p: u32| {
        let t = std::f64::consts::PI * f64::from(p) / PIXELS as f64;
        if p == 0 { 1.0 } else { t.sin() / t }
    };
    let transfer = sinc(periods[0]) * sinc(periods[1]);
    0.5 * (PIXELS * PIXELS) as f64 * (SCALE / SIGMA * transfer).powi(2)
}

/// Captures of so many LEDs, elements and distances, each combination once.
pub fn beams(leds: usize, elements: usize, distances: usize) -> Vec<CaptureSetup> {
    let mut out = Vec::new();
    for led in 0..leds {
        for element in 0..elements {
            for distance in 0..distances {
                out.push(CaptureSetup {
                    element: element.into(),
                    led: led.into(),
                    aoi_rad: [0.0; 2],
                    distance_um: 100.0 + distance as f64,
                });
            }
        }
    }
    out
}

impl ForwardModel for LinearModel {
    fn effects(&self) -> usize {
        self.slots.last().map_or(0, |slot| slot.effect + 1)
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

    fn images(&self, points: &[ParameterPoint], _: &dyn Progress) -> Result<Vec<PerCapture<PixelGrid>>> {
        let images = points.iter().map(|p| match self.product {
            None => vec![self.image(p, &self.beam[CaptureIndex::from(0)]); self.beam.len()].into(),
            Some(_) => self.beam.iter().map(|own| self.image(p, own)).collect(),
        });
        Ok(images.collect())
    }

    fn width_biases_nm(&self, _: &[f64]) -> Vec<Option<f64>> {
        Vec::new()
    }
}

/// A draw from the normal distribution.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Images of the smooth paths span as many patterns as there are terms.
#[test]
fn patterns_are_orthogonal() {
    /// Relative to the norms: what the faded border of the samples leaves in single precision.
    const TOLERANCE: f64 = 1e-3;
    let mut all: Vec<[u32; 2]> = (0..PATH_TERMS).map(smooth_periods).collect();
    all.extend([[1, 0], [0, 1], [2, 3], [5, 4]]);
    let pixels: Vec<_> = all.iter().map(|p| image(0.0, &[(*p, 1.0)]).pixels([0.0; 2])).collect();
    let product = |a: usize, b: usize| {
        let pairs = pixels[a].iter().zip(&pixels[b]);
        pairs.map(|(x, y)| f64::from(*x) * f64::from(*y)).sum::<f64>() * (SCALE / SIGMA).powi(2)
    };
    for i in 0..all.len() {
        let size = information(all[i]);
        assert!(
            (product(i, i) / size - 1.0).abs() < TOLERANCE,
            "{:?}: {}",
            all[i],
            product(i, i) / size
        );
        for j in 0..i {
            assert!(product(i, j).abs() < TOLERANCE * size, "{:?} {:?}", all[i], all[j]);
        }
    }
}
