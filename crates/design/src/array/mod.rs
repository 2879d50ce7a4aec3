//! From phase to pillars: the widths of every element, and which of them are copies of one another.

mod symmetry;
mod widths;

use std::borrow::Cow;

pub use symmetry::{DomainPart, Symmetry, SymmetryGroup};
pub use widths::WidthRule;

use crate::phase::{ElementPhase, LensPhase};
use crate::{Design, Element};
use metalith_core::Progress;
use metalith_core::{Error, Result};
use metalith_core::{Lattice, WidthMap};

/// Elements that are the same pillars up to a symmetry of the square.
#[derive(Clone, Debug)]
pub struct Class {
    /// Pillars of the first element of the class.
    pub widths: WidthMap,
    /// The symmetries of those pillars, each proven by comparing every site.
    pub group: SymmetryGroup,
}

/// One element, as a copy of a class.
#[derive(Clone, Copy, Debug)]
pub struct PlacedElement {
    pub element: Element,
    /// Index into [`PillarArray::classes`].
    pub class: usize,
    /// What turns the pillars of the class into those of the element.
    pub symmetry: Symmetry,
}

/// All pillars of the array, each distinct lens once.
#[derive(Clone, Debug)]
pub struct PillarArray {
    pub lattice: Lattice,
    pub classes: Vec<Class>,
    pub placed: Vec<PlacedElement>,
    /// Whether widths were moved on purpose, for what a process makes of them, from those that the mapping gives.
    pub compensated: bool,
}

impl PillarArray {
    /// Compute the widths of every element of a design and prove which of them are copies.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the user stopped it.
    pub fn build(design: &Design, progress: &dyn Progress) -> Result<Self> {
        let lattice = design.lattice();
        let lens = LensPhase::new(lattice, design.lens.diameter_nm, &design.lens.phase);
        let rule = WidthRule::new(&design.cell, &design.mapping);
        let elements = design.elements();
        progress.begin("widths of the elements", elements.len() as u64);
        let mut array = Self {
            lattice,
            classes: Vec::new(),
            placed: Vec::new(),
            compensated: false,
        };
        for element in elements {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let widths = rule.widths(&ElementPhase::new(&lens, &element.wedge));
            array.place(element, widths);
            progress.advance(1);
        }
        Ok(array)
    }

    /// Number of pillars of all elements.
    pub fn pillars(&self) -> u64 {
        let of_class = self.classes.iter().map(|c| c.widths.pillars()).collect::<Vec<_>>();
        self.placed.iter().map(|p| of_class[p.class]).sum()
    }

    /// The pillars of one element; those of its class where nothing is turned.
    pub fn widths(&self, placed: &PlacedElement) -> Cow<'_, WidthMap> {
        let widths = &self.classes[placed.class].widths;
        if placed.symmetry == Symmetry::IDENTITY {
            return Cow::Borrowed(widths);
        }
        Cow::Owned(placed.symmetry.apply(widths))
    }

    fn place(&mut self, element: Element, widths: WidthMap) {
        let copy = self.classes.iter().enumerate().find_map(|(class, known)| {
            let symmetry = Symmetry::ALL.into_iter().find(|s| s.maps(&known.widths, &widths))?;
            Some((class, symmetry))
        });
        let (class, symmetry) = copy.unwrap_or_else(|| {
            let group = SymmetryGroup::of(&widths);
            self.classes.push(Class { widths, group });
            (self.classes.len() - 1, Symmetry::IDENTITY)
        });
        self.placed.push(PlacedElement {
            element,
            class,
            symmetry,
        });
    }
}
