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
pub use plan::{ElementSite, Elements, ExtractedElement, Extraction, ExtractionPlan};
pub use survey::{LayerSummary, Survey, TextSummary};

use crate::error::{Error, Result};
use crate::gds::{Layout, Selection};
use crate::lattice::WidthMap;
use crate::progress::Progress;
use pillars::Pillars;
use sites::{Scale, Sites};

/// Sites of all elements together: 5 x 5 lenses of 1 mm have 204 million.
const MOST_SITES: u64 = 1 << 28;

/// Read the pillars of every element out of a layout.
///
/// # Errors
/// If the layout has no single top cell, dangling or circular references, if no element is found or one is
/// out of all proportion, or if the file cannot be read.
pub fn extract(layout: &Layout, plan: &ExtractionPlan, progress: &dyn Progress) -> Result<Extraction> {
    let scale = Scale::of(layout)?;
    let selection = Selection {
        top: plan.top.clone(),
        ..Selection::default()
    };
    let roots = layout.roots(&selection)?;
    let sites = match &plan.elements {
        Elements::Given(sites) => sites.clone(),
        Elements::Discover => discover::discover(layout, plan, scale, progress)?,
    };
    let total: u64 = sites.iter().map(|s| (s.lattice.sites() as u64).pow(2)).sum();
    if total > MOST_SITES {
        return Err(Error::invalid(
            format!("{} elements with {total} lattice sites together", sites.len()),
            format!("up to {MOST_SITES} sites are held; read part of the layout with --top"),
        ));
    }
    let mut elements: Vec<ExtractedElement> = sites
        .iter()
        .map(|site| ExtractedElement {
            site: site.clone(),
            widths: WidthMap::empty(site.lattice),
        })
        .collect();
    let index = Sites::new(&sites, scale);
    let mut pillars = Pillars::new(plan, scale, index, &mut elements);
    layout.visit(&selection, &mut pillars, progress)?;
    let (oddities, survey, pillars) = pillars.finish();
    Ok(Extraction {
        top: layout.cells()[roots[0]].name.clone(),
        elements,
        pillars,
        oddities,
        survey,
    })
}
