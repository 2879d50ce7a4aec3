//! Lattices that shapes of a layout stand on.

use serde::Serialize;

use super::LayerInventory;
use crate::extract::{Scale, discover};
use crate::layout::Layout;
use crate::visit::Selection;
use crate::{Error, Result};
use metalith_core::{LayerNumber, Progress};
use metalith_pillars::{ElementSite, LatticeKind};

/// Top cells that lattices are looked for in, and layers of each.
const TOPS: usize = 8;
const LAYERS: usize = 8;

/// Layers with fewer shapes that may be pillars than this part of those of the layer with the most are not looked at: marks
/// and labels would cost another reading of the file.
const LEAST_SHARE: u64 = 100;

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
    pub element_count: usize,
    /// The first elements.
    pub elements: Vec<FoundElement>,
}

impl FoundElement {
    fn of(site: &ElementSite) -> Self {
        let [columns, rows] = site.reach().map(|reach| reach.len());
        Self {
            centre_nm: site.centre_nm,
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
    let mut found = Vec::new();
    for &root in roots.iter().take(TOPS) {
        let top = &layout.cells()[root].name;
        let selection = Selection {
            top: Some(top.clone()),
            lenient: true,
            ..Selection::default()
        };
        for layer in chosen.iter().take(LAYERS).map(|l| l.layer) {
            match discover(layout, &selection, &[layer], scale, progress) {
                Ok(seen) => found.push(LayerLattices {
                    layer,
                    top: top.clone(),
                    pillars: seen.shape.plural(),
                    element_count: seen.sites.len(),
                    elements: seen.sites.iter().take(LISTED).map(FoundElement::of).collect(),
                }),
                // No lattice is no fault.
                Err(Error::Extraction { .. }) => {}
                Err(error @ Error::Layout { .. }) => return Ok((found, Some(words(&error)))),
                Err(other) => return Err(other),
            }
        }
    }
    Ok((found, None))
}

/// The first line of an error, without what to do.
fn words(error: &Error) -> String {
    let text = error.to_string();
    text.lines().next().unwrap_or_default().to_owned()
}
