//! Polygons that stand for circles.

use super::shape::{Point, Rect, rounding};

/// Fewest corners of a polygon that is taken for a circle.
const FEWEST_CORNERS: usize = 8;

/// How far inside the circle the middle of a side may be, in parts of the radius: that of an octagon, and a little.
const SAGITTA: f64 = 0.08;

/// How far the area may be off that of the circle, in parts of it: an octagon has a tenth less. Tells a circle from one that
/// is gone round twice.
const AREA: f64 = 0.15;

/// The square around the circle that a closed outline stands for, if it does: all corners on one circle to within their rounding
/// and that of the bounding box that says where the circle is, so many that each side is near it. A database unit is so long
/// (nm).
pub fn circle_of(points: &[Point], unit_nm: f64) -> Option<Rect> {
    let corners = points.len().checked_sub(1).filter(|n| *n >= FEWEST_CORNERS)?;
    if points[0] != points[corners] {
        return None;
    }
    let around = Rect::around(points);
    if around.width() != around.height() || around.width() == 0 {
        return None;
    }
    // All lengths doubled: the middle of the box and those of sides are then whole.
    let (cx, cy) = (around.x0 + around.x1, around.y0 + around.y1);
    let radius = around.width() as f64;
    let slack = 2.0 * rounding(unit_nm);
    let from_middle = |x: i64, y: i64| ((x - cx) as f64).hypot((y - cy) as f64);
    let mut twice_area = 0.0;
    for side in points.windows(2) {
        let (a, b) = (side[0], side[1]);
        if (from_middle(2 * a.x, 2 * a.y) - radius).abs() > slack {
            return None;
        }
        if from_middle(a.x + b.x, a.y + b.y) < radius * (1.0 - SAGITTA) - slack {
            return None;
        }
        let (ax, ay) = ((2 * a.x - cx) as f64, (2 * a.y - cy) as f64);
        let (bx, by) = ((2 * b.x - cx) as f64, (2 * b.y - cy) as f64);
        twice_area += ax * by - ay * bx;
    }
    let full = std::f64::consts::PI * radius * radius;
    let edge = std::f64::consts::TAU * radius * slack;
    ((twice_area.abs() / 2.0 - full).abs() <= AREA * full + edge).then_some(around)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::circle_corners;

    fn closed(corners: impl IntoIterator<Item = (i64, i64)>) -> Vec<Point> {
        let mut points: Vec<Point> = corners.into_iter().map(|(x, y)| Point::new(x + 70, y - 30)).collect();
        points.push(points[0]);
        points
    }

    #[test]
    fn polygons_of_circles_are_recognised_and_others_are_not() {
        for (diameter, chord_error) in [(60, 0.5), (200, 0.25), (200, 4.0), (3000, 1.0)] {
            let half = i64::from(diameter) / 2;
            let want = Rect {
                x0: 70 - half,
                y0: -30 - half,
                x1: 70 + half,
                y1: -30 + half,
            };
            let corners = circle_corners(diameter, chord_error);
            assert_eq!(circle_of(&closed(corners.clone()), 1.0), Some(want), "{diameter}");
            let clockwise = corners.into_iter().rev();
            assert_eq!(circle_of(&closed(clockwise), 1.0), Some(want), "{diameter}");
        }
        // Corners on whole nanometres, written in tenths of one.
        let fine = |(x, y): &(i64, i64)| (10 * x, 10 * y);
        let tenths = closed(circle_corners(200, 0.25).iter().map(fine));
        let around = Rect::around(&tenths);
        assert_eq!(circle_of(&tenths, 0.1), Some(around));
        assert_eq!(circle_of(&tenths, 1.0), None);
        let circle = circle_corners(200, 0.25);
        let n = circle.len();
        // An ellipse, a circle with a bite, one that is gone round twice, a star on its corners, a square of many corners.
        let ellipse = circle.iter().map(|&(x, y)| (x, y * 9 / 10));
        let bitten = circle
            .iter()
            .enumerate()
            .map(|(k, &(x, y))| if k == 5 { (x / 2, y / 2) } else { (x, y) });
        let twice = (0..2 * n).map(|k| circle[k % n]);
        let star = (0..n).map(|k| circle[(k * (n / 2 + 1)) % n]);
        let square = (0..8).map(|k| [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)][k]);
        let square = square.map(|(x, y)| (100 * x, 100 * y));
        assert_eq!(circle_of(&closed(ellipse), 1.0), None);
        assert_eq!(circle_of(&closed(bitten), 1.0), None);
        assert_eq!(circle_of(&closed(twice), 1.0), None);
        assert_eq!(circle_of(&closed(star), 1.0), None);
        assert_eq!(circle_of(&closed(square), 1.0), None);
    }
}
