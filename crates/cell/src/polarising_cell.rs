//! Cells of pillars that give each polarisation its own phase.

use std::path::Path;

use metalith_pillars::{PillarShape, Rectangles};

use crate::{CellModel, CellStack, FocusedLight, RotatedCell, UprightCell};

/// The cell of pillars that focus light of this polarisation; none of pillars that give all light one phase. Solved pillars are
/// kept in the folder `cache`, where the kind has many.
pub fn polarising_cell(stack: &CellStack, focused: FocusedLight, cache: Option<&Path>) -> Option<Box<dyn CellModel>> {
    match (stack.shape, focused) {
        (PillarShape::Rectangle(Rectangles::Rotated(pillars)), FocusedLight::Circular(hand)) => {
            Some(Box::new(RotatedCell::new(stack.clone(), pillars, hand)))
        }
        (PillarShape::Rectangle(Rectangles::Upright(pillars)), FocusedLight::Linear(axis)) => Some(Box::new(
            UprightCell::new(stack.clone(), pillars, axis).cached_in(cache),
        )),
        _ => None,
    }
}
