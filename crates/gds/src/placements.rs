//! Places of every cell: the transforms of its copies, from the top down.

use super::cells::CellInput;
use super::element::{ElementContent, ElementKind};
use super::layout::Layout;
use super::names::Recent;
use super::oasis::Copies;
use super::shape::Point;
use super::transform::Transform;
use super::tree;
use super::walk::{Sink, SinkError, Walk};
use crate::error::{Error, LayoutError, Limit, Result};
use metalith_core::{LayerNumber, Silent};

/// Placements of each cell that is not placed shape by shape, by index of the cell.
pub(super) fn placements(layout: &Layout, input: &mut CellInput, roots: &[usize]) -> Result<Vec<Vec<Transform>>> {
    let cells = layout.cells();
    let (counts, _) = tree::count(cells, &layout.tree().order, roots);
    let mut placed: Vec<Vec<Transform>> = vec![Vec::new(); cells.len()];
    for &root in roots {
        placed[root].push(Transform::IDENTITY);
    }
    let whole = |index: usize| tree::followed(&cells[index]).filter(|&(target, _)| !cells[target].inline);
    let needed = |index: usize| counts[index] > 0 && whole(index).next().is_some();
    let mut walk = Walk::new(layout.limits(), &Silent);
    let mut read = |index: usize| {
        let mut placer = Placer {
            layout,
            index,
            found: Vec::new(),
            recent: Recent::new(),
        };
        input.seek(&cells[index])?;
        walk.cell(input, &mut placer)?;
        Ok::<_, Error>(placer.found)
    };
    // Cells inside CBLOCKs are read in the order of the file, or blocks would be unpacked again and again.
    let mut gathered: Vec<Option<Vec<OwnPlacement>>> = vec![None; cells.len()];
    if cells.iter().any(|cell| cell.inner.is_some()) {
        for index in (0..cells.len()).filter(|&index| needed(index)) {
            gathered[index] = Some(read(index)?);
        }
    }
    for &index in layout.tree().order.iter().filter(|&&index| needed(index)) {
        for (target, _) in whole(index) {
            // The count is bounded by `ReadLimits::placements`, checked before.
            let room = counts[target] as usize - placed[target].len();
            placed[target].reserve_exact(room);
        }
        let found = match gathered[index].take() {
            Some(found) => found,
            None => read(index)?,
        };
        let parents = std::mem::take(&mut placed[index]);
        for own in &found {
            for parent in &parents {
                let chain = parent
                    .after(&own.transform)
                    .ok_or_else(|| magnified(layout, own.offset))?;
                placed[own.child].push(chain);
            }
        }
        placed[index] = parents;
    }
    Ok(placed)
}

/// One copy of a cell in another.
#[derive(Clone, Copy)]
struct OwnPlacement {
    child: usize,
    transform: Transform,
    offset: u64,
}

struct Placer<'a> {
    layout: &'a Layout,
    index: usize,
    found: Vec<OwnPlacement>,
    recent: Recent,
}

impl Placer<'_> {
    fn push(&mut self, child: usize, element: &ElementContent, transform: Transform) {
        let offset = element.offset;
        self.found.push(OwnPlacement {
            child,
            transform,
            offset,
        });
    }

    /// The cell that an element refers to and that is placed as a whole.
    fn target_of(&self, element: &ElementContent) -> Option<usize> {
        if !matches!(element.kind, ElementKind::Reference | ElementKind::Array) {
            return None;
        }
        self.target(self.layout.names().find(&element.name))
    }

    fn target(&self, number: Option<u32>) -> Option<usize> {
        let number = number?;
        let child = self.layout.tree().definitions[number as usize]?;
        if self.layout.cells()[child].inline {
            return None;
        }
        let cell = &self.layout.cells()[self.index];
        // Circles are rare, and so is the search for them.
        let cut = !self.layout.tree().circles.is_empty() && cell.children.iter().any(|c| c.number == number && c.cut);
        (!cut).then_some(child)
    }
}

impl Sink for Placer<'_> {
    fn five_points(&mut self, _offset: u64, _layer: LayerNumber, _points: &[Point; 5]) -> Result<(), SinkError> {
        Ok(())
    }

    fn plain_reference(&mut self, offset: u64, key: u64, at: Point) -> Result<(), SinkError> {
        let names = self.layout.names();
        let number = self.recent.number(key, |name| names.find(name).unwrap_or(u32::MAX));
        let Some(child) = self.target((number != u32::MAX).then_some(number)) else {
            return Ok(());
        };
        let transform = Transform::Square {
            orientation: 0,
            dx: at.x,
            dy: at.y,
        };
        self.found.push(OwnPlacement {
            child,
            transform,
            offset,
        });
        Ok(())
    }

    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError> {
        if let Some(child) = self.target_of(element) {
            for k in 0..element.copies() {
                self.push(child, element, element.copy(k));
            }
        }
        Ok(())
    }

    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError> {
        if let Some(child) = self.target_of(element) {
            copies.each(|place| {
                self.push(child, element, element.copy(0).moved(place));
                Ok::<_, SinkError>(())
            })?;
        }
        Ok(())
    }
}

/// A reference to a cell that the file does not have, with all references above it followed.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingCell {
    /// Bytes of the name.
    pub name: Vec<u8>,
    pub transform: Transform,
}

impl Layout {
    /// All places below these cells at which a cell stands that the file does not have.
    ///
    /// # Errors
    /// If they are beyond the limits of reading, or the file cannot be read again.
    pub fn missing_cells(&self, roots: &[usize]) -> Result<Vec<MissingCell>> {
        let cells = self.cells();
        let (counts, depths) = tree::count(cells, &self.tree().order, roots);
        let open = |index: &usize| counts[*index] > 0 && cells[*index].children.iter().any(|c| c.cell.is_none());
        let parents: Vec<usize> = (0..cells.len()).filter(open).collect();
        if parents.is_empty() {
            return Ok(Vec::new());
        }
        if let Some(cause) = tree::beyond(cells, &counts, &depths, self.limits(), self.bytes()) {
            return Err(self.fault(0, cause));
        }
        let copies = |index: &usize| {
            let missing = cells[*index].children.iter().filter(|c| c.cell.is_none());
            missing
                .fold(0u64, |sum, c| sum.saturating_add(c.copies))
                .saturating_mul(counts[*index])
        };
        let (found, most) = (
            parents.iter().map(copies).fold(0, u64::saturating_add),
            self.limits().placements,
        );
        if found > most {
            let limit = Limit::Placements;
            return Err(self.fault(0, LayoutError::Limit { limit, found, most }));
        }
        let mut input = self.reopen()?;
        let placed = placements(self, &mut input, roots)?;
        let mut walk = Walk::new(self.limits(), &Silent);
        let mut out = Vec::new();
        for index in parents {
            let mut missing = MissingReferences {
                layout: self,
                found: Vec::new(),
                recent: Recent::new(),
            };
            input.seek(&cells[index])?;
            walk.cell(&mut input, &mut missing)?;
            for (number, own, offset) in missing.found {
                for parent in &placed[index] {
                    let transform = parent.after(&own).ok_or_else(|| magnified(self, offset))?;
                    let name = self.names().name(number).to_vec();
                    out.push(MissingCell { name, transform });
                }
            }
        }
        Ok(out)
    }
}

/// References of one cell to cells that the file does not have: number of the name, transform, place in the file.
struct MissingReferences<'a> {
    layout: &'a Layout,
    found: Vec<(u32, Transform, u64)>,
    recent: Recent,
}

impl MissingReferences<'_> {
    fn push(&mut self, number: Option<u32>, transform: Transform, offset: u64) {
        let missing = number.filter(|&n| self.layout.tree().definitions[n as usize].is_none());
        self.found.extend(missing.map(|number| (number, transform, offset)));
    }
}

impl Sink for MissingReferences<'_> {
    fn five_points(&mut self, _offset: u64, _layer: LayerNumber, _points: &[Point; 5]) -> Result<(), SinkError> {
        Ok(())
    }

    fn plain_reference(&mut self, offset: u64, key: u64, at: Point) -> Result<(), SinkError> {
        let names = self.layout.names();
        let number = self.recent.number(key, |name| names.find(name).unwrap_or(u32::MAX));
        self.push(
            (number != u32::MAX).then_some(number),
            Transform::IDENTITY.moved(at),
            offset,
        );
        Ok(())
    }

    fn element(&mut self, element: &ElementContent) -> Result<(), SinkError> {
        if matches!(element.kind, ElementKind::Reference | ElementKind::Array) {
            let number = self.layout.names().find(&element.name);
            for k in 0..element.copies() {
                self.push(number, element.copy(k), element.offset);
            }
        }
        Ok(())
    }

    fn repeated(&mut self, element: &ElementContent, copies: &Copies<'_>) -> Result<(), SinkError> {
        if matches!(element.kind, ElementKind::Reference | ElementKind::Array) {
            let number = self.layout.names().find(&element.name);
            copies.each(|place| {
                self.push(number, element.copy(0).moved(place), element.offset);
                Ok::<_, SinkError>(())
            })?;
        }
        Ok(())
    }
}

/// The error of a chain of references whose magnification is beyond limits.
pub(super) fn magnified(layout: &Layout, offset: u64) -> Error {
    layout.fault(offset, LayoutError::Magnifications)
}
