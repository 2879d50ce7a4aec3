//! Smooth shapes that stand for no effect: paths over the lens, and transmissions over width for each LED.

use metalith_attribution::SmoothTerm;

/// Number of polynomials of the smooth optical path: Noll's 5 to 15, through fourth order.
pub(crate) const PATH_TERMS: usize = 11;

/// Number of polynomials of the smooth transmission over width, for each LED.
pub(crate) const TRANSMISSION_TERMS: usize = 3;

/// A smooth change of the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SmoothShape {
    /// Zernike polynomial of the optical path, counted from zero. Null tests are made of these.
    Path(usize),
    /// Legendre polynomial of the relative amplitude over width, counted from zero.
    Transmission(usize),
    /// Legendre polynomial of the phase over width, counted from zero.
    Phase(usize),
}

impl SmoothShape {
    /// All of them: paths, amplitudes, phases.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let paths = (0..PATH_TERMS).map(Self::Path);
        let amplitudes = (0..TRANSMISSION_TERMS).map(Self::Transmission);
        paths.chain(amplitudes).chain((0..TRANSMISSION_TERMS).map(Self::Phase))
    }

    /// Coefficient at which a shape is simulated, small enough for images to be linear in it: nm of path, a relative
    /// change of amplitude, or rad.
    pub(crate) fn step(self) -> f64 {
        match self {
            Self::Path(_) => 8.0,
            Self::Transmission(_) | Self::Phase(_) => 0.03,
        }
    }

    /// Shape in the form of the statistics. A cell errs by amplitude and phase, in each LED by its own.
    pub(crate) fn term(self) -> SmoothTerm {
        let kind = match self {
            Self::Path(_) => None,
            Self::Transmission(_) => Some(0),
            Self::Phase(_) => Some(1),
        };
        SmoothTerm {
            step: self.step(),
            kind,
            by_group: kind.is_some(),
        }
    }
}
