//! Layout bytes -> the pillars of each element, and everything on the pillar layer that is not one.
//!
//! Nothing here knows how the file was written: pillars are what stands on the pillar layer with every
//! reference followed. Elements stand where a design says ([`Elements::Given`]), or where clusters of
//! pillars on a common lattice are found ([`Elements::Discover`]).

mod discover;
mod filler;
mod lattices;
mod left_out;
mod named_shapes;
mod phases;
mod pillars;
mod places;
mod plan;
mod rounded;
mod sites;
mod sizes;
mod stored_pillars;
pub(crate) mod survey;
mod tiles;
mod turned;
mod unrecognised_shapes;

pub use left_out::{LeftOut, MOST_LEFT_OUT};
pub use plan::{Elements, ExtractedElement, Extraction, ExtractionPlan};
pub use survey::{LayerSummary, Survey, TextSummary};
pub use unrecognised_shapes::{ReasonCounts, UnrecognisedShape, UnrecognisedShapes, Why};

use std::path::Path;

use crate::{Error, ExtractionError, Layout, ReadLimits, Result};
use metalith_core::{LayerNumber, Named, Progress};
pub use metalith_pillars::ElementSite;
use metalith_pillars::{EighthMap, PillarMap, PillarReader, PillarShape};
use pillars::PillarCollector;
use turned::visit_turned;

pub use discover::{Discovered, discover};
pub use filler::Filler;
pub use places::PlaceFit;
pub(crate) use plan::turned;
pub use sites::Scale;
pub use stored_pillars::StoredPillars;

/// Memory of the sites of all elements where the layout says how large they are (1.1 GB): 5 x 5 lenses of 1 mm, two bytes a site, take
/// 408 MB, an eighth of a lens of 30 mm, a byte a site, 919 MB.
const MOST_BYTES: u64 = 1 << 30;
/// Memory of the sites of elements that a design gives (4.3 GB): a steered lens of 10 mm takes 1.6 GB.
const MOST_GIVEN_BYTES: u64 = 1 << 32;
/// Memory of a site of an element that is held in full (bytes).
const WHOLE_SITE_BYTES: u64 = 2;

/// Checks that the lattices of these elements can be held, before the layout at `path` is read.
///
/// # Errors
/// [`ExtractionError::Sites`] if they have too many sites together.
pub fn fits(path: &Path, elements: &[ElementSite]) -> Result<()> {
    fits_within(path, elements, &vec![Holding::Whole; elements.len()], MOST_BYTES)
}

/// Way in which an element is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holding {
    /// All sites.
    Whole,
    /// An eighth of them, which symmetry makes whole.
    Eighth,
}

/// Memory of these elements of a design (bytes), of an eighth as long as it takes a byte a site.
pub fn held_bytes(elements: &[ElementSite], holdings: &[Holding]) -> u64 {
    let held = |(e, holding): (&ElementSite, &Holding)| match holding {
        Holding::Whole => WHOLE_SITE_BYTES * (e.lattice.sites() as u64).pow(2),
        Holding::Eighth => EighthMap::sites(e.lattice),
    };
    elements.iter().zip(holdings).map(held).sum()
}

/// Variant of [`fits`] for elements that a design gives, with the way in which [`extract_folded`] holds each.
///
/// # Errors
/// As [`fits`].
pub fn fits_folded(path: &Path, elements: &[ElementSite], holdings: &[Holding]) -> Result<()> {
    fits_within(path, elements, holdings, MOST_GIVEN_BYTES)
}

fn fits_within(path: &Path, elements: &[ElementSite], holdings: &[Holding], most: u64) -> Result<()> {
    if held_bytes(elements, holdings) <= most {
        return Ok(());
    }
    Err(failed(path)(too_many_sites(elements.iter(), most)))
}

/// Error of elements that take more memory than this (bytes).
fn too_many_sites<'e>(elements: impl ExactSizeIterator<Item = &'e ElementSite>, most: u64) -> ExtractionError {
    ExtractionError::Sites {
        elements: elements.len(),
        sites: elements.map(|e| (e.lattice.sites() as u64).pow(2)).sum(),
        most: most / WHOLE_SITE_BYTES,
    }
}

/// Error that says what is wrong with the layout at `path`.
fn failed(path: &Path) -> impl Fn(ExtractionError) -> Error {
    |cause| Error::Extraction {
        path: path.to_owned(),
        cause,
    }
}

/// Reads pillars out of layouts: where they are stated to be, or on another layer and below another cell.
#[derive(Clone, Debug)]
pub struct PillarsAt {
    /// Layer in place of the stated one.
    pub layer: Option<LayerNumber>,
    /// Cell to start from; the top cell if there is one only.
    pub top: Option<String>,
}

impl PillarsAt {
    /// Reads pillars where they are stated to be.
    pub const STATED: Self = Self { layer: None, top: None };

    fn plan(&self, plan: ExtractionPlan) -> ExtractionPlan {
        ExtractionPlan {
            pillar_layer: self.layer.unwrap_or(plan.pillar_layer),
            top: self.top.clone(),
            ..plan
        }
    }
}

impl PillarReader for PillarsAt {
    fn pillars(
        &self,
        layout: &Path,
        layer: LayerNumber,
        shape: PillarShape,
        elements: &[ElementSite],
        progress: &dyn Progress,
    ) -> metalith_core::Result<Vec<PillarMap>> {
        let file = Layout::open_with(layout, ReadLimits::default(), progress)?;
        let plan = self.plan(ExtractionPlan::given(layer, elements.to_vec()).of_shape(shape));
        let found = extract(&file, &plan, progress)?;
        Ok(found.elements.into_iter().map(|e| e.widths).collect())
    }

    fn elements(
        &self,
        layout: &Path,
        layer: LayerNumber,
        progress: &dyn Progress,
    ) -> metalith_core::Result<Vec<ElementSite>> {
        let file = Layout::open_with(layout, ReadLimits::default(), progress)?;
        Ok(sites_of(&file, &self.plan(ExtractionPlan::discover(layer)), progress)?.sites)
    }
}

/// Read the pillars of every element out of a layout.
///
/// # Errors
/// If the layout has no single top cell, dangling or circular references, if no element is found or one is
/// out of all proportion, or if the file cannot be read.
pub fn extract(layout: &Layout, plan: &ExtractionPlan, progress: &dyn Progress) -> Result<Extraction> {
    let found = sites_of(layout, plan, progress)?;
    fits(layout.path(), &found.sites)?;
    let folded = extract_from(layout, plan, found, MOST_BYTES, progress)?;
    let whole = |e: ExtractedElement<StoredPillars>| ExtractedElement {
        site: e.site,
        widths: e.widths.into_map(),
    };
    Ok(Extraction {
        top: folded.top,
        shape: folded.shape,
        elements: folded.elements.into_iter().map(whole).collect(),
        pillars: folded.pillars,
        oddities: folded.oddities,
        turned_deg: folded.turned_deg,
        survey: folded.survey,
    })
}

/// Variant of [`extract`] in which elements that are folded by all symmetries of the square stay folded, which makes
/// room for larger ones.
///
/// # Errors
/// As [`extract`].
pub fn extract_folded(
    layout: &Layout,
    plan: &ExtractionPlan,
    progress: &dyn Progress,
) -> Result<Extraction<StoredPillars>> {
    let found = sites_of(layout, plan, progress)?;
    let most = match plan.elements {
        Elements::Given(_) => MOST_GIVEN_BYTES,
        Elements::Discover => MOST_BYTES,
    };
    extract_from(layout, plan, found, most, progress)
}

/// The elements of a layout, as given or as found, and the shape of their pillars.
fn sites_of(layout: &Layout, plan: &ExtractionPlan, progress: &dyn Progress) -> Result<Discovered> {
    layout.roots(&plan.selection())?;
    let mut found = match &plan.elements {
        Elements::Given(sites) => Discovered {
            sites: sites.clone(),
            shape: PillarShape::default(),
            majority: PillarShape::default(),
            fits: Vec::new(),
            turn: None,
        },
        Elements::Discover => {
            let scale = Scale::of(layout)?;
            let found = discover(layout, &plan.selection(), &[plan.pillar_layer], scale, progress);
            let mut found = match found {
                Err(Error::Extraction {
                    path,
                    cause: ExtractionError::NoElements { layers, .. },
                }) => {
                    let contents = Some(crate::inventory::contents::words(layout, &plan.selection(), progress)?);
                    let cause = ExtractionError::NoElements { layers, contents };
                    return Err(Error::Extraction { path, cause });
                }
                other => other?,
            };
            ElementSite::widen(&mut found.sites);
            found
        }
    };
    found.shape = plan.shape.unwrap_or(found.shape);
    Ok(found)
}

/// The pillars of elements as they were discovered, below the cell and on the layer of a plan.
///
/// # Errors
/// As [`extract`].
pub(crate) fn recognise(
    layout: &Layout,
    plan: &ExtractionPlan,
    mut found: Discovered,
    progress: &dyn Progress,
) -> Result<Extraction<StoredPillars>> {
    ElementSite::widen(&mut found.sites);
    extract_from(layout, plan, found, MOST_BYTES, progress)
}

fn extract_from(
    layout: &Layout,
    plan: &ExtractionPlan,
    found: Discovered,
    most: u64,
    progress: &dyn Progress,
) -> Result<Extraction<StoredPillars>> {
    let selection = plan.selection();
    let top = layout.roots(&selection)?[0];
    let turn = found.turn;
    // Another layer may hold what was meant.
    if matches!(plan.elements, Elements::Given(_)) && layout.shapes_on(plan.pillar_layer) == 0 {
        return Err(failed(layout.path())(ExtractionError::NoElements {
            layers: plan.pillar_layer.to_string(),
            contents: Some(crate::inventory::contents::words(layout, &selection, progress)?),
        }));
    }
    let mut pillars = PillarCollector::new(layout.path(), plan, found, Scale::of(layout)?, most);
    visit_turned(
        layout,
        &selection,
        turn,
        &mut pillars,
        &Named(progress, "reading pillars"),
    )?;
    let name = layout.cells()[top].name.clone();
    pillars.finish(name).map_err(failed(layout.path()))
}
