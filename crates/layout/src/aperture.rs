//! Openings in the metal, as polygons.

use std::f64::consts::TAU;

use metalith_design::{Design, Element};

/// One polygon round each lens: its outline with all sides moved outwards by the margin, or one that encloses the circle and is
/// nowhere further from it than the chord error (and half a nanometre of rounding).
pub(super) fn openings(design: &Design) -> Vec<Vec<(i64, i64)>> {
    design
        .elements()
        .iter()
        .map(|element| {
            let (cx, cy) = element.centre_nm;
            let corners = match design.outline_of(element) {
                Some(outline) => outline.grown(design.layout.apertures.margin_nm),
                None => circle(design, element),
            };
            corners.iter().map(|&(x, y)| (cx + x, cy + y)).collect()
        })
        .collect()
}

/// Corners round the origin, counter-clockwise, no two neighbours the same.
fn circle(design: &Design, element: &Element) -> Vec<(i64, i64)> {
    let spec = &design.layout.apertures;
    let radius = f64::from(design.lens_of(element).diameter_nm) / 2.0 + spec.margin_nm as f64;
    let count = spec.vertices(radius);
    let step = TAU / count as f64;
    // Between two corners the polygon touches the circle.
    let reach = radius / (step / 2.0).cos();
    let mut corners = (0..count)
        .map(|k| {
            let angle = (k as f64 + 0.5) * step;
            (
                (reach * angle.cos()).round() as i64,
                (reach * angle.sin()).round() as i64,
            )
        })
        .collect::<Vec<_>>();
    corners.dedup();
    corners
}
