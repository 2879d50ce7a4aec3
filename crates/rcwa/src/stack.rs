//! Input of the solver: layers on a lattice, in optical constants.

use metalith_pillars::{DatabaseUnit, Lattice, LatticeKind, Pitch};
use num_complex::Complex64;
use serde::Serialize;

use super::basis::RetainedOrders;
use super::outline::Outline;
use super::{Error, Result};

/// Lattice on which the pillars of a cell stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CellLattice {
    /// One pitch apart along x and along y.
    #[default]
    Square,
    /// Rows along x, one pitch apart in a row, each row shifted by half a pitch against the next. Orders of such a lattice
    /// are counted by its rectangle of one pitch by two rows; those whose sum is odd do not exist.
    Staggered {
        /// Distance of two rows (nm).
        row_nm: f64,
    },
}

impl CellLattice {
    /// Staggered rows in which every pillar has six neighbours one pitch away.
    pub fn hexagonal(pitch_nm: f64) -> Self {
        Self::Staggered {
            row_nm: ROW_OF_HEXAGONAL * pitch_nm,
        }
    }

    /// The lattice of such a kind as it is drawn, where rows are whole database units apart.
    pub fn drawn(kind: LatticeKind, pitch: Pitch, unit: DatabaseUnit) -> Self {
        match kind {
            LatticeKind::Square => Self::Square,
            LatticeKind::Hexagonal => Self::Staggered {
                row_nm: kind.row_nm(pitch, unit),
            },
        }
    }

    /// The lattice that pillars of a file stand on.
    pub fn of(lattice: &Lattice) -> Self {
        match lattice.kind() {
            LatticeKind::Square => Self::Square,
            LatticeKind::Hexagonal => Self::Staggered {
                row_nm: lattice.row_nm(),
            },
        }
    }

    /// The kind of lattice that it is drawn as.
    pub fn kind(self) -> LatticeKind {
        match self {
            Self::Square => LatticeKind::Square,
            Self::Staggered { .. } => LatticeKind::Hexagonal,
        }
    }

    /// Distance of two rows (nm).
    pub fn row_nm(self, pitch_nm: f64) -> f64 {
        match self {
            Self::Square => pitch_nm,
            Self::Staggered { row_nm } => row_nm,
        }
    }

    /// Distance of the nearest two pillars (nm), which is as wide as a pillar may be.
    pub fn nearest_nm(self, pitch_nm: f64) -> f64 {
        match self {
            Self::Square => pitch_nm,
            Self::Staggered { row_nm } => pitch_nm.min((0.5 * pitch_nm).hypot(row_nm)).min(2.0 * row_nm),
        }
    }

    /// True if a sixth of a turn leaves it unchanged, but for rounding.
    pub fn is_hexagonal(self, pitch_nm: f64) -> bool {
        const ROUNDING: f64 = 1e-12;
        matches!(self, Self::Staggered { row_nm } if (row_nm - ROW_OF_HEXAGONAL * pitch_nm).abs() <= ROUNDING * pitch_nm)
    }
}

/// Distance of the rows of a hexagonal lattice over its pitch: half the root of three.
const ROW_OF_HEXAGONAL: f64 = 0.866_025_403_784_438_6;

/// Layers between two half-spaces, all on one lattice, centred on one another.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerStack {
    /// Pitch of the lattice (nm).
    pub pitch_nm: f64,
    /// Lattice of the pillars; staggered rows have circles.
    pub lattice: CellLattice,
    /// Complex index of the half-space below, where the substrate is.
    pub below: Complex64,
    /// Layers from the substrate upwards.
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

/// Number of diffraction orders kept along each axis, odd: 13 keeps -6..=6. Of pillars that have sides in all directions, and of
/// staggered rows, as many orders as that makes or some fewer, in a circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Orders(usize);

impl Orders {
    /// Largest number of orders along an axis; past it a matrix alone takes gigabytes.
    pub const MOST: usize = 127;

    /// Orders, so many along each axis.
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
    /// This stack seen from the other side.
    pub(super) fn flipped(&self) -> Self {
        Self {
            pitch_nm: self.pitch_nm,
            lattice: self.lattice,
            below: self.above,
            layers: self.layers.iter().rev().cloned().collect(),
            above: self.below,
        }
    }

    /// True if a quarter of a turn leaves it unchanged, so that x and y polarisation respond equally.
    pub(super) fn is_square(&self) -> bool {
        self.lattice == CellLattice::Square && self.layers.iter().all(|l| l.outline.is_square())
    }

    /// Wavelength over the periods along x and y, whose orders are counted.
    pub(super) fn steps(&self, wavelength_nm: f64) -> [f64; 2] {
        let along_y = match self.lattice {
            CellLattice::Square => self.pitch_nm,
            CellLattice::Staggered { row_nm } => 2.0 * row_nm,
        };
        [wavelength_nm / self.pitch_nm, wavelength_nm / along_y]
    }

    /// True if both axes mirror it.
    pub(super) fn is_mirrored(&self) -> bool {
        self.layers.iter().all(|l| l.outline.is_mirrored())
    }

    /// True if any pillar has sides along the axes.
    pub(super) fn has_upright(&self) -> bool {
        self.layers
            .iter()
            .any(|l| l.outline.is_upright() && !l.outline.is_empty())
    }

    /// True if any pillar has sides that are not along the axes.
    fn has_slanted(&self) -> bool {
        self.layers
            .iter()
            .any(|l| !l.outline.is_upright() && !l.outline.is_empty())
    }

    /// Plane waves that are retained of so many orders.
    pub(super) fn kept(&self, orders: Orders) -> RetainedOrders {
        match self.lattice {
            CellLattice::Square if self.has_slanted() && !self.has_upright() => {
                RetainedOrders::disc(orders.along_axis())
            }
            CellLattice::Square => RetainedOrders::Square(orders.highest()),
            CellLattice::Staggered { .. } => RetainedOrders::circle(orders.along_axis()),
        }
    }

    /// Refuses what cannot be, before anything is computed from it.
    pub(super) fn check(&self) -> Result<()> {
        let pitch = self.pitch_nm;
        if !(pitch.is_finite() && pitch > 0.0) {
            return Err(Error::Pitch { pitch_nm: pitch });
        }
        let row_nm = self.lattice.row_nm(pitch);
        if !(row_nm.is_finite() && row_nm > 0.0) {
            return Err(Error::Row { row_nm });
        }
        let nearest = self.lattice.nearest_nm(pitch);
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
            if !layer.outline.is_sound() || widest > nearest {
                return Err(Error::Width {
                    width_nm: widest,
                    pitch_nm: nearest,
                });
            }
            if self.lattice != CellLattice::Square && !layer.outline.is_circle() && !layer.outline.is_empty() {
                return Err(Error::StaggeredOutline { layer: number + 1 });
            }
        }
        Ok(())
    }
}
