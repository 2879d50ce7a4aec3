//! The phase of every site of an element.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use super::{PhaseTerm, RadialPhase};
use crate::spec::OutlineRows;
use crate::{Design, Element, LensOutline, LensSpec};
use metalith_core::Wedge;
use metalith_pillars::Lattice;

/// Radii that are tabulated at most: 64 MB. A lens of 1 mm has a million.
const MOST_ENTRIES: i64 = 1 << 23;

/// The radial phase on the sites of a lattice, tabulated once for all elements, or, for lenses with more radii than a
/// table is kept of, computed site by site. It is the same number either way.
///
/// The square of a site's radius is a whole number of squared half pitches, and squares of odd numbers
/// are one more than a multiple of eight: so one entry for each eighth serves all sites, and sites at
/// the same radius have the same phase to the last bit.
#[derive(Clone, Debug)]
pub struct LensPhase {
    lattice: Lattice,
    /// Greatest squared radius inside the lens: of a square lattice in squared half pitches, else of the diameter in nm^2.
    limit: i64,
    turns: PhaseOfRadius,
    /// Entries are this power of two apart in squared half pitches: a shift, since this is done for each pillar.
    stride_log2: u32,
    offset: i64,
    /// Rows where pillars stand within that radius, if the lens is not round.
    outline: Option<OutlineRows>,
    /// Phases over the plane that elements have besides.
    terms: Vec<PhaseTerm>,
    /// Elements, by their indices, whose lens is another or rotated.
    own: BTreeMap<(i32, i32), OwnPhase>,
}

/// Phase that an element has in place of the lens that all share.
#[derive(Clone, Debug)]
struct OwnPhase {
    lens: Arc<LensPhase>,
    rotation: Rotation,
}

/// Cosine and sine of a rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rotation(f64, f64);

impl Rotation {
    const NONE: Self = Self(1.0, 0.0);

    /// Rotation by so many degrees, from x towards y; exact where it is quarter turns.
    pub(crate) fn of_deg(deg: f64) -> Self {
        let quarters = (deg / 90.0).round();
        let (sin, cos) = (deg - 90.0 * quarters).to_radians().sin_cos();
        match quarters.rem_euclid(4.0) as u8 {
            0 => Self(cos, sin),
            1 => Self(-sin, cos),
            2 => Self(-cos, -sin),
            _ => Self(sin, -cos),
        }
    }

    /// Place to which the rotation takes a place.
    pub(crate) fn after(self, x: f64, y: f64) -> (f64, f64) {
        let Self(cos, sin) = self;
        (cos * x - sin * y, cos * y + sin * x)
    }

    /// Place of a rotated element before the rotation.
    fn before(self, x: f64, y: f64) -> (f64, f64) {
        let Self(cos, sin) = self;
        (cos * x + sin * y, cos * y - sin * x)
    }
}

/// Phase (turns) of a squared radius.
#[derive(Clone, Debug)]
enum PhaseOfRadius {
    Tabulated(Vec<f64>),
    Computed(RadialPhase),
}

impl LensPhase {
    /// The phase of the lens of a design, and of the separate lenses of elements.
    pub fn of(design: &Design) -> Self {
        let lattice = design.lattice();
        let rows = |outline: LensOutline| outline.rows(&lattice);
        let of_lens = |lens: &LensSpec| Self {
            outline: lens.outline.clone().map(rows),
            terms: lens.terms.clone(),
            ..Self::new(lattice, lens.diameter_nm, &lens.phase)
        };
        let mut shared = of_lens(&design.lens);
        // Elements of a round lens that are rotated alone share one table.
        let rotated = OnceCell::new();
        let mut own = BTreeMap::new();
        for element in design.elements() {
            let Some(placed) = design.array.placed(element.index) else {
                continue;
            };
            if placed.lens.is_none() && placed.rotation_deg == 0.0 {
                continue;
            }
            let lens = match &placed.lens {
                Some(_) => Arc::new(Self {
                    outline: design.outline_of(&element).map(rows),
                    ..of_lens(design.lens_of(&element))
                }),
                None if shared.outline.is_some() => Arc::new(Self {
                    outline: design.outline_of(&element).map(rows),
                    ..shared.clone()
                }),
                None => rotated.get_or_init(|| Arc::new(shared.clone())).clone(),
            };
            let rotation = Rotation::of_deg(placed.rotation_deg);
            own.insert(element.index, OwnPhase { lens, rotation });
        }
        shared.own = own;
        shared
    }

    /// Tabulate `radial` for a lens of this diameter on this lattice.
    pub fn new(lattice: Lattice, diameter_nm: u32, radial: &RadialPhase) -> Self {
        Self::with_entries(lattice, diameter_nm, radial, MOST_ENTRIES)
    }

    fn with_entries(lattice: Lattice, diameter_nm: u32, radial: &RadialPhase, most: i64) -> Self {
        let limit = lattice.most_units2(diameter_nm);
        let (stride_log2, offset) = if lattice.sites().is_multiple_of(2) {
            (3, 2)
        } else {
            (2, 0)
        };
        let entries = if limit < offset {
            0
        } else {
            ((limit - offset) >> stride_log2) + 1
        };
        // Zeros are not looked up in a table that is larger than caches are.
        let turns = if entries > most || !lattice.is_square() || *radial == RadialPhase::Flat {
            PhaseOfRadius::Computed(radial.clone())
        } else {
            let at = |k: i64| radial.turns(radius2_um2(lattice, (k << stride_log2) + offset));
            PhaseOfRadius::Tabulated((0..entries).map(at).collect())
        };
        Self {
            lattice,
            limit,
            turns,
            stride_log2,
            offset,
            outline: None,
            terms: Vec::new(),
            own: BTreeMap::new(),
        }
    }

    /// The lattice that it is tabulated on.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Phase over the radius at a site (turns), not reduced; none outside the lens.
    pub fn turns(&self, ix: usize, iy: usize) -> Option<f64> {
        self.holds(ix, iy).then(|| self.turns_inside(ix, iy))
    }

    /// Variant of [`LensPhase::turns`] for a site that is known to be inside the lens.
    #[inline]
    fn turns_inside(&self, ix: usize, iy: usize) -> f64 {
        let r2 = self.lattice.units2(ix, iy);
        match &self.turns {
            PhaseOfRadius::Tabulated(turns) => turns[((r2 - self.offset) >> self.stride_log2) as usize],
            PhaseOfRadius::Computed(radial) => radial.turns(radius2_um2(self.lattice, r2)),
        }
    }

    /// Columns of a row that are inside the lens, in closed form: of a round lens on a square lattice. None of any other, whose sites are
    /// asked one by one.
    fn columns(&self, iy: usize) -> Option<Range<usize>> {
        if self.outline.is_some() || !self.lattice.is_square() {
            return None;
        }
        // In half pitches from the middle, in steps of two.
        let last = self.lattice.sites() as i64 - 1;
        let y = self.lattice.half_index(iy);
        let Some(reach) = (self.limit - y * y).checked_isqrt() else {
            return Some(0..0);
        };
        let reach = reach.min(last);
        let reach = reach - ((reach ^ last) & 1);
        Some(if reach < 0 {
            0..0
        } else {
            ((last - reach) / 2) as usize..((last + reach) / 2 + 1) as usize
        })
    }

    /// True if a site is inside the lens.
    pub fn holds(&self, ix: usize, iy: usize) -> bool {
        let place = |axis, i| self.lattice.whole_nm(axis, i);
        self.lattice.units2(ix, iy) <= self.limit
            && self.lattice.has(ix, iy)
            && self
                .outline
                .as_ref()
                .is_none_or(|o| o.holds(iy, place(0, ix), place(1, iy)))
    }
}

/// The largest whole number that is not above a phase of less than 2^53 turns: by a conversion, since rounding is a call, and this
/// is done for each pillar.
#[inline]
fn floor(turns: f64) -> f64 {
    let cut = turns as i64 as f64;
    if cut > turns { cut - 1.0 } else { cut }
}

/// Squared radius (um^2) of one of [`Lattice::units2`].
#[inline]
fn radius2_um2(lattice: Lattice, r2: i64) -> f64 {
    r2 as f64 * lattice.unit_um() * lattice.unit_um()
}

/// The phase of one element: that of its lens, and its wedge.
#[derive(Clone, Debug)]
pub struct ElementPhase<'a> {
    lens: &'a LensPhase,
    /// Phases over the plane that it has.
    terms: Vec<&'a PhaseTerm>,
    /// Rotation of phases over the plane.
    rotation: Rotation,
    /// Turns a half step of the lattice along x and y.
    step: (f64, f64),
}

impl<'a> ElementPhase<'a> {
    /// The phase of an element.
    pub fn of(lens: &'a LensPhase, element: &Element) -> Self {
        let (lens, rotation) = match lens.own.get(&element.index) {
            Some(own) => (own.lens.as_ref(), own.rotation),
            None => (lens, Rotation::NONE),
        };
        Self {
            terms: lens.terms.iter().filter(|t| t.is_of(element.index)).collect(),
            rotation,
            ..Self::new(lens, &element.wedge)
        }
    }

    /// The lens with a wedge on it and nothing else.
    pub fn new(lens: &'a LensPhase, wedge: &Wedge) -> Self {
        let [x, y] = lens
            .lattice
            .steps_nm()
            .map(|step| step * 1e-3 / 2.0 / wedge.wavelength_um);
        Self {
            lens,
            terms: Vec::new(),
            rotation: Rotation::NONE,
            step: (x * wedge.sin_x, y * wedge.sin_y),
        }
    }

    /// The lattice that it is tabulated on.
    pub fn lattice(&self) -> Lattice {
        self.lens.lattice
    }

    /// True if the lens is round and has no wedge: its phase is equal at sites of one radius.
    pub fn is_radial(&self) -> bool {
        self.step == (0.0, 0.0) && self.is_steered_alone()
    }

    /// True if the lens is round and has nothing but a wedge: a symmetry that turns the wedge into that of another
    /// element of the lens turns the element into that.
    pub fn is_steered_alone(&self) -> bool {
        self.terms.is_empty() && self.lens.outline.is_none()
    }

    /// True if sites on both sides of the x axis have equal phases, to the last bit. Not every such phase is known to
    /// be one.
    pub fn is_mirrored(&self) -> bool {
        let is_round = self.lens.outline.is_none() && self.rotation == Rotation::NONE;
        is_round && self.step.1 == 0.0 && self.terms.iter().all(|term| term.is_mirrored())
    }

    /// True if another element has the same lens.
    pub fn is_of_lens(&self, other: &ElementPhase<'_>) -> bool {
        std::ptr::eq(self.lens, other.lens)
    }

    /// True if a site is inside the lens.
    pub fn holds(&self, ix: usize, iy: usize) -> bool {
        self.lens.holds(ix, iy)
    }

    /// Columns of a row that are inside the lens, where they are known without a look at each site.
    pub(crate) fn columns(&self, iy: usize) -> Option<Range<usize>> {
        self.lens.columns(iy)
    }

    /// Phase at a site (turns), not reduced; none outside the lens.
    pub fn turns(&self, ix: usize, iy: usize) -> Option<f64> {
        self.holds(ix, iy).then(|| self.turns_inside(ix, iy))
    }

    /// Variant of [`ElementPhase::turns`] for a site that is known to be inside the lens.
    #[inline]
    fn turns_inside(&self, ix: usize, iy: usize) -> f64 {
        let steered = self.steered(ix, iy);
        if self.terms.is_empty() {
            return steered;
        }
        let (x_um, y_um) = self.place_of_terms(ix, iy);
        self.terms
            .iter()
            .fold(steered, |sum, term| sum + term.turns(x_um, y_um))
    }

    /// Phase in two parts (waves) whose sum it is, but for rounding: the part that is known exactly, and the sum of
    /// maps that are known up to whole waves. From site to site the second may jump by whole waves that the map does
    /// not mean.
    pub fn parts(&self, ix: usize, iy: usize) -> Option<[f64; 2]> {
        if !self.holds(ix, iy) {
            return None;
        }
        let mut parts = [self.steered(ix, iy), 0.0];
        if !self.terms.is_empty() {
            let (x_um, y_um) = self.place_of_terms(ix, iy);
            for term in &self.terms {
                parts[usize::from(term.is_wrapped())] += term.turns(x_um, y_um);
            }
        }
        Some(parts)
    }

    /// Phase of the lens and its wedge at a site inside the lens (turns), not reduced.
    #[inline]
    fn steered(&self, ix: usize, iy: usize) -> f64 {
        let radial = self.lens.turns_inside(ix, iy);
        let (x, y) = (
            self.lens.lattice.half_index(ix) as f64,
            self.lens.lattice.half_index(iy) as f64,
        );
        // The two parts of the wedge are added first: exchanging x and y then gives the same sum.
        radial + (x * self.step.0 + y * self.step.1)
    }

    /// Place at which phases over the plane are evaluated for a site, from the middle of the element before it was
    /// rotated (um).
    fn place_of_terms(&self, ix: usize, iy: usize) -> (f64, f64) {
        let lattice = self.lens.lattice;
        self.rotation.before(lattice.place_um(0, ix), lattice.place_um(1, iy))
    }

    /// Phase at a site modulo one turn, in [0, 1); none outside the lens.
    pub fn wrapped(&self, ix: usize, iy: usize) -> Option<f64> {
        self.holds(ix, iy).then(|| self.wrapped_inside(ix, iy))
    }

    /// Variant of [`ElementPhase::wrapped`] for a site that is known to be inside the lens.
    #[inline]
    pub(crate) fn wrapped_inside(&self, ix: usize, iy: usize) -> f64 {
        let turns = self.turns_inside(ix, iy);
        let u = turns - floor(turns);
        // A tiny negative phase rounds up to one whole turn.
        if u < 1.0 { u } else { 0.0 }
    }

    /// Phases modulo one turn of consecutive sites from a distance to the middle (um) on; the direction is along an axis or a diagonal, where
    /// there is a site at every step along either axis. On a hexagonal lattice it is along an axis, and every other site stands one place of
    /// the grid beside it. None if the lens ends before, or there is no such row.
    pub fn row(&self, radius_um: f64, direction: [i32; 2], sites: usize) -> Option<Vec<f64>> {
        let lattice = self.lattice();
        let [dx, dy] = direction;
        let slanted = dx != 0 && dy != 0;
        if slanted && !lattice.is_square() {
            return None;
        }
        let steps = if lattice.is_square() {
            radius_um / lattice.pitch_um() / f64::from(dx).hypot(f64::from(dy))
        } else {
            radius_um / lattice.steps_um()[usize::from(dx == 0)]
        };
        let middle = lattice.sites() as i32 / 2;
        let [x, y] = direction.map(|d| middle + (steps * f64::from(d)) as i32);
        (0..sites as i32)
            .map(|k| {
                let beside = i32::from(!lattice.is_square() && (x + y + k) % 2 != 0);
                let (x, y) = if slanted {
                    (x + dx * ((k + 1) / 2), y + dy * (k / 2))
                } else {
                    (x + dx * k + beside * dy.abs(), y + dy * k + beside * dx.abs())
                };
                self.wrapped(usize::try_from(x).ok()?, usize::try_from(y).ok()?)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests;
