//! Pillars of an element that are made when they are asked for.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use metalith_pillars::{EighthMap, Lattice, PillarMap, PillarRows, PillarShape, RowExtent};

use super::{PillarRule, Symmetry, SymmetryGroup};
use crate::Element;
use crate::phase::{ElementPhase, LensPhase};

/// The pillars of one element as a function of the site: no memory but that of the lens's phase, which all elements
/// share.
#[derive(Clone, Debug)]
pub struct ComputedWidths {
    lens: Arc<LensPhase>,
    /// Phase of light polarised along y, if it is another.
    along_y: Option<Arc<LensPhase>>,
    rule: Arc<PillarRule>,
    element: Element,
}

impl ComputedWidths {
    pub(super) fn new(
        lens: Arc<LensPhase>,
        along_y: Option<Arc<LensPhase>>,
        rule: Arc<PillarRule>,
        element: Element,
    ) -> Self {
        Self {
            lens,
            along_y,
            rule,
            element,
        }
    }

    /// Another element of the same lens and mapping.
    pub(super) fn steered(&self, element: Element) -> Self {
        Self {
            element,
            ..self.clone()
        }
    }

    /// The pillars as a map, made on all threads.
    pub(super) fn map(&self) -> PillarMap {
        self.rule.widths(&self.phase(), self.phase_along_y().as_ref())
    }

    fn phase(&self) -> ElementPhase<'_> {
        ElementPhase::of(&self.lens, &self.element)
    }

    fn phase_along_y(&self) -> Option<ElementPhase<'_>> {
        self.along_y.as_ref().map(|lens| ElementPhase::of(lens, &self.element))
    }

    fn directions(&self) -> [f64; 2] {
        [self.element.wedge.sin_x, self.element.wedge.sin_y]
    }

    /// True if a symmetry turns this element into another of the same lens and mapping. The phase is a function of the
    /// exact radius and of the sum of two products with the wedge, so a symmetry that turns one wedge into the other
    /// turns one element into the other to the last bit. Of phases over the plane nothing is known: each such element
    /// is its own copy alone.
    pub fn maps(&self, symmetry: Symmetry, to: &Self) -> bool {
        if !(self.is_told_by_phase() && to.is_told_by_phase()) {
            return symmetry == Symmetry::IDENTITY && self.element == to.element;
        }
        let (own, other) = (self.phase(), to.phase());
        let [along_y, other_along_y] = [self, to].map(Self::phase_along_y);
        let same_along_y = match (&along_y, &other_along_y) {
            (Some(own), Some(other)) => own.is_of_lens(other),
            (own, other) => own.is_none() && other.is_none(),
        };
        symmetry.keeps_lattice(self.lens.lattice())
            && Arc::ptr_eq(&self.lens, &to.lens)
            && own.is_of_lens(&other)
            && same_along_y
            && self.rule == to.rule
            && self.element.wedge.wavelength_um == to.element.wedge.wavelength_um
            && symmetry.vector(self.directions()) == to.directions()
    }

    /// True if the phase tells which elements are copies of this one.
    pub(super) fn is_told_by_phase(&self) -> bool {
        self.phase().is_steered_alone() && self.phase_along_y().is_none_or(|phase| phase.is_steered_alone())
    }

    /// The symmetries that leave the element as it is.
    pub fn group(&self) -> SymmetryGroup {
        let shape = self.rule.shape();
        SymmetryGroup::of_those(|s| s.keeps(shape) && self.maps(s, self))
    }

    fn fill(iy: usize, columns: Range<usize>, room: &mut Vec<u16>, width: impl Fn(usize, usize) -> u16) -> &[u16] {
        room.clear();
        room.extend(columns.map(|ix| width(ix, iy)));
        room
    }
}

impl PillarRows for ComputedWidths {
    fn lattice(&self) -> Lattice {
        self.lens.lattice()
    }

    fn number(&self, ix: usize, iy: usize) -> u16 {
        let along_y = self.phase_along_y();
        self.rule.pillar(&self.phase(), along_y.as_ref(), ix, iy)
    }

    fn row<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        let (phase, along_y) = (self.phase(), self.phase_along_y());
        if let (None, Some(inside)) = (&along_y, phase.columns(iy)) {
            // Most of what is asked for is inside: no site is asked whether it is.
            let inside = common(&inside, &columns);
            room.clear();
            if !inside.is_empty() {
                room.resize(inside.start - columns.start, 0);
                room.extend(inside.map(|ix| self.rule.width_nm(phase.wrapped_inside(ix, iy))));
            }
            room.resize(columns.len(), 0);
            return room;
        }
        let width = |ix, iy| self.rule.pillar(&phase, along_y.as_ref(), ix, iy);
        Self::fill(iy, columns, room, width)
    }

    fn occupied<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        let phase = self.phase();
        Self::fill(iy, columns, room, |ix, iy| u16::from(phase.holds(ix, iy)))
    }

    /// Rows are counted on all threads; of an element with all eight symmetries an eighth is.
    fn histogram(&self) -> Vec<u64> {
        let lattice = self.lattice();
        let n = lattice.sites();
        let is_eighth = self.group().members().len() == Symmetry::ALL.len();
        // A row of the eighth is from the middle to the diagonal.
        let of_row = |mut counts: Vec<u64>, iy: usize| {
            let columns = if is_eighth { n / 2..iy + 1 } else { 0..n };
            let mut room = Vec::new();
            let row = self.row(iy, columns.clone(), &mut room);
            for (ix, &number) in columns.zip(row) {
                let copies = if is_eighth { lattice.copies(ix, iy) as u64 } else { 1 };
                let number = usize::from(number);
                if number >= counts.len() {
                    counts.resize(number + 1, 0);
                }
                counts[number] += copies;
            }
            counts
        };
        let added = |a: Vec<u64>, b: Vec<u64>| {
            let (mut longer, shorter) = if a.len() < b.len() { (b, a) } else { (a, b) };
            longer.iter_mut().zip(&shorter).for_each(|(to, from)| *to += from);
            longer
        };
        let first = if is_eighth { n / 2 } else { 0 };
        (first..n)
            .into_par_iter()
            .fold(Vec::new, of_row)
            .reduce(Vec::new, added)
    }

    fn extent(&self, iy: usize, columns: Range<usize>, room: &mut Vec<u16>) -> Option<RowExtent> {
        let Some(inside) = self.phase().columns(iy) else {
            return RowExtent::of(columns.start, self.occupied(iy, columns, room));
        };
        let inside = common(&inside, &columns);
        (!inside.is_empty()).then(|| RowExtent {
            first: inside.start,
            last: inside.end - 1,
            pillars: inside.len() as u64,
        })
    }
}

/// Columns of both.
fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.max(b.start)..a.end.min(b.end)
}

/// Pillars of a class of elements.
#[derive(Clone, Debug)]
pub enum ClassPillars {
    Held(PillarMap),
    /// Eighth of an element that all eight symmetries leave unchanged.
    Eighth(EighthMap),
    Computed(ComputedWidths),
}

impl ClassPillars {
    /// True if a symmetry turns `known` into these pillars: every site is compared if both are held.
    pub(super) fn is_copy(&self, symmetry: Symmetry, known: &Self) -> bool {
        match (known, self) {
            (Self::Held(from), Self::Held(to)) => symmetry.maps(from, to),
            (Self::Computed(from), Self::Computed(to)) => from.maps(symmetry, to),
            _ => false,
        }
    }

    /// The symmetries that leave the pillars, of this shape, as they are.
    pub(super) fn group(&self, shape: PillarShape) -> SymmetryGroup {
        match self {
            Self::Held(map) => SymmetryGroup::of_shape(map, shape),
            Self::Computed(computed) => computed.group(),
            Self::Eighth(_) => SymmetryGroup::of_those(|_| true),
        }
    }

    /// The pillars as a map, to be changed.
    pub fn map_mut(&mut self) -> &mut PillarMap {
        if !matches!(self, Self::Held(_)) {
            *self = Self::Held(self.whole());
        }
        match self {
            Self::Held(map) => map,
            Self::Eighth(_) | Self::Computed(_) => unreachable!("it is held by now"),
        }
    }

    /// The pillars as a map, made if they are not held.
    pub fn map(&self) -> Cow<'_, PillarMap> {
        match self {
            Self::Held(map) => Cow::Borrowed(map),
            other => Cow::Owned(other.whole()),
        }
    }

    fn rows(&self) -> &dyn PillarRows {
        match self {
            Self::Held(map) => map,
            Self::Eighth(map) => map,
            Self::Computed(computed) => computed,
        }
    }
}

impl PillarRows for ClassPillars {
    fn lattice(&self) -> Lattice {
        self.rows().lattice()
    }

    fn number(&self, ix: usize, iy: usize) -> u16 {
        self.rows().number(ix, iy)
    }

    fn row<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        self.rows().row(iy, columns, room)
    }

    fn occupied<'r>(&'r self, iy: usize, columns: Range<usize>, room: &'r mut Vec<u16>) -> &'r [u16] {
        self.rows().occupied(iy, columns, room)
    }

    fn extent(&self, iy: usize, columns: Range<usize>, room: &mut Vec<u16>) -> Option<RowExtent> {
        self.rows().extent(iy, columns, room)
    }

    fn histogram(&self) -> Vec<u64> {
        self.rows().histogram()
    }
}
