//! The elements of a set, with their pillars from the layout.

use std::path::Path;

use super::{APERTURE_DIAMETER_UM, whole};
use crate::set::{MeasuredElement, Stack};
use metalith_core::Result;
use metalith_core::document::{Limits, Section};
use metalith_pillars::{ElementSite, Lattice, PillarMap};

pub(super) fn elements(
    root: &Section<'_, '_>,
    stack: &Stack,
    layout: &Path,
    read: &dyn Fn(&[ElementSite]) -> Result<Vec<PillarMap>>,
) -> Vec<MeasuredElement> {
    let sections = root.sections("element");
    if sections.is_empty() {
        root.fault(
            "element",
            "no element",
            "add one [[element]] for each lens that was measured",
        );
    }
    let mut elements: Vec<MeasuredElement> = Vec::new();
    for s in &sections {
        let index = whole(s, "index", Limits::new(-1000.0..=1000.0, ""));
        let centre_um = s.array("centre_um", Limits::new(-1e6..=1e6, "um"));
        let aperture_diameter_um = s.float("aperture_diameter_um", APERTURE_DIAMETER_UM);
        s.finish();
        if elements.iter().any(|e| e.index == index) {
            s.fault("index", format!("element {index:?} is there twice"), "leave one out");
        }
        let diameter_nm = (stack.lens_diameter_um * 1e3).round() as u32;
        let lattice = Lattice::of_kind_covering(stack.cell.lattice.kind(), diameter_nm, stack.cell.pitch_nm as u32)
            .expect("an even pitch and a positive diameter");
        elements.push(MeasuredElement {
            index,
            centre_um,
            aperture_diameter_um,
            pillars: PillarMap::empty(lattice),
        });
    }
    if !layout.is_file() {
        return elements;
    }
    let sites: Vec<_> = elements
        .iter()
        .map(|e| ElementSite {
            name: format!("({}, {})", e.index[0], e.index[1]),
            centre_nm: e.centre_um.map(|c| (c * 1e3).round() as i64),
            lattice: e.pillars.lattice,
            within_nm: None,
        })
        .collect();
    match read(&sites) {
        Err(e) => root.fault("layout", e.to_string(), "give the layout that was written"),
        Ok(found) => {
            for ((element, found), s) in elements.iter_mut().zip(found).zip(&sections) {
                element.pillars = found;
                if element.pillars.pillars() == 0 {
                    s.fault(
                        "centre_um",
                        format!("the layout has no pillars of element {:?} here", element.index),
                        "correct its centre or its layer, or give the layout that was written",
                    );
                }
            }
        }
    }
    elements
}
