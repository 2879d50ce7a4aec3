//! Array of pillars made from the phase: the widths of every element, and the elements that are copies of one another.

mod computed_widths;
mod fundamental_domain;
mod pillar_rule;
mod symmetry;

use std::borrow::Cow;
use std::sync::Arc;

pub use computed_widths::{ClassPillars, ComputedWidths};
pub use fundamental_domain::DomainPart;
pub use pillar_rule::PillarRule;
pub use symmetry::{Symmetry, SymmetryGroup};

use crate::phase::LensPhase;
use crate::{Design, Element};
use metalith_core::{Error, Result};
use metalith_core::{Progress, Wedge};
use metalith_pillars::{EighthMap, Lattice, PillarMap, PillarRows, PillarShape};

/// Sites of an element that is held (128 MB): one of 2.8 mm. The pillars of a larger one are made as they are asked for.
const MOST_HELD: u64 = 1 << 26;

/// Sites of an eighth of an element that is held to be read whole (134 MB, 268 MB where many widths differ): one of 11 mm.
const MOST_EIGHTH: u64 = 1 << 27;

/// Places of elements without a design (nm): layouts have 32 bits for them.
const FARTHEST_NM: i64 = 1_000_000_000;

/// The wedge of an element that looks straight ahead, at all wavelengths.
const UNSTEERED: Wedge = Wedge {
    wavelength_um: 1.0,
    sin_x: 0.0,
    sin_y: 0.0,
};

/// Elements that are the same pillars up to a symmetry of the square.
#[derive(Clone, Debug)]
pub struct Class {
    /// Pillars of the first element of the class.
    pub widths: ClassPillars,
    /// The symmetries of those pillars: each proven by comparing every site, or, of an element that is not held, by its
    /// phase. Copies are proven by the phases of both where these suffice, else by comparing every site.
    pub group: SymmetryGroup,
}

/// One element, as a copy of a class.
#[derive(Clone, Copy, Debug)]
pub struct PlacedElement {
    pub element: Element,
    /// Index into [`PillarArray::classes`].
    pub class: usize,
    /// Symmetry that turns the pillars of the class into the pillars of the element.
    pub symmetry: Symmetry,
}

/// All pillars of the array, each distinct lens once.
#[derive(Clone, Debug)]
pub struct PillarArray {
    pub lattice: Lattice,
    /// Shape of the pillars.
    pub shape: PillarShape,
    pub classes: Vec<Class>,
    pub placed: Vec<PlacedElement>,
    /// True if widths were moved on purpose, for the process, from the widths that the mapping gives.
    pub compensated: bool,
}

impl PillarArray {
    /// Compute the widths of every element of a design and prove which of them are copies.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if the user stopped it.
    pub fn build(design: &Design, progress: &dyn Progress) -> Result<Self> {
        Self::build_within(design, MOST_HELD, progress)
    }

    /// Variant of [`PillarArray::build`] for a caller that reads each distinct element once: elements whose copies follow from their
    /// phases are made row by row whatever their size. The pillars, classes and symmetries are the same.
    ///
    /// # Errors
    /// As [`PillarArray::build`].
    pub fn build_to_write(design: &Design, progress: &dyn Progress) -> Result<Self> {
        Self::build_with(design, [0, MOST_HELD], progress)
    }

    /// The array of pillars that were not made from a design: maps of widths, or of the numbers of rotations of rectangles, with the
    /// places of their centres (nm). Copies and symmetries are found as those of a design are; nothing is steered.
    ///
    /// # Errors
    /// If there is none, they are not of one lattice, a place is farther than 1 m from the middle, or the user stopped it.
    pub fn of_maps(shape: PillarShape, maps: Vec<(PillarMap, (i64, i64))>, progress: &dyn Progress) -> Result<Self> {
        let Some(lattice) = maps.first().map(|(map, _)| map.lattice) else {
            return Err(Error::refused(
                "array/empty",
                "an array without elements",
                "give at least one map of widths",
            ));
        };
        progress.begin("comparing elements", maps.len() as u64);
        let mut array = Self {
            lattice,
            shape,
            classes: Vec::new(),
            placed: Vec::new(),
            compensated: false,
        };
        for (k, (map, centre_nm)) in maps.into_iter().enumerate() {
            progress.check_stopped()?;
            if map.lattice != lattice {
                let sites = [map.lattice.sites(), lattice.sites()];
                return Err(Error::refused(
                    "array/sizes-differ",
                    format!(
                        "map {k} has {} sites along an axis, the first has {}",
                        sites[0], sites[1]
                    ),
                    "give maps of one size and pitch: pad smaller ones with zeros",
                ));
            }
            if centre_nm.0.abs().max(centre_nm.1.abs()) > FARTHEST_NM {
                return Err(Error::refused(
                    "array/element-out-of-range",
                    format!("element {k} at ({}, {}) nm", centre_nm.0, centre_nm.1),
                    "place elements within 1 m of the middle",
                ));
            }
            let element = Element {
                index: (k as i32, 0),
                centre_nm,
                wedge: UNSTEERED,
            };
            array.place(element, ClassPillars::Held(map));
            progress.advance(1);
        }
        Ok(array)
    }

    /// Variant of [`PillarArray::build`] in which elements of more than `most_held` sites are made row by row, not
    /// held.
    ///
    /// # Errors
    /// As [`PillarArray::build`].
    pub fn build_within(design: &Design, most_held: u64, progress: &dyn Progress) -> Result<Self> {
        Self::build_with(design, [most_held; 2], progress)
    }

    /// Array in which elements of more sites are made row by row: of more than the first number where the phase tells which are
    /// copies, of more than the second where pillars alone do.
    fn build_with(design: &Design, [by_phase, by_pillars]: [u64; 2], progress: &dyn Progress) -> Result<Self> {
        let lattice = design.lattice();
        let lens = Arc::new(LensPhase::of(design));
        let along_y = design.along_y().map(|y| Arc::new(LensPhase::of(&y)));
        let sites = (lattice.sites() as u64).pow(2);
        let elements = design.elements();
        progress.begin("widths of the elements", elements.len() as u64);
        let mut array = Self {
            lattice,
            shape: design.cell.shape,
            classes: Vec::new(),
            placed: Vec::new(),
            compensated: false,
        };
        // Of each class, the element that it is of.
        let mut firsts: Vec<ComputedWidths> = Vec::new();
        for element in elements {
            progress.check_stopped()?;
            let rule = Arc::new(PillarRule::of_element(design, element.index));
            let computed = ComputedWidths::new(lens.clone(), along_y.clone(), rule, element);
            let most_held = if computed.is_told_by_phase() {
                by_phase
            } else {
                by_pillars
            };
            // Where the phases of two elements say that they are copies, no pillar is made to see it.
            match array.copy(|class, symmetry| firsts[class].maps(symmetry, &computed)) {
                Some((class, symmetry)) => array.placed.push(PlacedElement {
                    element,
                    class,
                    symmetry,
                }),
                None if sites <= most_held => array.place(element, ClassPillars::Held(computed.map())),
                None => array.place(element, ClassPillars::Computed(computed.clone())),
            }
            if firsts.len() < array.classes.len() {
                firsts.push(computed);
            }
            progress.advance(1);
        }
        Ok(array)
    }

    /// The element in the middle of the chip, or nearest to it.
    ///
    /// # Panics
    /// If there is no element: a design has at least one.
    pub fn central(&self) -> &PlacedElement {
        let nearest = self.placed.iter().min_by_key(|p| p.element.distance_nm2());
        nearest.expect("a design has at least one element")
    }

    /// Number of pillars of all elements.
    pub fn pillars(&self) -> u64 {
        let of_class = self.classes.iter().map(|c| c.widths.pillars()).collect::<Vec<_>>();
        self.placed.iter().map(|p| of_class[p.class]).sum()
    }

    /// The pillars of one element as a map; those of its class where nothing is turned.
    pub fn widths(&self, placed: &PlacedElement) -> Cow<'_, PillarMap> {
        match self.rows(placed) {
            Cow::Borrowed(rows) => rows.map(),
            Cow::Owned(ClassPillars::Held(map)) => Cow::Owned(map),
            Cow::Owned(other) => Cow::Owned(other.whole()),
        }
    }

    /// The first element of a class, in the order of the elements; none if the class has none.
    pub fn first_of(&self, class: usize) -> Option<&PlacedElement> {
        self.placed.iter().find(|placed| placed.class == class)
    }

    /// The pillars of one element, to be read row by row.
    pub fn rows(&self, placed: &PlacedElement) -> Cow<'_, ClassPillars> {
        let widths = &self.classes[placed.class].widths;
        match widths {
            _ if placed.symmetry == Symmetry::IDENTITY => Cow::Borrowed(widths),
            ClassPillars::Held(map) => Cow::Owned(ClassPillars::Held(placed.symmetry.apply(map))),
            // No symmetry turns it.
            ClassPillars::Eighth(_) => Cow::Borrowed(widths),
            ClassPillars::Computed(class) => Cow::Owned(ClassPillars::Computed(class.steered(placed.element))),
        }
    }

    /// Variant of [`PillarArray::rows`] for a caller that reads all rows: an element that is not held but has all eight
    /// symmetries is made once, as an eighth.
    pub fn all_rows(&self, placed: &PlacedElement) -> Cow<'_, ClassPillars> {
        let rows = self.rows(placed);
        let eighth = EighthMap::sites(self.lattice);
        match rows.as_ref() {
            ClassPillars::Computed(computed) if computed.group().members().len() == 8 && eighth <= MOST_EIGHTH => {
                Cow::Owned(ClassPillars::Eighth(EighthMap::of(computed)))
            }
            _ => rows,
        }
    }

    /// The first class that an element is a copy of, and the first symmetry that turns it into the element.
    fn copy(&self, is_copy: impl Fn(usize, Symmetry) -> bool) -> Option<(usize, Symmetry)> {
        (0..self.classes.len()).find_map(|class| {
            let mut kept = Symmetry::ALL.into_iter().filter(|s| s.keeps(self.shape));
            Some((class, kept.find(|s| is_copy(class, *s))?))
        })
    }

    fn place(&mut self, element: Element, widths: ClassPillars) {
        let copy = self.copy(|class, symmetry| widths.is_copy(symmetry, &self.classes[class].widths));
        let (class, symmetry) = copy.unwrap_or_else(|| {
            let group = widths.group(self.shape);
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::phase::ElementPhase;
    use metalith_core::Silent;

    /// Elements whose phases say that they are copies have the pillars that they have by themselves.
    #[test]
    fn copies_have_the_pillars_of_their_own_phase() {
        let designs = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs"));
        for (name, classes) in [
            ("mini_3x3", 3),
            ("array_2x4", 2),
            ("mixed_lenses", 4),
            ("hexagonal_1550", 1),
            ("birefringent_532", 1),
        ] {
            let design = Design::read(&designs.join(format!("{name}.toml"))).unwrap();
            let array = PillarArray::build(&design, &Silent).unwrap();
            let lens = LensPhase::of(&design);
            let along_y = design.along_y().map(|y| LensPhase::of(&y));
            for placed in &array.placed {
                let element = &placed.element;
                let y = along_y.as_ref().map(|y| ElementPhase::of(y, element));
                let own = PillarRule::of_element(&design, element.index);
                let own = own.widths(&ElementPhase::of(&lens, element), y.as_ref());
                assert_eq!(*array.widths(placed), own, "{name} {}", element.label());
            }
            assert_eq!(array.classes.len(), classes, "{name}");
        }
    }

    /// Counts of an element that is not held are those of its map: with all symmetries, on an even and an odd lattice, and with fewer.
    #[test]
    fn computed_pillars_are_counted_as_those_that_are_held() {
        let designs = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs"));
        let mini = designs.join("mini_3x3.toml");
        let text = std::fs::read_to_string(&mini).unwrap();
        for diameter_um in ["60", "60.4"] {
            let text = text.replace("diameter_um = 60", &format!("diameter_um = {diameter_um}"));
            let array = PillarArray::build_within(&Design::parse(&mini, &text).unwrap(), 0, &Silent).unwrap();
            assert_eq!(array.classes.len(), 3);
            for class in &array.classes {
                assert!(matches!(class.widths, ClassPillars::Computed(_)));
                assert_eq!(
                    class.widths.histogram(),
                    class.widths.whole().histogram(),
                    "{diameter_um} um"
                );
            }
        }
    }
}
