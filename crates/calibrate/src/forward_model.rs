//! What the statistics know of the optical simulator.
//!
//! Everything in `fit/` and `search/` sees the simulator through [`ForwardModel`] alone: parameters in, images
//! and widths out. Chips, cells and light stand behind it. Tests put a linear model with closed forms in its
//! place.

use metalith_core::{Progress, Result};

use crate::effects::{Parameter, ValueError};
use crate::optics::PixelGrid;
use crate::set::PerCapture;

/// Number of polynomials of the smooth optical path: Noll's 5 to 15, through fourth order.
pub const PATH_TERMS: usize = 11;

/// Number of polynomials of the smooth transmission over width, for each LED.
pub const TRANSMISSION_TERMS: usize = 3;

/// One parameter of one effect.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    /// Number of the effect.
    pub effect: usize,
    /// Which of its parameters.
    pub index: usize,
    pub parameter: Parameter,
}

/// A smooth change that stands for no effect. Null tests and the residual map are made of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SmoothTerm {
    /// Zernike polynomial of the optical path, counted from zero.
    Path(usize),
    /// Legendre polynomial of the relative amplitude over width, counted from zero.
    Transmission(usize),
    /// The same of the phase over width.
    Phase(usize),
}

impl SmoothTerm {
    /// All of them: paths, amplitudes, phases.
    pub fn all() -> impl Iterator<Item = Self> {
        let paths = (0..PATH_TERMS).map(Self::Path);
        let amplitudes = (0..TRANSMISSION_TERMS).map(Self::Transmission);
        paths.chain(amplitudes).chain((0..TRANSMISSION_TERMS).map(Self::Phase))
    }

    /// Coefficient at which a term is simulated, small enough for images to be linear in it: nm of path, a relative
    /// change of amplitude, or rad.
    pub fn step(self) -> f64 {
        match self {
            Self::Path(_) => 8.0,
            Self::Transmission(_) | Self::Phase(_) => 0.03,
        }
    }
}

/// Where a forward model is evaluated.
#[derive(Clone, Debug)]
pub struct ParameterPoint {
    /// Value of each parameter, by slot.
    pub theta: Vec<f64>,
    /// A smooth term that is added at its [`SmoothTerm::step`].
    pub smooth: Option<SmoothTerm>,
}

impl ParameterPoint {
    /// Without a smooth term.
    pub fn new(theta: Vec<f64>) -> Self {
        Self { theta, smooth: None }
    }

    /// With a smooth term.
    pub fn with(theta: &[f64], term: SmoothTerm) -> Self {
        Self {
            theta: theta.to_vec(),
            smooth: Some(term),
        }
    }
}

/// A simulator of captures whose parameters belong to effects.
pub trait ForwardModel: Send + Sync {
    /// Number of effects.
    fn effects(&self) -> usize;

    /// All parameters of all effects.
    fn slots(&self) -> &[Slot];

    /// Whether images have a kink where the parameters of an effect are zero, so that one side tells nothing
    /// of the other.
    fn kinked(&self, effect: usize) -> bool;

    /// Whether some parameters of an effect change nothing while all are zero.
    fn dormant(&self, _effect: usize) -> bool {
        false
    }

    /// By how much the change of an image by an effect may be wrong, relative: what correct programs differ by.
    fn error_share(&self, _effect: usize) -> f64 {
        0.0
    }

    /// What the value that is found for an effect may be wrong by, beside noise and cell.
    fn value_error(&self, _effect: usize) -> ValueError {
        ValueError::NONE
    }

    /// Step of a parameter on whose multiples simulations are cheap, because parts of them are likely to be
    /// stored; none where every value costs the same.
    fn cheap_step(&self, slot: usize) -> Option<f64>;

    /// Whether simulating other values of a parameter beside those in `about` is so dear that its changes are
    /// rather taken to add to theirs.
    fn is_dear_beside(&self, about: &[f64], slot: usize) -> bool;

    /// What the images of all captures take at one point, about (bytes).
    fn image_bytes(&self) -> f64 {
        0.0
    }

    /// Images of all captures at each point, before registration, flux and black level.
    ///
    /// # Errors
    /// If a simulation fails, or the user stopped it.
    fn images(&self, points: &[ParameterPoint], progress: &dyn Progress) -> Result<Vec<PerCapture<PixelGrid>>>;

    /// What the parameters add to the width at each site that was measured by SEM (nm); none for sites that
    /// are on no lattice.
    fn width_biases_nm(&self, theta: &[f64]) -> Vec<Option<f64>>;

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
