//! The content of cells as it is drawn, for whoever writes it to another file.

use metalith_core::{LayerNumber, Progress};
use metalith_oasis::Repetition;

use super::cell::LayoutCell;
use super::element::{ElementContent, ElementKind};
use super::layout::Layout;
use super::names::Recent;
use super::oasis::Copies;
use super::path_outline::outline;
use super::shape::Point;
use super::walk::{Sink, SinkError, Walk};
use crate::error::{LayoutError, Limit, Result};

/// One element of a cell, in the coordinates of the cell.
#[derive(Clone, Copy, Debug)]
pub enum CellItem<'a> {
    /// A closed outline, its first point repeated at the end where the format is kept.
    Area { layer: LayerNumber, points: &'a [Point] },
    /// A pen of this width drawn along a line of at least two points, longer than it by `extensions`. Paths with round
    /// ends come as areas.
    Line {
        layer: LayerNumber,
        points: &'a [Point],
        width: i64,
        extensions: [i64; 2],
    },
    Text {
        layer: LayerNumber,
        string: &'a [u8],
        at: Point,
    },
    /// A cell by its name, and its index in [`Layout::cells`] if the file has it.
    Reference {
        name: &'a [u8],
        cell: Option<usize>,
        at: Point,
        mirrored: bool,
        magnification: f64,
        angle_deg: f64,
    },
}

/// Consumer of the content of cells.
pub trait CellConsumer {
    /// A cell begins; what follows up to the next call is in it.
    ///
    /// # Errors
    /// Any error ends the reading.
    fn cell(&mut self, index: usize, cell: &LayoutCell) -> metalith_core::Result<()>;

    /// An element, and its copies if it has any. An array of GDSII is a repetition.
    ///
    /// # Errors
    /// Any error ends the reading.
    fn item(&mut self, item: &CellItem<'_>, repetition: Option<&Repetition>) -> metalith_core::Result<()>;
}

impl Layout {
    /// Checks that all elements can be written one by one: copies multiplied, references not followed, within the
    /// limits of a file of this size.
    ///
    /// # Errors
    /// [`LayoutError::Limit`] if not.
    pub fn copies_fit(&self) -> Result<()> {
        let of_cell = |cell: &LayoutCell| {
            let copies = cell.children.iter().fold(0u64, |sum, c| sum.saturating_add(c.copies));
            copies.saturating_add(cell.shapes()).saturating_add(cell.texts())
        };
        let found = self.cells().iter().map(of_cell).fold(0, u64::saturating_add);
        let most = self.limits().shapes_of(self.bytes());
        if found <= most {
            return Ok(());
        }
        let limit = Limit::FlatShapesOfShortFile;
        Err(self.fault(0, LayoutError::Limit { limit, found, most }))
    }

    /// Hand all cells, in the order of the file, to `consumer`. Copies are not multiplied, references not followed;
    /// properties and nodes are left out.
    ///
    /// # Errors
    /// If references lead round in a circle or two cells have one name, if the file cannot be read again, and what the
    /// consumer returns.
    pub fn cell_items<C: CellConsumer>(&self, consumer: &mut C, progress: &dyn Progress) -> Result<()> {
        self.no_circles()?;
        self.no_doubled()?;
        let mut input = self.reopen()?;
        let mut walk = Walk::new(self.limits(), progress);
        progress.begin("reading cells again", self.bytes());
        let mut single = 0;
        for (index, cell) in self.cells().iter().enumerate() {
            consumer.cell(index, cell)?;
            input.seek(cell)?;
            walk.start_at(input.offset());
            let mut pass = Pass {
                layout: self,
                consumer,
                recent: Recent::new(),
                outline: Vec::new(),
                single,
            };
            walk.cell(&mut input, &mut pass)?;
            single = pass.single;
        }
        Ok(())
    }
}

/// Hands elements on.
struct Pass<'a, C> {
    layout: &'a Layout,
    consumer: &'a mut C,
    recent: Recent,
    outline: Vec<Point>,
    /// Copies of arrays that were handed on one by one.
    single: u64,
}

impl<C: CellConsumer> Pass<'_, C> {
    fn put(&mut self, element: &ElementContent, repetition: Option<&Repetition>) -> Result<(), SinkError> {
        let layer = element.layer;
        let item = match element.kind {
            ElementKind::Boundary | ElementKind::Box => CellItem::Area {
                layer,
                points: &element.points,
            },
            ElementKind::Path => {
                let width = i64::from(element.width).abs();
                let distinct = element.points.windows(2).any(|w| w[0] != w[1]);
                let extensions = match element.path_type {
                    0 => Some([0; 2]),
                    2 => Some([width / 2; 2]),
                    4 => Some(element.extensions.map(i64::from)),
                    _ => None,
                };
                // OASIS has half widths, and no pen has an area where it does not move.
                if let Some(extensions) = extensions.filter(|_| distinct && width % 2 == 0) {
                    CellItem::Line {
                        layer,
                        points: &element.points,
                        width,
                        extensions,
                    }
                } else {
                    let (ends, points) = (element.extensions, &element.points);
                    outline(points, width, element.path_type, ends, &mut self.outline);
                    CellItem::Area {
                        layer,
                        points: &self.outline,
                    }
                }
            }
            ElementKind::Text => CellItem::Text {
                layer,
                string: &element.string,
                at: element.points[0],
            },
            ElementKind::Reference | ElementKind::Array => {
                let layout = self.layout;
                let Some(number) = layout.names().find(&element.name) else {
                    return Ok(());
                };
                CellItem::Reference {
                    name: layout.names().name(number),
                    cell: layout.tree().definitions[number as usize],
                    at: element.points[0],
                    mirrored: element.mirror,
                    magnification: element.magnification,
                    angle_deg: element.angle_deg,
                }
            }
            ElementKind::Node => return Ok(()),
        };
        Ok(self.consumer.item(&item, repetition)?)
    }
}

impl<C: CellConsumer> Sink for Pass<'_, C> {
    fn five_points(&mut self, _offset: u64, layer: LayerNumber, points: &[Point; 5]) -> Result<(), SinkError> {
        Ok(self.consumer.item(&CellItem::Area { layer, points }, None)?)
    }

    fn plain_reference(&mut self, _offset: u64, key: u64, at: Point) -> Result<(), SinkError> {
        let layout = self.layout;
        let number = self
            .recent
            .number(key, |name| layout.names().find(name).unwrap_or(u32::MAX));
        if number == u32::MAX {
            return Ok(());
        }
        let item = CellItem::Reference {
            name: layout.names().name(number),
            cell: layout.tree().definitions[number as usize],
            at,
            mirrored: false,
            magnification: 1.0,
            angle_deg: 0.0,
        };
        Ok(self.consumer.item(&item, None)?)
    }

    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError> {
        if element.kind != ElementKind::Array {
            return self.put(element, None);
        }
        let (columns, rows) = (u64::from(element.columns), u64::from(element.rows));
        let from = |k: u64| {
            let (place, first) = (element.origin(k), element.points[0]);
            [place.x - first.x, place.y - first.y]
        };
        let (along, up) = (from(u64::from(columns > 1)), from(if rows > 1 { columns } else { 0 }));
        let grid = Repetition::Grid {
            count: [columns, rows],
            step: [along, up],
        };
        let last = from(columns * rows - 1);
        let at_end: [i64; 2] =
            std::array::from_fn(|axis| (columns as i64 - 1) * along[axis] + (rows as i64 - 1) * up[axis]);
        if last == at_end && columns > 1 {
            return self.put(element, Some(&grid));
        }
        // Steps that are no whole units, or one column.
        self.single = self.single.saturating_add(columns * rows);
        let most = self.layout.limits().shapes_of(self.layout.bytes());
        if self.single > most {
            let (limit, found) = (Limit::FlatShapesOfShortFile, self.single);
            return Err(LayoutError::Limit { limit, found, most }.into());
        }
        for k in 0..columns * rows {
            let mut copy = element.clone();
            copy.points[0] = element.origin(k);
            self.put(&copy, None)?;
        }
        Ok(())
    }

    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError> {
        self.put(element, Some(copies.repetition))
    }
}
