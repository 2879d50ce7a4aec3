//! Places of the shapes of a layout: write fields that they touch, how densely they stand, and a piece of them.

use std::collections::BTreeMap;

use crate::layout_statistics::twice_area;
use metalith_core::{LayerNumber, Progress, Result};
use metalith_gds::{Layout, Rect, Selection, Shape, Transform, Visitor};
use serde::Serialize;

/// Most polygons of a piece: a lens of 60 um with a pitch of 200 nm has 70,000.
const MOST_POLYGONS: usize = 200_000;
/// Points of an outline that every reader of GDSII takes.
const MOST_POINTS: usize = 8190;
/// Most tiles that one shape is spread over: what is larger counts in the tile of its middle.
const MOST_TILES: i64 = 10_000;

/// Fill of the layout by what is exposed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Density {
    /// Edge of the windows, the range of backscatter (um).
    pub window_um: f64,
    /// Area over the area of the windows that hold something.
    pub mean: f64,
    /// Greatest fill of a window.
    pub greatest: f64,
}

/// Tiles of one size from a corner, with the area in each.
struct Tiles {
    origin: [f64; 2],
    edge: f64,
    area: BTreeMap<[i64; 2], f64>,
}

impl Tiles {
    fn new(origin: [f64; 2], edge: f64) -> Self {
        Self {
            origin,
            edge,
            area: BTreeMap::new(),
        }
    }

    fn index(&self, axis: usize, v: f64) -> i64 {
        ((v - self.origin[axis]) / self.edge).floor() as i64
    }

    /// Spread an area evenly over the box around it.
    fn add(&mut self, r: &Rect, area: f64) {
        let ends = |axis: usize, from: i64, to: i64| {
            let first = self.index(axis, from as f64);
            // A box that ends on a border does not touch the tile beyond.
            let last = ((to as f64 - self.origin[axis]) / self.edge).ceil() as i64 - 1;
            (first, last.max(first))
        };
        let ((i0, i1), (j0, j1)) = (ends(0, r.x0, r.x1), ends(1, r.y0, r.y1));
        let tiles = (i1 - i0 + 1).saturating_mul(j1 - j0 + 1);
        if (i0, j0) == (i1, j1) || tiles > MOST_TILES {
            let middle = [(r.x0 + r.x1) as f64 / 2.0, (r.y0 + r.y1) as f64 / 2.0];
            *self
                .area
                .entry([self.index(0, middle[0]), self.index(1, middle[1])])
                .or_default() += area;
            return;
        }
        let share = |axis: usize, index: i64, from: i64, to: i64| {
            let low = self.origin[axis] + index as f64 * self.edge;
            let inside = (to as f64).min(low + self.edge) - (from as f64).max(low);
            if to > from { inside / (to - from) as f64 } else { 1.0 }
        };
        for i in i0..=i1 {
            let across = share(0, i, r.x0, r.x1);
            for j in j0..=j1 {
                let part = area * across * share(1, j, r.y0, r.y1);
                *self.area.entry([i, j]).or_default() += part;
            }
        }
    }

    /// Index of the fullest tile, the first of equals.
    fn fullest(&self) -> Option<([i64; 2], f64)> {
        let all = self.area.iter().map(|(index, area)| (*index, *area));
        all.reduce(|best, next| if next.1 > best.1 { next } else { best })
    }

    /// Middle of a tile.
    fn middle(&self, index: [i64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.origin[axis] + (index[axis] as f64 + 0.5) * self.edge)
    }
}

/// Where the exposed shapes of a layout stand.
pub(super) struct Places {
    /// Lower left corners of the write fields that are touched (um), and their edge.
    pub fields_um: Vec<[f64; 2]>,
    pub field_um: f64,
    pub density: Density,
    /// Middle of the fullest window (database units).
    pub fullest: [f64; 2],
}

struct PlacesVisitor {
    tiles: [Tiles; 2],
}

impl Visitor for PlacesVisitor {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let own = shape.rect.unwrap_or_else(|| shape.outline.around());
        let twice = match &shape.rect {
            Some(r) => 2.0 * r.width() as f64 * r.height() as f64,
            None => twice_area(shape.outline.points()) as f64,
        };
        for placement in placements {
            let (around, area) = if placement.is_square() {
                (placement.apply_rect(&own).unwrap_or(own), twice / 2.0)
            } else {
                let grown = placement.magnification().powi(2);
                (Rect::around(&shape.outline.placed(placement)), twice / 2.0 * grown)
            };
            self.tiles.iter_mut().for_each(|tiles| tiles.add(&around, area));
        }
        Ok(())
    }
}

fn of_layers(layers: &[LayerNumber]) -> Selection {
    Selection {
        layers: Some(layers.to_vec()),
        ..Selection::default()
    }
}

impl Places {
    /// Look at all exposed shapes; fields and windows begin at the lower left corner of their bounding box (um).
    ///
    /// # Errors
    /// If the file cannot be read again, or the user stopped it.
    pub(super) fn of(
        layout: &Layout,
        layers: &[LayerNumber],
        bounds_um: [f64; 4],
        (field_um, window_um): (f64, f64),
        progress: &dyn Progress,
    ) -> Result<Self> {
        let per_um = 1e3 / layout.unit_nm();
        let origin = [bounds_um[0], bounds_um[1]].map(|um| (um * per_um).round());
        let mut visitor = PlacesVisitor {
            tiles: [field_um, window_um].map(|um| Tiles::new(origin, um * per_um)),
        };
        layout.visit(&of_layers(layers), &mut visitor, progress)?;
        let [fields, windows] = visitor.tiles;
        let area: f64 = windows.area.values().sum();
        let window = windows.edge.powi(2);
        let (index, most) = windows.fullest().unwrap_or_default();
        let corner = |tile: &[i64; 2]| {
            let middle = fields.middle(*tile);
            middle.map(|v| (v - 0.5 * fields.edge) / per_um)
        };
        Ok(Self {
            fields_um: fields.area.keys().map(corner).collect(),
            field_um,
            density: Density {
                window_um,
                mean: area / (windows.area.len().max(1) as f64 * window),
                greatest: most / window,
            },
            fullest: windows.middle(index),
        })
    }
}

/// Outlines of a layout within a square, about its middle (database units).
pub(super) struct LayoutPiece {
    pub middle: [i64; 2],
    pub polygons: Vec<Vec<(i64, i64)>>,
    /// Shapes within the square that are left out: they have too many points, or there are too many of them.
    pub left_out: u64,
}

struct PieceVisitor {
    within: Rect,
    piece: LayoutPiece,
}

impl Visitor for PieceVisitor {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let own = shape.rect.unwrap_or_else(|| shape.outline.around());
        let [x, y] = self.piece.middle;
        for placement in placements {
            let around = placement.apply_rect(&own);
            let inside = |r: &Rect| {
                let w = &self.within;
                r.x0 >= w.x0 && r.x1 <= w.x1 && r.y0 >= w.y0 && r.y1 <= w.y1
            };
            if around.is_some_and(|r| !inside(&r)) {
                continue;
            }
            let mut points = shape.outline.placed(placement);
            if !inside(&Rect::around(&points)) {
                continue;
            }
            if points.first() == points.last() {
                points.pop();
            }
            if points.len() > MOST_POINTS || self.piece.polygons.len() >= MOST_POLYGONS {
                self.piece.left_out += 1;
                continue;
            }
            let about = points.iter().map(|p| (p.x - x, p.y - y)).collect();
            self.piece.polygons.push(about);
        }
        Ok(())
    }
}

impl LayoutPiece {
    /// All outlines on these layers within a square of this edge (um) about a place (database units).
    ///
    /// # Errors
    /// If the file cannot be read again, or the user stopped it.
    pub(super) fn of(
        layout: &Layout,
        layers: &[LayerNumber],
        middle: [f64; 2],
        edge_um: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let middle = middle.map(|v| v.round() as i64);
        let half = (edge_um * 0.5e3 / layout.unit_nm()).round() as i64;
        let mut visitor = PieceVisitor {
            within: Rect {
                x0: middle[0] - half,
                y0: middle[1] - half,
                x1: middle[0] + half,
                y1: middle[1] + half,
            },
            piece: Self {
                middle,
                polygons: Vec::new(),
                left_out: 0,
            },
        };
        layout.visit(&of_layers(layers), &mut visitor, progress)?;
        Ok(visitor.piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_spread_over_the_tiles_that_they_touch() {
        let mut tiles = Tiles::new([0.0; 2], 100.0);
        let rect = |x0, y0, x1, y1| Rect { x0, y0, x1, y1 };
        tiles.add(&rect(0, 0, 100, 100), 10_000.0);
        assert_eq!(tiles.area.len(), 1);
        tiles.add(&rect(150, 0, 350, 50), 10_000.0);
        assert_eq!(tiles.area[&[1, 0]], 2500.0);
        assert_eq!(tiles.area[&[2, 0]], 5000.0);
        assert_eq!(tiles.fullest(), Some(([0, 0], 10_000.0)));
        assert_eq!(tiles.middle([2, 0]), [250.0, 50.0]);
    }
}
