//! The second reading: every shape once, with all places it stands at.

use super::cell::LayoutCell;
use super::cells::CellInput;
use super::circle::circle_of;
use super::element::{ElementContent, ElementKind};
use super::layout::Layout;
use super::names::Recent;
use super::oasis::Copies;
use super::path_outline::outline;
use super::placements::{self, magnified};
use super::shape::{Outline, Point, Rect, Shape, ShapeKind, Text, rectangle_of};
use super::transform::Transform;
use super::tree;
use super::walk::{Sink, SinkError, Walk};
use crate::error::Result;
use metalith_core::{LayerNumber, Progress, Silent};

/// Consumer of the shapes of a layout.
pub trait Visitor {
    /// A cell begins whose shapes, up to the next call, stand at `placements`. Small cells without
    /// references are not announced: their shapes come as if drawn in the cells that refer to them.
    ///
    /// # Errors
    /// Any error ends the visit.
    fn cell(&mut self, _cell: &LayoutCell, _placements: &[Transform]) -> metalith_core::Result<()> {
        Ok(())
    }

    /// An area, in the coordinates of the cell.
    ///
    /// # Errors
    /// Any error ends the visit.
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()>;

    /// A text, in the coordinates of the cell.
    ///
    /// # Errors
    /// Any error ends the visit.
    fn text(&mut self, _text: &Text<'_>, _placements: &[Transform]) -> metalith_core::Result<()> {
        Ok(())
    }
}

/// Selection of a layout that is visited.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Name of the cell to start from; the top cell if there is one only.
    pub top: Option<String>,
    /// Layers of shapes and texts; all if left out.
    pub layers: Option<Vec<LayerNumber>>,
    /// Go round circles and dangling references, and start from every top cell, instead of an error: for
    /// rules that report these faults themselves.
    pub lenient: bool,
    /// Go round references to cells that the file does not have, instead of an error.
    pub without_missing: bool,
}

impl Layout {
    /// Hand every shape and text of the selection to `visitor`, cells in the order of the file.
    ///
    /// # Errors
    /// If the layout has faults and the selection is not lenient, if it is beyond the limits of reading,
    /// if the file cannot be read again, and what the visitor returns.
    pub fn visit<V: Visitor>(&self, selection: &Selection, visitor: &mut V, progress: &dyn Progress) -> Result<()> {
        self.visit_by(Walk::new(self.limits(), progress), selection, visitor)
    }

    /// Variant of [`Layout::visit`] by the grammar alone.
    #[cfg(test)]
    pub(super) fn visit_slowly<V: Visitor>(
        &self,
        selection: &Selection,
        visitor: &mut V,
        progress: &dyn Progress,
    ) -> Result<()> {
        self.visit_by(Walk::new(self.limits(), progress).slowly(), selection, visitor)
    }

    fn visit_by<V: Visitor>(&self, mut walk: Walk<'_>, selection: &Selection, visitor: &mut V) -> Result<()> {
        let roots = self.roots(selection)?;
        let (counts, depths) = tree::count(self.cells(), &self.tree().order, &roots);
        if let Some(cause) = tree::beyond(self.cells(), &counts, &depths, self.limits(), self.bytes()) {
            return Err(self.fault(0, cause));
        }
        let mut input = self.reopen()?;
        let placed = placements::placements(self, &mut input, &roots)?;
        let mut own_input = self.reopen()?;
        let small = self.inline_shapes(&mut own_input, &counts)?;
        drop(own_input);
        let wanted = |layer: LayerNumber| selection.layers.as_ref().is_none_or(|l| l.contains(&layer));
        let has = |cell: &LayoutCell| cell.layers.iter().any(|(l, _)| wanted(*l));
        let worth = |cell: &LayoutCell| {
            has(cell) || tree::followed(cell).any(|(t, _)| self.cells()[t].inline && has(&self.cells()[t]))
        };
        let chosen: Vec<usize> = (0..self.cells().len())
            .filter(|&k| !placed[k].is_empty() && worth(&self.cells()[k]))
            .collect();
        let bytes = |k: &usize| self.cells()[*k].bytes.end - self.cells()[*k].bytes.start;
        walk.progress.begin("reading shapes", chosen.iter().map(bytes).sum());
        let mut spread = Spread {
            layout: self,
            visitor,
            layers: selection.layers.as_deref(),
            placements: &[],
            small: &small,
            recent: Recent::new(),
            path: Vec::new(),
            chains: Vec::new(),
        };
        for index in chosen {
            spread.placements = &placed[index];
            spread.visitor.cell(&self.cells()[index], &placed[index])?;
            input.seek(&self.cells()[index])?;
            walk.start_at(input.offset());
            walk.cell(&mut input, &mut spread)?;
        }
        Ok(())
    }

    /// Decode the cells that are placed shape by shape.
    fn inline_shapes(&self, input: &mut CellInput, counts: &[u64]) -> Result<Vec<Vec<InlineShape>>> {
        let mut small = vec![Vec::new(); self.cells().len()];
        let mut numbered = 0;
        let mut walk = Walk::new(self.limits(), &Silent);
        for (index, cell) in self.cells().iter().enumerate() {
            if cell.inline && counts[index] > 0 {
                let mut keep = ShapeCollector {
                    shapes: Vec::new(),
                    unit_nm: self.unit_nm(),
                    numbered,
                };
                input.seek(cell)?;
                walk.cell(input, &mut keep)?;
                numbered = keep.numbered;
                small[index] = keep.shapes;
            }
        }
        Ok(small)
    }
}

/// A shape of an inline cell.
#[derive(Clone, Debug)]
struct InlineShape {
    kind: ShapeKind,
    layer: LayerNumber,
    points: Vec<Point>,
    rect: Option<Rect>,
    circle: Option<Rect>,
    /// Number among all such shapes of the layout.
    number: u32,
}

impl InlineShape {
    fn new(kind: ShapeKind, layer: LayerNumber, points: Vec<Point>, unit_nm: f64, number: u32) -> Self {
        let (rect, circle) = (rectangle_of(&points), circle_of(&points, unit_nm));
        Self {
            kind,
            layer,
            points,
            rect,
            circle,
            number,
        }
    }
}

struct ShapeCollector {
    shapes: Vec<InlineShape>,
    unit_nm: f64,
    /// The number of the next one.
    numbered: u32,
}

impl ShapeCollector {
    fn keep(&mut self, kind: ShapeKind, layer: LayerNumber, points: Vec<Point>) {
        self.shapes
            .push(InlineShape::new(kind, layer, points, self.unit_nm, self.numbered));
        self.numbered += 1;
    }
}

impl Sink for ShapeCollector {
    fn five_points(&mut self, _offset: u64, layer: LayerNumber, points: &[Point; 5]) -> Result<(), SinkError> {
        self.keep(ShapeKind::Boundary, layer, points.to_vec());
        Ok(())
    }

    fn plain_reference(&mut self, _offset: u64, _key: u64, _at: Point) -> Result<(), SinkError> {
        Ok(())
    }

    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError> {
        let mut points = Vec::new();
        if let Some(kind) = outline_of(element, &mut points) {
            self.keep(kind, element.layer, points);
        }
        Ok(())
    }

    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError> {
        let mut points = Vec::new();
        let Some(kind) = outline_of(element, &mut points) else {
            return Ok(());
        };
        copies.each(|by| {
            let points: Vec<Point> = points.iter().map(|p| Point::new(p.x + by.x, p.y + by.y)).collect();
            self.keep(kind, element.layer, points);
            Ok(())
        })
    }
}

/// The area an element covers, if it covers any.
fn outline_of(element: &ElementContent, points: &mut Vec<Point>) -> Option<ShapeKind> {
    let kind = match element.kind {
        ElementKind::Boundary => ShapeKind::Boundary,
        ElementKind::Box => ShapeKind::Box,
        ElementKind::Path => {
            let width = i64::from(element.width);
            outline(&element.points, width, element.path_type, element.extensions, points);
            return Some(ShapeKind::Path);
        }
        _ => return None,
    };
    points.clone_from(&element.points);
    Some(kind)
}

/// Hands the elements of a cell to the visitor.
struct Spread<'a, V> {
    layout: &'a Layout,
    visitor: &'a mut V,
    layers: Option<&'a [LayerNumber]>,
    placements: &'a [Transform],
    small: &'a [Vec<InlineShape>],
    recent: Recent,
    path: Vec<Point>,
    chains: Vec<Transform>,
}

impl<V: Visitor> Spread<'_, V> {
    #[inline]
    fn wants(&self, layer: LayerNumber) -> bool {
        self.layers.is_none_or(|layers| layers.contains(&layer))
    }

    /// One copy of an inline cell.
    #[inline]
    fn copy(&mut self, cell: usize, own: Transform, offset: u64) -> Result<()> {
        let small = self.small;
        if !own.is_square() {
            self.chains.clear();
            for placement in self.placements {
                let chain = placement.after(&own).ok_or_else(|| magnified(self.layout, offset))?;
                self.chains.push(chain);
            }
        }
        for kept in &small[cell] {
            if !self.wants(kept.layer) {
                continue;
            }
            let mut shape = Shape {
                kind: kept.kind,
                layer: kept.layer,
                outline: Outline::new(&kept.points).numbered(kept.number),
                rect: kept.rect,
                circle: kept.circle,
                offset,
            };
            // Rounding happens once, at the end of the chain: only exact transforms are applied here.
            if own.is_square() {
                shape.outline = Outline::at(&kept.points, own).numbered(kept.number);
                shape.rect = kept.rect.and_then(|r| own.apply_rect(&r));
                shape.circle = kept.circle.and_then(|r| own.apply_rect(&r));
                self.visitor.shape(&shape, self.placements)?;
            } else {
                self.visitor.shape(&shape, &self.chains)?;
            }
        }
        Ok(())
    }
}

impl<V: Visitor> Sink for Spread<'_, V> {
    #[inline]
    fn five_points(&mut self, offset: u64, layer: LayerNumber, points: &[Point; 5]) -> Result<(), SinkError> {
        if !self.wants(layer) {
            return Ok(());
        }
        let shape = Shape {
            kind: ShapeKind::Boundary,
            layer,
            outline: Outline::new(points),
            rect: rectangle_of(points),
            circle: None,
            offset,
        };
        Ok(self.visitor.shape(&shape, self.placements)?)
    }

    #[inline]
    fn plain_reference(&mut self, offset: u64, key: u64, at: Point) -> Result<(), SinkError> {
        let layout = self.layout;
        let inline = self.recent.number(key, |name| layout.inline_cell(name));
        if inline == u32::MAX {
            return Ok(());
        }
        let own = Transform::Square {
            orientation: 0,
            dx: at.x,
            dy: at.y,
        };
        Ok(self.copy(inline as usize, own, offset)?)
    }

    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError> {
        match element.kind {
            ElementKind::Reference | ElementKind::Array => {
                let inline = self.layout.inline_cell(&element.name);
                if inline != u32::MAX {
                    for k in 0..element.copies() {
                        self.copy(inline as usize, element.copy(k), element.offset)?;
                    }
                }
                Ok(())
            }
            ElementKind::Text if self.wants(element.layer) => {
                let text = Text {
                    layer: element.layer,
                    string: &element.string,
                    at: element.points[0],
                    offset: element.offset,
                };
                Ok(self.visitor.text(&text, self.placements)?)
            }
            _ if self.wants(element.layer) => {
                let mut points = std::mem::take(&mut self.path);
                if let Some(kind) = outline_of(element, &mut points) {
                    let shape = Shape {
                        kind,
                        layer: element.layer,
                        rect: rectangle_of(&points),
                        circle: circle_of(&points, self.layout.unit_nm()),
                        outline: Outline::new(&points),
                        offset: element.offset,
                    };
                    self.visitor.shape(&shape, self.placements)?;
                }
                self.path = points;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError> {
        match element.kind {
            ElementKind::Reference | ElementKind::Array => {
                let inline = self.layout.inline_cell(&element.name);
                if inline == u32::MAX {
                    return Ok(());
                }
                copies.each(|by| Ok(self.copy(inline as usize, element.copy(0).moved(by), element.offset)?))
            }
            _ if !self.wants(element.layer) => Ok(()),
            ElementKind::Text => copies.each(|by| {
                let at = element.points[0];
                let text = Text {
                    layer: element.layer,
                    string: &element.string,
                    at: Point::new(at.x + by.x, at.y + by.y),
                    offset: element.offset,
                };
                Ok(self.visitor.text(&text, self.placements)?)
            }),
            _ => {
                let mut points = std::mem::take(&mut self.path);
                if let Some(kind) = outline_of(element, &mut points) {
                    let (rect, circle) = (rectangle_of(&points), circle_of(&points, self.layout.unit_nm()));
                    copies.each(|by| {
                        let shape = Shape {
                            kind,
                            layer: element.layer,
                            rect: rect.map(|r| r.moved(by)),
                            circle: circle.map(|r| r.moved(by)),
                            outline: Outline::at(&points, Transform::IDENTITY.moved(by)),
                            offset: element.offset,
                        };
                        self.visitor.shape(&shape, self.placements)
                    })?;
                }
                self.path = points;
                Ok(())
            }
        }
    }
}
