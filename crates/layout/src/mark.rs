//! Alignment crosses and the outline of the chip.

use gds21::GdsElement;

use super::polygon;
use metalith_core::cross_corners;
use metalith_design::{ChipSpec, LayoutLayer, MarkSpec};

/// All crosses of a design on one layer, each a polygon of twelve corners.
pub(super) fn crosses(marks: &[MarkSpec], layer: &LayoutLayer) -> Vec<GdsElement> {
    marks
        .iter()
        .flat_map(|set| set.centres_nm.iter().map(|&centre| polygon(layer, &cross(set, centre))))
        .collect()
}

fn cross(set: &MarkSpec, (x, y): (i64, i64)) -> [(i64, i64); 12] {
    cross_corners(set.length_nm / 2, set.width_nm / 2).map(|(dx, dy)| (x + dx, y + dy))
}

/// The edge of the chip.
pub(super) fn outline(chip: &ChipSpec, layer: &LayoutLayer) -> GdsElement {
    let (x, y) = (chip.size_nm.0 / 2, chip.size_nm.1 / 2);
    polygon(layer, &[(-x, -y), (x, -y), (x, y), (-x, y)])
}
