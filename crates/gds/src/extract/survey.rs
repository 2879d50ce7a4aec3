//! Everything a layout has, in number: layers with what they hold and cover, and texts.

use std::collections::HashMap;

use serde::Serialize;

use super::sites::Scale;
use metalith_core::text::printable_bytes;

use crate::{LayerNumber, Layout, LayoutCell, Point, Rect, Result, Selection, Shape, Text, Transform, Visitor};
use metalith_core::Progress;

/// One layer with all references followed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerSummary {
    pub layer: LayerNumber,
    /// Areas.
    pub shapes: u64,
    /// Texts.
    pub texts: u64,
    /// Left, bottom, right, top of all areas (nm); none if there are no areas.
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
    /// Transform back into the layout of shapes that come one by one, turned.
    forward: Option<Transform>,
}

impl Surveyor {
    /// Surveyor of a layout that comes turned back by an angle, if there is one (degrees).
    pub(super) fn turned(deg: Option<f64>) -> Self {
        let forward = deg.map(|deg| {
            let (sin, cos) = deg.to_radians().sin_cos();
            Transform::General {
                matrix: [cos, -sin, sin, cos],
                dx: 0.0,
                dy: 0.0,
            }
        });
        Self {
            forward,
            ..Self::default()
        }
    }

    /// A cell with these placements begins.
    pub(crate) fn begin(&mut self, placements: &[Transform]) {
        self.flush();
        self.placements.clear();
        self.placements.extend_from_slice(placements);
    }

    #[inline]
    pub(crate) fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) {
        if self.forward.is_none() && placements.first().is_some_and(Transform::is_square) {
            let entry = self.cell.entry(shape.layer);
            entry.shapes += 1;
            let own = || shape.rect.unwrap_or_else(|| shape.outline.around());
            entry.bounds.unite(&own());
            return;
        }
        let entry = self.total.entry(shape.layer);
        let forward = self.forward.as_slice();
        for placement in if forward.is_empty() { placements } else { forward } {
            entry.shapes += 1;
            (shape.outline.points()).for_each(|p| entry.bounds.include(placement.apply(p)));
        }
    }

    pub(crate) fn text(&mut self, text: &Text<'_>, placements: &[Transform], scale: Scale, most: usize) {
        self.cell.entry(text.layer).texts += 1;
        let forward = self.forward.as_slice();
        for placement in if forward.is_empty() { placements } else { forward } {
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

/// Boxes around all areas below a cell by layer, each shape where it is placed (database units).
pub(crate) fn boxes(layout: &Layout, from: &Selection, progress: &dyn Progress) -> Result<Vec<(LayerNumber, Rect)>> {
    struct Boxes(Surveyor);
    impl Visitor for Boxes {
        fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> metalith_core::Result<()> {
            self.0.begin(placements);
            Ok(())
        }

        fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
            self.0.shape(shape, placements);
            Ok(())
        }
    }
    let mut boxes = Boxes(Surveyor::default());
    layout.visit(from, &mut boxes, progress)?;
    boxes.0.flush();
    Ok(boxes
        .0
        .total
        .of
        .iter()
        .map(|(layer, extent)| (*layer, extent.bounds))
        .collect())
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
