//! Everything a layout has, in number: layers with what they hold and cover, and texts.

use std::collections::HashMap;

use serde::Serialize;

use super::sites::Scale;
use metalith_core::text::printable_bytes;

use crate::{LayerNumber, Point, Rect, Shape, Text, Transform};

/// One layer with all references followed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerSummary {
    pub layer: LayerNumber,
    /// Areas.
    pub shapes: u64,
    /// Texts.
    pub texts: u64,
    /// Left, bottom, right, top of all areas (nm); none if there are no areas. Around a cell that is turned
    /// by other than quarter turns, the box of its box.
    pub bounds_nm: Option<[f64; 4]>,
}

/// One text.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TextSummary {
    pub layer: LayerNumber,
    /// Printable: see [`metalith_core::text::printable_bytes`].
    pub string: String,
    pub at_nm: [f64; 2],
}

/// All layers and texts of a layout.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Survey {
    /// Layers by number.
    pub layers: Vec<LayerSummary>,
    /// The first texts, in the order of the file.
    pub texts: Vec<TextSummary>,
}

/// Counts and bounds of one layer, in database units.
#[derive(Clone, Copy, Debug)]
struct Extent {
    shapes: u64,
    texts: u64,
    bounds: Rect,
}

impl Extent {
    const NONE: Self = Self {
        shapes: 0,
        texts: 0,
        bounds: Rect::EMPTY,
    };
}

/// Extents of layers, by number.
#[derive(Default)]
struct Extents {
    of: Vec<(LayerNumber, Extent)>,
    places: HashMap<LayerNumber, usize>,
    /// The one that was asked for last: shapes of one layer follow one another.
    last: usize,
}

impl Extents {
    /// Extent of a layer; [`Extent::NONE`] if it is new.
    #[inline]
    fn entry(&mut self, layer: LayerNumber) -> &mut Extent {
        if self.of.get(self.last).is_none_or(|(l, _)| *l != layer) {
            self.last = *self.places.entry(layer).or_insert_with(|| {
                self.of.push((layer, Extent::NONE));
                self.of.len() - 1
            });
        }
        &mut self.of[self.last].1
    }
}

/// Gathers a survey. Shapes are counted in the coordinates of their cell, and placed with it once.
#[derive(Default)]
pub(super) struct Surveyor {
    cell: Extents,
    placements: Vec<Transform>,
    total: Extents,
    texts: Vec<TextSummary>,
}

impl Surveyor {
    /// A cell with these placements begins.
    pub(crate) fn begin(&mut self, placements: &[Transform]) {
        self.flush();
        self.placements.clear();
        self.placements.extend_from_slice(placements);
    }

    #[inline]
    pub(crate) fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) {
        let bounds = shape.rect.unwrap_or_else(|| shape.outline.around());
        if placements.first().is_some_and(Transform::is_square) || placements == self.placements {
            let entry = self.cell.entry(shape.layer);
            entry.shapes += 1;
            entry.bounds.unite(&bounds);
        } else {
            // A copy with a chain of transforms of its own.
            let extent = Extent {
                shapes: 1,
                texts: 0,
                bounds,
            };
            add(&mut self.total, shape.layer, &extent, placements);
        }
    }

    pub(crate) fn text(&mut self, text: &Text<'_>, placements: &[Transform], scale: Scale, most: usize) {
        self.cell.entry(text.layer).texts += 1;
        for placement in placements {
            if self.texts.len() >= most {
                break;
            }
            let at = placement.apply(text.at);
            self.texts.push(TextSummary {
                layer: text.layer,
                string: printable_bytes(text.string),
                at_nm: [scale.nm(at.x as f64), scale.nm(at.y as f64)],
            });
        }
    }

    fn flush(&mut self) {
        for (layer, extent) in std::mem::take(&mut self.cell).of {
            add(&mut self.total, layer, &extent, &self.placements);
        }
    }

    pub(crate) fn finish(mut self, scale: Scale) -> Survey {
        self.flush();
        let mut total = self.total.of;
        total.sort_by_key(|(layer, _)| *layer);
        let layers = total.iter().map(|(layer, e)| LayerSummary {
            layer: *layer,
            shapes: e.shapes,
            texts: e.texts,
            bounds_nm: (!e.bounds.is_empty())
                .then(|| [e.bounds.x0, e.bounds.y0, e.bounds.x1, e.bounds.y1].map(|v| scale.nm(v as f64))),
        });
        Survey {
            layers: layers.collect(),
            texts: self.texts,
        }
    }
}

fn add(total: &mut Extents, layer: LayerNumber, extent: &Extent, placements: &[Transform]) {
    let sum = total.entry(layer);
    sum.shapes += extent.shapes * placements.len() as u64;
    sum.texts += extent.texts * placements.len() as u64;
    let b = extent.bounds;
    if !b.is_empty() {
        for t in placements {
            for corner in [(b.x0, b.y0), (b.x1, b.y0), (b.x1, b.y1), (b.x0, b.y1)] {
                sum.bounds.include(t.apply(Point::new(corner.0, corner.1)));
            }
        }
    }
}
