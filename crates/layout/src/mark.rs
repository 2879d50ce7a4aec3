//! Alignment crosses and the outline of the chip.

use metalith_core::cross_corners;
use metalith_design::{ChipSpec, MarkSpec};

/// All crosses of a design, each a polygon of twelve corners (nm).
pub(super) fn crosses(marks: &[MarkSpec]) -> impl Iterator<Item = Vec<(i64, i64)>> {
    marks
        .iter()
        .flat_map(|set| set.centres_nm.iter().map(|&centre| cross(set, centre).to_vec()))
}

fn cross(set: &MarkSpec, (x, y): (i64, i64)) -> [(i64, i64); 12] {
    cross_corners(set.length_nm / 2, set.width_nm / 2).map(|(dx, dy)| (x + dx, y + dy))
}

/// The edge of the chip (nm).
pub(super) fn outline(chip: &ChipSpec) -> [(i64, i64); 4] {
    let (x, y) = (chip.size_nm.0 / 2, chip.size_nm.1 / 2);
    [(-x, -y), (x, -y), (x, y), (-x, y)]
}
