//! Where every cell stands: the transforms of its copies, from the top down.

use super::element::{ElementContent, ElementKind};
use super::input::Input;
use super::layout::Layout;
use super::names::Recent;
use super::shape::Point;
use super::transform::Transform;
use super::tree;
use super::walk::{Sink, SinkError, Walk};
use crate::error::{Error, LayoutError, Result};
use metalith_core::{LayerNumber, Silent};

/// Placements of each cell that is not placed shape by shape, by index of the cell.
pub(super) fn placements(layout: &Layout, input: &mut Input, roots: &[usize]) -> Result<Vec<Vec<Transform>>> {
    let cells = layout.cells();
    let (counts, _) = tree::count(cells, &layout.tree().order, roots);
    let mut placed: Vec<Vec<Transform>> = vec![Vec::new(); cells.len()];
    for &root in roots {
        placed[root].push(Transform::IDENTITY);
    }
    let mut walk = Walk::new(layout.limits(), &Silent);
    for &index in &layout.tree().order {
        let cell = &cells[index];
        let whole = |target: usize| !cells[target].inline;
        if placed[index].is_empty() || !tree::followed(cell).any(|(target, _)| whole(target)) {
            continue;
        }
        for (target, _) in tree::followed(cell).filter(|&(target, _)| whole(target)) {
            // The count is bounded by `ReadLimits::placements`, checked before.
            let room = counts[target] as usize - placed[target].len();
            placed[target].reserve_exact(room);
        }
        let parents = std::mem::take(&mut placed[index]);
        layout.seek_cell(input, index)?;
        walk.cell(
            input,
            &mut Placer {
                layout,
                index,
                parents: &parents,
                placed: &mut placed,
                recent: Recent::new(),
            },
        )?;
        placed[index] = parents;
    }
    Ok(placed)
}

struct Placer<'a> {
    layout: &'a Layout,
    index: usize,
    parents: &'a [Transform],
    placed: &'a mut [Vec<Transform>],
    recent: Recent,
}

impl Placer<'_> {
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
        let own = Transform::Square {
            orientation: 0,
            dx: at.x,
            dy: at.y,
        };
        for parent in self.parents {
            let chain = parent.after(&own).ok_or_else(|| magnified(self.layout, offset))?;
            self.placed[child].push(chain);
        }
        Ok(())
    }

    fn element(&mut self, _input: &Input, element: &ElementContent) -> Result<()> {
        if !matches!(element.kind, ElementKind::Reference | ElementKind::Array) {
            return Ok(());
        }
        let Some(child) = self.target(self.layout.names().find(&element.name)) else {
            return Ok(());
        };
        for k in 0..element.copies() {
            let own = element.copy(k);
            for parent in self.parents {
                let chain = parent
                    .after(&own)
                    .ok_or_else(|| magnified(self.layout, element.offset))?;
                self.placed[child].push(chain);
            }
        }
        Ok(())
    }
}

/// The error of a chain of references whose magnification is beyond limits.
pub(super) fn magnified(layout: &Layout, offset: u64) -> Error {
    layout.fault(offset, LayoutError::Magnifications)
}
