//! How much of a design is open to light.

use super::{ElementPhase, LensPhase};
use crate::{Design, Element};

/// Areas of the sites that are inside lenses (um^2).
#[derive(Clone, Debug, PartialEq)]
pub struct OpenAreas {
    /// Of the lens that elements share.
    pub lens_um2: f64,
    /// Of each element, in the order of [`Design::elements`].
    pub elements_um2: Vec<f64>,
}

impl OpenAreas {
    /// Of a design.
    pub fn of(design: &Design) -> Self {
        let lens = LensPhase::of(design);
        let lens_um2 = area_um2(&lens, |ix, iy| lens.holds(ix, iy));
        let of_element = |element: Element| {
            let phase = ElementPhase::of(&lens, &element);
            match phase.is_of_lens(&ElementPhase::new(&lens, &element.wedge)) {
                true => lens_um2,
                false => area_um2(&lens, |ix, iy| phase.holds(ix, iy)),
            }
        };
        Self {
            lens_um2,
            elements_um2: design.elements().into_iter().map(of_element).collect(),
        }
    }
}

fn area_um2(lens: &LensPhase, holds: impl Fn(usize, usize) -> bool) -> f64 {
    let lattice = lens.lattice();
    let n = lattice.sites();
    let held = (0..n)
        .flat_map(|iy| (0..n).map(move |ix| (ix, iy)))
        .filter(|(ix, iy)| holds(*ix, *iy));
    lattice.cell_um2() * held.count() as f64
}
