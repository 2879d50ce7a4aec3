//! The elements of a set, with their pillars from the layout.

use std::path::Path;

use super::{APERTURE_DIAMETER_UM, whole};
use crate::set::{MeasuredElement, Stack};
use metalith_core::document::{Limits, Section};
use metalith_core::{Error, LayerNumber, Progress, Result};
use metalith_pillars::{ElementSite, Lattice, PillarMap, PillarReader, PillarShape};

pub(super) fn elements(root: &Section<'_, '_>, stack: &Stack, layouts: &LayoutPillars<'_>) -> Vec<MeasuredElement> {
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
        let lattice = Lattice::of_kind_covering(
            stack.cell.lattice.kind(),
            stack.diameter_nm(),
            stack.cell.pitch_nm as u32,
        )
        .expect("an even pitch and a positive diameter");
        elements.push(MeasuredElement {
            index,
            centre_um,
            aperture_diameter_um,
            axis_um: [0.0; 2],
            pillars: PillarMap::empty(lattice),
        });
    }
    if !layouts.file.is_file() {
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
    if let Err(e) = layouts.fill(&mut elements, &sites, stack) {
        root.fault("layout", e.to_string(), "give the layout that was written");
        return elements;
    }
    let no_pillars: Vec<_> = elements
        .iter()
        .zip(&sections)
        .filter(|(e, _)| e.pillars.pillars() == 0)
        .collect();
    if no_pillars.is_empty() {
        return elements;
    }
    let there = layouts.lattices();
    for (element, s) in no_pillars {
        s.fault(
            "centre_um",
            format!("the layout has no pillars of element {:?} here", element.index),
            format!(
                "correct its centre, its layer, or pitch and lattice of [stack], or give the layout that was written{there}"
            ),
        );
    }
    elements
}

/// The pillars of a layout.
pub(super) struct LayoutPillars<'a> {
    pub reader: &'a dyn PillarReader,
    pub file: &'a Path,
    pub layer: LayerNumber,
    pub shape: PillarShape,
    pub progress: &'a dyn Progress,
}

impl LayoutPillars<'_> {
    fn read(&self, sites: &[ElementSite]) -> Result<Vec<PillarMap>> {
        self.reader
            .pillars(self.file, self.layer, self.shape, sites, self.progress)
    }

    fn found(&self) -> Result<Vec<ElementSite>> {
        self.reader.elements(self.file, self.layer, self.progress)
    }

    /// Read the pillars of elements: at the stated centres between four sites, or else where the layout has its sites.
    fn fill(&self, elements: &mut [MeasuredElement], sites: &[ElementSite], stack: &Stack) -> Result<()> {
        for (element, pillars) in elements.iter_mut().zip(self.read(sites)?) {
            element.pillars = pillars;
        }
        let empty: Vec<usize> = (0..elements.len())
            .filter(|&e| elements[e].pillars.pillars() == 0)
            .collect();
        if empty.is_empty() {
            return Ok(());
        }
        // A layer without elements is reported as elements without pillars.
        let found = match self.found() {
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            found => found.unwrap_or_default(),
        };
        let stated = &sites[0].lattice;
        let is_as_stated = |f: &&ElementSite| f.lattice.is_like(stated);
        let about = |e: usize| {
            let mut as_stated = found.iter().filter(is_as_stated);
            Some((
                e,
                as_stated.find_map(|f| f.about(sites[e].centre_nm, stack.diameter_nm()))?,
            ))
        };
        let (numbers, there): (Vec<usize>, Vec<ElementSite>) = empty.into_iter().filter_map(about).unzip();
        if there.is_empty() {
            return Ok(());
        }
        for ((e, site), pillars) in numbers.into_iter().zip(&there).zip(self.read(&there)?) {
            let element = &mut elements[e];
            let off_nm = [0, 1].map(|axis| sites[e].centre_nm[axis] - site.centre_nm[axis]);
            element.axis_um = off_nm.map(|nm| nm as f64 * 1e-3);
            element.pillars = pillars;
        }
        Ok(())
    }

    /// Lattices that the layout has on its layer, for a message; empty if none can be recognised.
    fn lattices(&self) -> String {
        let mut all: Vec<String> = Vec::new();
        for site in self.found().unwrap_or_default() {
            let kind = if site.lattice.is_square() {
                "square"
            } else {
                "hexagonal"
            };
            let own = format!("{kind} of {} nm", site.lattice.pitch_nm());
            if !all.contains(&own) {
                all.push(own);
            }
        }
        if all.is_empty() {
            "; no lattice can be recognised on its layer".into()
        } else {
            format!("; its layer has these lattices: {}", all.join(", "))
        }
    }
}
