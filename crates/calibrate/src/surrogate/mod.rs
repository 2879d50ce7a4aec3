//! A surrogate of the forward model: every parameter simulated at a few values, and interpolated between them.
//!
//! Between the simulated values of a parameter, the change of an image is a polynomial. Changes of different
//! parameters add. This holds where effects are small; once an effect is found and a residual is left, the search
//! continues on a surrogate that is centred on what was found, with all other parameters simulated anew.

mod curve;
mod recentred;

use std::sync::Arc;

use metalith_core::{Error, Progress, Result};
use rayon::prelude::*;

use crate::effects::Parameter;
use crate::forward_model::{ForwardModel, PATH_TERMS, ParameterPoint, SmoothTerm};
use crate::optics::PixelGrid;
use crate::set::{CaptureIndex, LedIndex, PerCapture};
use curve::Curve;

/// Multiples of the typical size at which a parameter is simulated, on both sides.
const TWO_SIDED: [f64; 4] = [-2.5, -1.25, 1.25, 2.5];

/// And where it can only be positive.
const ONE_SIDED: [f64; 3] = [0.8, 1.8, 3.5];

/// And beside what was found, on both sides, and where it can only be positive.
const BESIDE: [f64; 2] = [-1.25, 1.25];
const BESIDE_ONE_SIDED: [f64; 2] = [0.8, 2.2];

/// Most that the images of one simulation of all parameters may take (bytes). Sets of 36 captures of 128 x 128 pixels of 0.5 um take
/// 0.4 GB so, and 0.5 to 0.8 GB in all: a search holds images about what it finds too.
const MOST_BYTES: f64 = 1.2e10;

/// How far a fit may extrapolate, as a multiple of the simulated range.
const EXTRAPOLATION: f64 = 1.6;

/// Images at a base point, and how every parameter changes them.
#[derive(Clone)]
pub struct Surrogate {
    /// Value of each parameter at the base point, by slot.
    pub about: Vec<f64>,
    /// Images there.
    pub base: Arc<PerCapture<PixelGrid>>,
    /// Changes with each parameter, by slot.
    curves: Vec<Curve>,
    /// Changes for a unit of each smooth term: paths (1/nm), then amplitudes and phases over width of each LED.
    smooth: Arc<Vec<SmoothChange>>,
    /// The surrogate that smooth terms were simulated with, where this one was centred elsewhere since.
    stated: Option<Arc<Surrogate>>,
    /// Whether all parameters that are not dear were simulated about the base point.
    renewed: bool,
    /// What another search on the same bench simulated: it is not simulated again about the same point.
    elsewhere: Option<Arc<Elsewhere>>,
}

/// Changes with each parameter about a point that another search found.
struct Elsewhere {
    /// Value of each parameter there, by slot.
    about: Vec<f64>,
    /// By slot; those of parameters that the other search did not know are not simulated.
    curves: Vec<Curve>,
}

/// Change of the images for a unit of a smooth term; none where it does not act.
type SmoothChange = PerCapture<Option<PixelGrid>>;

impl Surrogate {
    /// Simulate every parameter about the values `about`. With `smooth` (the LED of each capture, and the
    /// number of LEDs), the smooth terms as well.
    ///
    /// # Errors
    /// As [`ForwardModel::images`].
    pub fn simulate(
        model: &dyn ForwardModel,
        about: &[f64],
        smooth: Option<(&PerCapture<LedIndex>, usize)>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::simulated(model, about, [&TWO_SIDED, &ONE_SIDED], smooth, progress)
    }

    /// As [`Surrogate::simulate`] with the fewest values of each parameter: enough for derivatives and for effects of about
    /// their typical size.
    ///
    /// # Errors
    /// As [`ForwardModel::images`].
    pub fn beside(
        model: &dyn ForwardModel,
        about: &[f64],
        smooth: Option<(&PerCapture<LedIndex>, usize)>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::simulated(model, about, [&BESIDE, &BESIDE_ONE_SIDED], smooth, progress)
    }

    /// With these multiples of the typical size: of parameters with two sides, and of those that can only be positive.
    fn simulated(
        model: &dyn ForwardModel,
        about: &[f64],
        multiples: [&[f64]; 2],
        smooth: Option<(&PerCapture<LedIndex>, usize)>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let nodes = nodes_of(model, about, multiples);
        check_memory(model, &nodes, smooth.is_some())?;
        let mut points = vec![ParameterPoint::new(about.to_vec())];
        for (s, own) in nodes.iter().enumerate() {
            points.extend(own.iter().map(|offset| point_at(about, s, *offset)));
        }
        if smooth.is_some() {
            points.extend(SmoothTerm::all().map(|term| ParameterPoint::with(about, term)));
        }
        let mut images = model.images(&points, progress)?.into_iter();
        let base = images.next().expect("the first point is the base");
        let curves = nodes
            .into_iter()
            .enumerate()
            .map(|(s, nodes)| curve(model, (about, s), nodes, &mut images, &base))
            .collect();
        let mut terms = Vec::new();
        if let Some((led, leds)) = smooth {
            for (images, term) in images.zip(SmoothTerm::all()) {
                let changes = change(&images, &base, 1.0 / term.step() as f32);
                match term {
                    SmoothTerm::Path(_) => terms.push(changes.into_iter().map(Some).collect()),
                    SmoothTerm::Transmission(_) | SmoothTerm::Phase(_) => terms.extend(by_led(&changes, led, leds)),
                }
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

    /// The same images for a model with more parameters, of which `known` are simulated here already, by slot. Those that are new
    /// are simulated where the others are zero, as these must be here.
    ///
    /// # Errors
    /// As [`ForwardModel::images`].
    pub fn widened(&self, model: &dyn ForwardModel, known: &[Option<usize>], progress: &dyn Progress) -> Result<Self> {
        debug_assert!(self.about.iter().all(|v| *v == 0.0));
        let about = vec![0.0; known.len()];
        let mut points = Vec::new();
        let mut nodes = Vec::new();
        for (s, known) in known.iter().enumerate() {
            let own = match known {
                Some(_) => Vec::new(),
                None => offsets(model, &about, s, [&TWO_SIDED, &ONE_SIDED]),
            };
            points.extend(own.iter().map(|offset| point_at(&about, s, *offset)));
            nodes.push(own);
        }
        let mut images = model.images(&points, progress)?.into_iter();
        let curves = nodes.into_iter().zip(known).enumerate();
        let curves = curves.map(|(s, (nodes, known))| match known {
            Some(known) => self.curves[*known].clone(),
            None => curve(model, (&about, s), nodes, &mut images, &self.base),
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
    pub fn knowing(self, other: &Self, known: &[Option<usize>]) -> Self {
        let curves = known
            .iter()
            .map(|k| k.map_or_else(Curve::default, |k| other.curves[k].clone()));
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
    /// As [`ForwardModel::images`].
    pub fn extend(
        &mut self,
        model: &dyn ForwardModel,
        slot: usize,
        values: &[f64],
        progress: &dyn Progress,
    ) -> Result<()> {
        let points: Vec<_> = values
            .iter()
            .map(|value| {
                let mut theta = self.about.clone();
                theta[slot] = *value;
                ParameterPoint::new(theta)
            })
            .collect();
        for (images, value) in model.images(&points, progress)?.into_iter().zip(values) {
            let change = change(&images, &self.base, 1.0);
            self.curves[slot].add(value - self.about[slot], change);
        }
        Ok(())
    }

    /// About the values at which smooth terms were simulated.
    pub fn stated(&self) -> Self {
        self.stated
            .as_ref()
            .map_or_else(|| self.clone(), |stated| (**stated).clone())
    }

    /// Images that no parameter changes.
    pub fn constant(base: PerCapture<PixelGrid>) -> Self {
        Self {
            about: Vec::new(),
            base: Arc::new(base),
            curves: Vec::new(),
            smooth: Arc::default(),
            stated: None,
            renewed: false,
            elsewhere: None,
        }
    }

    /// The image of a capture at these parameters.
    pub fn image(&self, theta: &[f64], capture: CaptureIndex) -> PixelGrid {
        let mut parts = vec![(&self.base[capture], 1.0)];
        for ((curve, t), about) in self.curves.iter().zip(theta).zip(&self.about) {
            if t != about {
                parts.extend(curve.change(t - about, capture));
            }
        }
        PixelGrid::combine(&parts)
    }

    /// Its derivative by one of the parameters.
    pub fn slope(&self, theta: &[f64], slot: usize, capture: CaptureIndex) -> PixelGrid {
        let parts: Vec<_> = self.curves[slot]
            .slope(theta[slot] - self.about[slot], capture)
            .collect();
        PixelGrid::combine(&parts)
    }

    /// Number of smooth terms that were simulated: the paths, then amplitudes and phases over width of each
    /// LED.
    pub fn smooth_terms(&self) -> usize {
        self.smooth.len()
    }

    /// Whether smooth paths were simulated.
    pub fn has_paths(&self) -> bool {
        self.smooth.len() >= PATH_TERMS
    }

    /// The change for a unit of a smooth term in a capture that shows `image`; zero where it does not act.
    pub fn smooth_term(&self, term: usize, capture: CaptureIndex, image: &PixelGrid) -> PixelGrid {
        let known = self.smooth[term][capture].clone();
        known.unwrap_or_else(|| PixelGrid::combine(&[(image, 0.0)]))
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

/// Refuse captures whose images a calibration could not hold, before any work is spent on them.
///
/// # Errors
/// With what they would take, and what takes less.
pub fn check_calibration_fits(model: &dyn ForwardModel) -> Result<()> {
    let nothing = vec![0.0; model.slots().len()];
    check_memory(model, &nodes_of(model, &nothing, [&TWO_SIDED, &ONE_SIDED]), true)
}

/// The same of images at these offsets of each parameter, and of smooth terms.
fn check_memory(model: &dyn ForwardModel, nodes: &[Vec<f64>], smooth: bool) -> Result<()> {
    let smooth = if smooth { SmoothTerm::all().count() } else { 0 };
    let images = 1 + nodes.iter().map(Vec::len).sum::<usize>() + smooth;
    let bytes = images as f64 * model.image_bytes();
    if bytes <= MOST_BYTES {
        return Ok(());
    }
    Err(Error::refused(
        "calibrate/memory",
        format!(
            "the images of these captures under {images} changes of chip and bench take about {:.0} GB of memory, and a search \
             as much again; at most {:.0} GB are taken for them",
            bytes * 1e-9,
            MOST_BYTES * 1e-9
        ),
        "give smaller windows (`rows` and `cols` of [camera]) or fewer captures, or try fewer effects (`--effects NAMES`): memory goes \
         with the area of a window on the sensor, whatever its pixels",
    ))
}

/// Offsets of each parameter from `about`.
fn nodes_of(model: &dyn ForwardModel, about: &[f64], multiples: [&[f64]; 2]) -> Vec<Vec<f64>> {
    (0..model.slots().len())
        .map(|s| offsets(model, about, s, multiples))
        .collect()
}

/// Offsets of one parameter from `about` within its physical range; its ends, if all are beyond them. By multiples of the typical
/// size: where it has two sides, and where it can only be positive.
fn offsets(model: &dyn ForwardModel, about: &[f64], s: usize, [two_sided, one_sided]: [&[f64]; 2]) -> Vec<f64> {
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

/// How one parameter changes the images of a base point: the next of `images` are those at its `nodes`.
fn curve(
    model: &dyn ForwardModel,
    (about, s): (&[f64], usize),
    nodes: Vec<f64>,
    images: &mut impl Iterator<Item = PerCapture<PixelGrid>>,
    base: &PerCapture<PixelGrid>,
) -> Curve {
    let own = images.take(nodes.len());
    let changes: Vec<_> = own.map(|i| change(&i, base, 1.0)).collect();
    let kinked = model.kinked(model.slots()[s].effect) && about.iter().all(|v| *v == 0.0);
    Curve::new(about[s], nodes, changes, kinked)
}

/// The point at such an offset.
fn point_at(about: &[f64], s: usize, offset: f64) -> ParameterPoint {
    let mut theta = about.to_vec();
    theta[s] += offset;
    ParameterPoint::new(theta)
}

fn change(images: &PerCapture<PixelGrid>, base: &PerCapture<PixelGrid>, factor: f32) -> PerCapture<PixelGrid> {
    let pairs = images.raw.par_iter().zip(&base.raw);
    let changes: Vec<PixelGrid> = pairs
        .map(|(i, b)| PixelGrid::combine(&[(i, factor), (b, -factor)]))
        .collect();
    changes.into()
}

/// One change for each LED, which acts in the captures of this LED alone.
fn by_led<'a>(
    changes: &'a PerCapture<PixelGrid>,
    led: &'a PerCapture<LedIndex>,
    leds: usize,
) -> impl Iterator<Item = SmoothChange> + 'a {
    (0..leds).map(LedIndex::from).map(move |own| {
        let pairs = changes.iter().zip(led);
        pairs.map(|(c, l)| (*l == own).then(|| c.clone())).collect()
    })
}
