//! One outline as it is drawn in a cell.

use std::cell::OnceCell;

use super::polygon::twice_area;
use super::winding::crosses_itself;
use metalith_gds::{LayerNumber, Point, Rect, ShapeKind, Transform, simplified};

/// One outline of a cell as drawn; derived quantities are computed on first use.
pub(super) struct DrawnOutline<'a> {
    pub layer: LayerNumber,
    pub kind: ShapeKind,
    pub points: &'a [Point],
    pub rect: Option<Rect>,
    pub placements: &'a [Transform],
    pub unit_nm: f64,
    simple: OnceCell<Vec<Point>>,
    crosses: OnceCell<bool>,
}

impl<'a> DrawnOutline<'a> {
    /// Outline of a shape with these points.
    pub(crate) fn new(
        shape: &metalith_gds::Shape<'_>,
        points: &'a [Point],
        placements: &'a [Transform],
        unit_nm: f64,
    ) -> Self {
        Self {
            layer: shape.layer,
            kind: shape.kind,
            points,
            rect: shape.rect,
            placements,
            unit_nm,
            simple: OnceCell::new(),
            crosses: OnceCell::new(),
        }
    }

    /// Corners only, closed.
    pub(crate) fn corners(&self) -> &[Point] {
        self.simple.get_or_init(|| simplified(self.points))
    }

    /// Twice the area, positive if counter-clockwise.
    pub(crate) fn twice_area(&self) -> i128 {
        twice_area(self.points)
    }

    pub(crate) fn bounds(&self) -> Rect {
        self.rect.unwrap_or_else(|| Rect::around(self.points))
    }

    /// The upright rectangle that its corners make.
    pub(crate) fn rectangle(&self) -> Option<Rect> {
        self.rect.or_else(|| metalith_gds::rectangle_of(self.corners()))
    }

    /// True if two sides cross, or touch where they should not.
    pub(crate) fn crosses_itself(&self) -> bool {
        *self
            .crosses
            .get_or_init(|| self.rect.is_none() && crosses_itself(self.corners()))
    }

    /// True if all sides are along the axes.
    pub(crate) fn is_manhattan(&self) -> bool {
        self.rect.is_some() || self.corners().windows(2).all(|s| s[0].x == s[1].x || s[0].y == s[1].y)
    }

    /// Smallest interior or exterior angle between two sides (degrees); 180 if there is no corner.
    pub(crate) fn sharpest_deg(&self) -> f64 {
        let c = self.corners();
        if c.len() < 4 {
            return if c.is_empty() { 180.0 } else { 0.0 };
        }
        let n = c.len() - 1;
        (0..n)
            .map(|k| {
                let (a, b, d) = (c[(k + n - 1) % n], c[k], c[k + 1]);
                let (ux, uy) = ((a.x - b.x) as f64, (a.y - b.y) as f64);
                let (vx, vy) = ((d.x - b.x) as f64, (d.y - b.y) as f64);
                (ux * vy - uy * vx).abs().atan2(ux * vx + uy * vy).to_degrees()
            })
            .fold(180.0, f64::min)
    }
}
