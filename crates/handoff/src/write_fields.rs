//! Write fields that a layout touches.

use std::collections::BTreeSet;

use super::drawing::RectNm;
use super::process::Process;
use metalith_design::Design;

/// A grid of square fields from a corner (nm).
struct WriteFields {
    origin: (i64, i64),
    edge: i64,
    touched: BTreeSet<(i64, i64)>,
}

impl WriteFields {
    fn new(origin: (i64, i64), edge_um: f64) -> Self {
        Self {
            origin,
            edge: super::drawing::nm(edge_um).max(1),
            touched: BTreeSet::new(),
        }
    }

    /// Write fields of a rectangle for which `holds` is true of the field's own rectangle.
    fn touch(&mut self, r: RectNm, holds: impl Fn(RectNm) -> bool) {
        let index = |v: i64, o: i64| (v - o).div_euclid(self.edge);
        for i in index(r.x0, self.origin.0)..=index(r.x1 - 1, self.origin.0) {
            for j in index(r.y0, self.origin.1)..=index(r.y1 - 1, self.origin.1) {
                let field = RectNm::at(
                    self.origin.0 + i * self.edge,
                    self.origin.1 + j * self.edge,
                    self.edge,
                    self.edge,
                );
                if holds(field) {
                    self.touched.insert((i, j));
                }
            }
        }
    }
}

/// Write fields that the pillar layout of a design touches: its lenses and the marks of the first step, on a
/// grid from the lower left corner of the chip.
pub(super) fn of_design(design: &Design, process: &Process) -> u64 {
    let (w, h) = design.layout.chip.size_nm;
    let mut fields = WriteFields::new((-w / 2, -h / 2), process.writer.field_used_um);
    for element in design.elements() {
        let radius = i64::from(design.lens_of(&element).diameter_nm) / 2;
        let (cx, cy) = element.centre_nm;
        let around = RectNm::new(cx - radius, cy - radius, cx + radius, cy + radius);
        fields.touch(around, |f| {
            let (dx, dy) = (cx.clamp(f.x0, f.x1) - cx, cy.clamp(f.y0, f.y1) - cy);
            dx * dx + dy * dy < radius * radius
        });
    }
    for set in &design.layout.marks {
        let (l, w) = (set.length_nm / 2, set.width_nm / 2);
        for &(x, y) in &set.centres_nm {
            fields.touch(RectNm::new(x - l, y - w, x + l, y + w), |_| true);
            fields.touch(RectNm::new(x - w, y - l, x + w, y + l), |_| true);
        }
    }
    fields.touched.len() as u64
}

/// Write fields of a layout that fills its bounds.
pub(super) fn of_bounds(bounds_um: [f64; 4], process: &Process) -> u64 {
    let edge = process.writer.field_used_um;
    let across = |a: f64, b: f64| ((b - a) / edge).ceil().max(1.0) as u64;
    across(bounds_um[0], bounds_um[2]) * across(bounds_um[1], bounds_um[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_misses_the_corners_of_its_square() {
        let mut fields = WriteFields::new((0, 0), 0.1);
        let r = 250i64;
        let centre = 250;
        fields.touch(RectNm::new(0, 0, 500, 500), |f| {
            let (dx, dy) = (
                i64::clamp(centre, f.x0, f.x1) - centre,
                i64::clamp(centre, f.y0, f.y1) - centre,
            );
            dx * dx + dy * dy < r * r
        });
        // The nearest corner of each corner field is 212 nm away: all 25 are touched; at 200 nm 21.
        assert_eq!(fields.touched.len(), 25);
        let mut fields = WriteFields::new((0, 0), 0.1);
        fields.touch(RectNm::new(50, 50, 450, 450), |f| {
            let (dx, dy) = (
                i64::clamp(centre, f.x0, f.x1) - centre,
                i64::clamp(centre, f.y0, f.y1) - centre,
            );
            dx * dx + dy * dy < 200 * 200
        });
        assert_eq!(fields.touched.len(), 21);
    }
}
