//! Layout bytes -> the pillars of each element, and everything on the pillar layer that is not one.
//!
//! Nothing here knows how the file was written: pillars are what stands on the pillar layer with every
//! reference followed. Elements stand where a design says ([`Elements::Given`]), or where clusters of
//! squares on a common lattice are found ([`Elements::Discover`]).

mod discover;
mod oddity;
mod pillars;
mod plan;
mod sites;
mod survey;

pub use oddity::{Oddities, Oddity, Why};
pub use plan::{Elements, ExtractedElement, Extraction, ExtractionPlan};
pub use survey::{LayerSummary, Survey, TextSummary};

use std::path::Path;

use crate::{Error, ExtractionError, Layout, Result};
pub use metalith_core::ElementSite;
use metalith_core::{LayerNumber, PillarReader, Progress, WidthMap};
use pillars::PillarCollector;

pub use discover::discover;
pub use pillars::Filler;
pub use sites::Scale;

/// Sites of all elements together: 5 x 5 lenses of 1 mm have 204 million.
const MOST_SITES: u64 = 1 << 28;

/// Whether the lattices of these elements can be held, known before the layout at `path` is read.
///
/// # Errors
/// [`ExtractionError::Sites`] if they have too many sites together.
pub fn fits(path: &Path, elements: &[ElementSite]) -> Result<()> {
    let sites = elements.iter().map(|e| (e.lattice.sites() as u64).pow(2)).sum();
    if sites <= MOST_SITES {
        return Ok(());
    }
    Err(Error::Extraction {
        path: path.to_owned(),
        cause: ExtractionError::Sites {
            elements: elements.len(),
            sites,
            most: MOST_SITES,
        },
    })
}

/// Reads pillars out of GDSII files.
#[derive(Clone, Copy, Debug, Default)]
pub struct GdsPillars;

impl PillarReader for GdsPillars {
    fn pillars(
        &self,
        layout: &Path,
        layer: LayerNumber,
        elements: &[ElementSite],
        progress: &dyn Progress,
    ) -> metalith_core::Result<Vec<WidthMap>> {
        let file = Layout::open(layout)?;
        let found = extract(&file, &ExtractionPlan::given(layer, elements.to_vec()), progress)?;
        Ok(found.elements.into_iter().map(|e| e.widths).collect())
    }
}

/// Read the pillars of every element out of a layout.
///
/// # Errors
/// If the layout has no single top cell, dangling or circular references, if no element is found or one is
/// out of all proportion, or if the file cannot be read.
pub fn extract(layout: &Layout, plan: &ExtractionPlan, progress: &dyn Progress) -> Result<Extraction> {
    let scale = Scale::of(layout)?;
    let selection = plan.selection();
    let roots = layout.roots(&selection)?;
    let sites = match &plan.elements {
        Elements::Given(sites) => sites.clone(),
        Elements::Discover => discover(layout, &plan.selection(), &[plan.pillar_layer], scale, progress)?,
    };
    fits(layout.path(), &sites)?;
    let mut pillars = PillarCollector::new(plan, sites, scale);
    layout.visit(&selection, &mut pillars, progress)?;
    Ok(pillars.finish(layout.cells()[roots[0]].name.clone()))
}
