//! What the solver is given: layers on a square lattice, in optical constants.

use num_complex::Complex64;

use super::outline::Outline;
use super::{Error, Result};

/// Layers between two half-spaces, all on one square lattice, centred on one another.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerStack {
    /// Pitch of the lattice (nm).
    pub pitch_nm: f64,
    /// Complex index of the half-space below, where the substrate is.
    pub below: Complex64,
    /// From the substrate upwards.
    pub layers: Vec<Layer>,
    /// Complex index of the half-space above.
    pub above: Complex64,
}

/// One layer: a pillar of one material in another.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Thickness (nm).
    pub height_nm: f64,
    /// Cross-section of the pillar.
    pub outline: Outline,
    /// Complex index n + i k of the pillar; k > 0 absorbs.
    pub inside: Complex64,
    /// Complex index around it.
    pub outside: Complex64,
}

impl Layer {
    /// A layer without structure.
    pub fn uniform(height_nm: f64, index: Complex64) -> Self {
        Self {
            height_nm,
            outline: Outline::empty(),
            inside: index,
            outside: index,
        }
    }
}

/// Number of diffraction orders kept along each axis, odd: 13 keeps -6..=6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Orders(usize);

impl Orders {
    /// Largest number of orders along an axis; past it a matrix alone takes gigabytes.
    pub const MOST: usize = 127;

    /// So many orders along each axis.
    ///
    /// # Errors
    /// If the number is zero, even or above [`Orders::MOST`].
    pub fn new(along_axis: usize) -> Result<Self> {
        if along_axis.is_multiple_of(2) || along_axis > Self::MOST {
            return Err(Error::Orders { along_axis });
        }
        Ok(Self(along_axis))
    }

    /// Number of orders along an axis.
    pub fn along_axis(self) -> usize {
        self.0
    }

    /// The highest order kept.
    pub(super) fn highest(self) -> usize {
        self.0 / 2
    }
}

impl LayerStack {
    /// The same stack seen from the other side.
    pub(super) fn flipped(&self) -> Self {
        Self {
            pitch_nm: self.pitch_nm,
            below: self.above,
            layers: self.layers.iter().rev().cloned().collect(),
            above: self.below,
        }
    }

    /// Whether x and y polarisation see the same.
    pub(super) fn is_square(&self) -> bool {
        self.layers.iter().all(|l| l.outline.is_square())
    }

    /// Whether both axes mirror it.
    pub(super) fn is_mirrored(&self) -> bool {
        self.layers.iter().all(|l| l.outline.is_mirrored())
    }

    /// Whether any pillar has sides along the axes.
    pub(super) fn has_upright(&self) -> bool {
        self.layers
            .iter()
            .any(|l| l.outline.is_upright() && !l.outline.is_empty())
    }

    /// Refuses what cannot be, before anything is computed from it.
    pub(super) fn check(&self) -> Result<()> {
        let pitch = self.pitch_nm;
        if !(pitch.is_finite() && pitch > 0.0) {
            return Err(Error::Pitch { pitch_nm: pitch });
        }
        let indices = self
            .layers
            .iter()
            .flat_map(|l| [l.inside, l.outside])
            .chain([self.below, self.above]);
        for n in indices {
            if !(n.re.is_finite() && n.im.is_finite() && n.re >= 0.0 && n.im >= 0.0 && n.norm() > 1e-3) {
                return Err(Error::Index { index: n });
            }
        }
        for (number, layer) in self.layers.iter().enumerate() {
            let height = layer.height_nm;
            if !(height.is_finite() && height > 0.0) {
                return Err(Error::Height {
                    layer: number + 1,
                    height_nm: height,
                });
            }
            let widest = layer
                .outline
                .extent_nm()
                .into_iter()
                .fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a });
            if !layer.outline.is_sound() || widest > pitch {
                return Err(Error::Width {
                    width_nm: widest,
                    pitch_nm: pitch,
                });
            }
        }
        Ok(())
    }
}
