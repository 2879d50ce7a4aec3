//! Layer of the pillars of a layout of which no one has named it.

use crate::error::{Error, ExtractionError, Result};
use crate::extract::{Scale, discover};
use crate::inventory::contents;
use crate::{LayerNumber, Layout, Selection};
use metalith_core::Progress;

/// Layer that pillars are on, as long as a layout has shapes there or nowhere.
pub const USUAL_LAYER: LayerNumber = LayerNumber::new(1, 0);

/// Layers that are searched for lattices, at most.
const MOST_SEARCHED: usize = 8;

impl Layout {
    /// Layer of the pillars where no one names it: 1/0; if that has no shapes, the only layer with shapes, or else the only one
    /// with pillars on a lattice. A layer other than 1/0 is stated as a note.
    ///
    /// # Errors
    /// If several layers have shapes, and none or several of them pillars on a lattice; if the layout cannot be read.
    pub fn pillar_layer(&self, progress: &dyn Progress) -> Result<LayerNumber> {
        let drawn = self.drawn_layers();
        if drawn.is_empty() || drawn.contains(&USUAL_LAYER) {
            return Ok(USUAL_LAYER);
        }
        let (layer, why) = match drawn.as_slice() {
            [layer] => (*layer, "the only layer with shapes"),
            several => match self.layers_with_lattices(several, progress)?.as_slice() {
                [layer] => (*layer, "the only layer with pillars on a lattice"),
                _ => return Err(self.several_layers(progress)?),
            },
        };
        progress.warn(&format!(
            "note: {}: pillars are taken from layer {layer}, {why}",
            self.path().display()
        ));
        Ok(layer)
    }

    /// Layers with shapes below the top cells, in order.
    pub fn drawn_layers(&self) -> Vec<LayerNumber> {
        let cells = self.cells().iter().filter(|cell| cell.placements > 0);
        let drawn = cells.flat_map(|cell| cell.layers.iter().filter(|(_, tally)| tally.shapes() > 0));
        let mut layers: Vec<LayerNumber> = drawn.map(|(layer, _)| *layer).collect();
        layers.sort_unstable();
        layers.dedup();
        layers
    }

    /// Cells at the top with shapes on a layer, in them or below.
    pub fn tops_on(&self, layer: LayerNumber) -> Vec<usize> {
        let cells = self.cells();
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by_key(|&cell| cells[cell].depth);
        let mut has = vec![false; cells.len()];
        for cell in order {
            let own = cells[cell]
                .layers
                .iter()
                .any(|(l, tally)| *l == layer && tally.shapes() > 0);
            has[cell] = own
                || cells[cell]
                    .children
                    .iter()
                    .filter_map(|child| child.cell)
                    .any(|child| has[child]);
        }
        self.tops().iter().copied().filter(|&top| has[top]).collect()
    }

    /// Layers, of these, on which pillars stand on a lattice.
    fn layers_with_lattices(&self, layers: &[LayerNumber], progress: &dyn Progress) -> Result<Vec<LayerNumber>> {
        let scale = Scale::of(self)?;
        let mut found = Vec::new();
        for layer in layers.iter().take(MOST_SEARCHED) {
            match discover(self, &Selection::default(), &[*layer], scale, progress) {
                Ok(_) => found.push(*layer),
                Err(Error::Extraction { .. }) => {}
                Err(other) => return Err(other),
            }
        }
        Ok(found)
    }

    fn several_layers(&self, progress: &dyn Progress) -> Result<Error> {
        let contents = contents::words(self, &Selection::default(), progress)?;
        Ok(Error::Extraction {
            path: self.path().to_owned(),
            cause: ExtractionError::WhichLayer { contents },
        })
    }
}
