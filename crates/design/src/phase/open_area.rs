//! Area of a design that is open to light.

use super::{ElementPhase, LensPhase};
use crate::{Design, Element};

/// Areas of the sites that are inside lenses (um^2).
#[derive(Clone, Debug, PartialEq)]
pub struct OpenAreas {
    /// Open area of the lens that elements share.
    pub lens_um2: f64,
    /// Open area of each element, in the order of [`Design::elements`].
    pub elements_um2: Vec<f64>,
}

impl OpenAreas {
    /// Open areas of a design.
    pub fn of(design: &Design) -> Self {
        let lens = LensPhase::of(design);
        let elements = design.elements();
        // Whatever its wedge.
        let shared = ElementPhase::new(&lens, &elements[0].wedge);
        let lens_um2 = shared.open_um2();
        let of_element = |element: &Element| {
            let phase = ElementPhase::of(&lens, element);
            if phase.is_of_lens(&shared) {
                lens_um2
            } else {
                phase.open_um2()
            }
        };
        Self {
            lens_um2,
            elements_um2: elements.iter().map(of_element).collect(),
        }
    }
}

impl ElementPhase<'_> {
    /// Area of the sites that are inside the lens (um^2).
    pub fn open_um2(&self) -> f64 {
        let lattice = self.lattice();
        let n = lattice.sites();
        let sites = (0..n).flat_map(|iy| (0..n).map(move |ix| (ix, iy)));
        let held = sites.filter(|(ix, iy)| self.holds(*ix, *iy));
        lattice.cell_um2() * held.count() as f64
    }
}
