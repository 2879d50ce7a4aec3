//! The square lattice that pillars stand on.

use ndarray::Array2;

use crate::WidthRows;
use crate::error::{Error, Result};

/// A square lattice of `sites` x `sites` places about the centre of an element.
///
/// Site `i` of an axis is at `(2 i - (sites - 1)) * pitch / 2`: with an even number of sites the centre
/// of the element is a corner between four sites, and a lens has all eight symmetries of the square.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Lattice {
    pitch_nm: u32,
    sites: usize,
}

impl Lattice {
    /// A lattice of `sites` places an axis, `pitch_nm` apart.
    ///
    /// # Errors
    /// If the pitch is zero or odd (half of it must be whole nanometres), or there are no sites.
    pub fn new(pitch_nm: u32, sites: usize) -> Result<Self> {
        if pitch_nm == 0 || !pitch_nm.is_multiple_of(2) {
            return Err(Error::invalid(
                format!("a pitch of {pitch_nm} nm puts pillar centres off the 1 nm grid"),
                "use an even, positive number of nanometres",
            ));
        }
        if sites == 0 || sites > 1 << 20 {
            return Err(Error::invalid(
                format!("a lattice of {sites} sites an axis"),
                "use between 1 and 1,048,576 sites an axis",
            ));
        }
        Ok(Self { pitch_nm, sites })
    }

    /// The smallest lattice with an even number of sites that covers a disc of this diameter.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn covering(diameter_nm: u32, pitch_nm: u32) -> Result<Self> {
        if pitch_nm == 0 {
            return Self::new(0, 1);
        }
        let sites = diameter_nm.div_ceil(pitch_nm) as usize;
        Self::new(pitch_nm, sites + sites % 2)
    }

    /// Distance of neighbouring sites (nm).
    pub fn pitch_nm(&self) -> u32 {
        self.pitch_nm
    }

    /// Distance of neighbouring sites (um).
    pub fn pitch_um(&self) -> f64 {
        f64::from(self.pitch_nm) * 1e-3
    }

    /// Number of sites an axis.
    pub fn sites(&self) -> usize {
        self.sites
    }

    /// Place of site `i` in half pitches from the centre: odd for an even number of sites.
    pub fn half_index(&self, i: usize) -> i64 {
        2 * i as i64 - (self.sites as i64 - 1)
    }

    /// Place of site `i` of an axis from the centre (nm).
    pub fn coordinate_nm(&self, i: usize) -> i64 {
        self.half_index(i) * i64::from(self.pitch_nm / 2)
    }

    /// Place of site `i` of an axis from the centre (um).
    pub fn coordinate_um(&self, i: usize) -> f64 {
        self.coordinate_nm(i) as f64 * 1e-3
    }

    /// Square of a site's distance from the centre, in half pitches: exact, so that sites related by
    /// symmetry agree to the last bit in everything computed from it.
    pub fn half_radius2(&self, ix: usize, iy: usize) -> i64 {
        let (x, y) = (self.half_index(ix), self.half_index(iy));
        x * x + y * y
    }
}

/// Pillar widths of one element on its lattice: the array that a layout is written from, and that is
/// read back from one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WidthMap {
    /// Where the sites are.
    pub lattice: Lattice,
    /// Width of the pillar at each site (nm), zero where there is none. Shape `[sites, sites]`, row
    /// index along +y, column index along +x. The width is its own index into tables of the cell.
    pub width_nm: Array2<u16>,
}

impl WidthMap {
    /// A lattice without pillars.
    pub fn empty(lattice: Lattice) -> Self {
        let n = lattice.sites();
        Self {
            lattice,
            width_nm: Array2::zeros((n, n)),
        }
    }

    /// Number of sites with a pillar.
    pub fn pillars(&self) -> u64 {
        WidthRows::pillars(self)
    }

    /// Radius of the circle about the element's centre that holds the centres of all of its pillars (um); zero
    /// without pillars.
    pub fn circle_um(&self) -> f64 {
        WidthRows::circle_um(self)
    }

    /// Number of pillars of each width; index is the width (nm), the first entry counts empty sites.
    pub fn histogram(&self) -> Vec<u64> {
        WidthRows::histogram(self)
    }
}
