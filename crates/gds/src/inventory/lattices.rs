//! Lattices that shapes of a layout stand on.

use serde::Serialize;

use super::LayerInventory;
use crate::extract::{Discovered, ExtractionPlan, LeftOut, Scale, discover, recognise, turned};
use crate::layout::Layout;
use crate::visit::Selection;
use crate::{Error, ExtractionError, Result};
use metalith_core::{LayerNumber, Progress};
use metalith_pillars::{ElementSite, LatticeKind};

/// Top cells that lattices are looked for in, and layers of each.
const TOPS: usize = 8;
const LAYERS: usize = 8;

/// Layers with fewer shapes that may be pillars than this part of those of the layer with the most are not looked at: marks
/// and labels would cost another reading of the file.
const LEAST_SHARE: u64 = 100;

/// Shapes of a layer whose pillars are counted, at most: to look at each of the 58 million of nine lenses of 1 mm would take six times
/// as long as all else.
const MOST_COUNTED: u64 = 1 << 24;

/// Elements that are listed for each layer; all are counted.
const LISTED: usize = 1000;

/// One element: pillars on a lattice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundElement {
    pub centre_nm: [i64; 2],
    /// "square" or "hexagonal".
    pub lattice: &'static str,
    pub pitch_nm: f64,
    /// Columns and rows of its lattice between its outermost pillars.
    pub columns: usize,
    pub rows: usize,
}

/// Elements on one layer below one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerLattices {
    pub layer: LayerNumber,
    pub top: String,
    /// Shape of most pillars, in the plural.
    pub pillars: &'static str,
    /// Number of pillars on sites; none if there are too many shapes to look at each.
    pub pillar_count: Option<u64>,
    /// Shapes of its elements that are no pillars, if there are any.
    pub left_out: Option<LeftOut>,
    /// Angle at which all of it stands (degrees), if it is not upright.
    pub turned_deg: Option<f64>,
    pub element_count: usize,
    /// The first elements.
    pub elements: Vec<FoundElement>,
}

impl FoundElement {
    fn of(site: &ElementSite, turned_deg: Option<f64>) -> Self {
        let [columns, rows] = site.reach().map(|reach| reach.len());
        Self {
            centre_nm: turned(site.centre_nm.map(|nm| nm as f64), turned_deg).map(|nm| nm.round() as i64),
            lattice: match site.lattice.kind() {
                LatticeKind::Square => "square",
                LatticeKind::Hexagonal => "hexagonal",
            },
            pitch_nm: site.lattice.pitch_nm().nm(),
            columns,
            rows,
        }
    }
}

/// Lattices below these cells, and why they were not looked for, if they were not.
pub(super) fn find(
    layout: &Layout,
    roots: &[usize],
    layers: &[LayerInventory],
    progress: &dyn Progress,
) -> Result<(Vec<LayerLattices>, Option<String>)> {
    let scale = match Scale::of(layout) {
        Ok(scale) => scale,
        Err(error) => return Ok((Vec::new(), Some(words(&error)))),
    };
    let most = layers.iter().map(|l| l.kinds.pillar_like()).max().unwrap_or(0);
    let mut chosen: Vec<&LayerInventory> = layers
        .iter()
        .filter(|l| l.kinds.pillar_like() > 1 && l.kinds.pillar_like() >= most / LEAST_SHARE)
        .collect();
    chosen.sort_by_key(|l| (std::cmp::Reverse(l.kinds.pillar_like()), l.layer));
    let (mut found, mut left_out) = (Vec::new(), None);
    for &root in roots.iter().take(TOPS) {
        let top = &layout.cells()[root].name;
        let selection = Selection {
            top: Some(top.clone()),
            lenient: true,
            ..Selection::default()
        };
        for inventory in chosen.iter().take(LAYERS) {
            let seen = discover(layout, &selection, &[inventory.layer], scale, progress);
            match seen.and_then(|seen| lattices_of(layout, top, inventory, seen, progress)) {
                Ok(lattices) => found.push(lattices),
                Err(
                    ref error @ Error::Extraction {
                        cause: ExtractionError::Scattered { .. },
                        ..
                    },
                ) => left_out = Some(words(error)),
                // No lattice is no fault.
                Err(Error::Extraction { .. }) => {}
                Err(error @ Error::Layout { .. }) => return Ok((found, Some(words(&error)))),
                Err(other) => return Err(other),
            }
        }
    }
    Ok((found, left_out))
}

/// Elements that were discovered on a layer, with their pillars counted if these are not too many.
fn lattices_of(
    layout: &Layout,
    top: &str,
    inventory: &LayerInventory,
    seen: Discovered,
    progress: &dyn Progress,
) -> Result<LayerLattices> {
    let layer = inventory.layer;
    let turned_deg = seen.turned_deg();
    let mut lattices = LayerLattices {
        layer,
        top: top.to_owned(),
        pillars: seen.shape.plural(),
        pillar_count: None,
        left_out: None,
        turned_deg,
        element_count: seen.sites.len(),
        elements: (seen
            .sites
            .iter()
            .take(LISTED)
            .map(|site| FoundElement::of(site, turned_deg)))
        .collect(),
    };
    if inventory.shapes <= MOST_COUNTED {
        let plan = ExtractionPlan {
            top: Some(top.to_owned()),
            listed: 0,
            lenient: true,
            ..ExtractionPlan::discover(layer)
        };
        match recognise(layout, &plan, seen, progress) {
            Ok(found) => {
                lattices.pillar_count = Some(found.pillars);
                lattices.left_out = LeftOut::of(&found, layer);
            }
            // Elements that are too large to be held are elements.
            Err(Error::Extraction { .. }) => {}
            Err(other) => return Err(other),
        }
    }
    Ok(lattices)
}

/// The first line of an error, without what to do.
fn words(error: &Error) -> String {
    let text = error.to_string();
    text.lines().next().unwrap_or_default().to_owned()
}
