//! Polygons that stand for circles.

use super::shape::{Point, Rect, rounding};

/// Fewest corners of a polygon that is taken for a circle.
const FEWEST_CORNERS: usize = 8;

/// Largest distance of the middle of a side inside the circle, in parts of the radius: an octagon's, and a little.
const SAGITTA: f64 = 0.08;

/// Largest error of the area, in parts of the circle's: an octagon has a tenth less. It distinguishes a circle from one
/// that is gone round twice.
const AREA: f64 = 0.15;

/// Largest mean distance of the corners from the circle in the box around them, if it is their circle (halves of
/// database units). Where no corner is on an axis the box is too small.
const LEVEL: f64 = 1.0;

/// The square around the circle that a closed outline stands for, if it does: all corners on one circle to within their rounding,
/// so many that each side is near it. A database unit is so long (nm).
///
/// Where the box around the corners is a square and the circle in it is theirs, it is that box. Else, as of nine corners, which
/// reach farther to one side than to the other, the circle is fitted to the corners; its middle is on the grid that they are
/// rounded to, as sites of lattices are, and its radius too.
pub fn circle_of(points: &[Point], unit_nm: f64) -> Option<Rect> {
    let corners = points.len().checked_sub(1).filter(|n| *n >= FEWEST_CORNERS)?;
    if points[0] != points[corners] {
        return None;
    }
    let slack = rounding(unit_nm);
    let around = Rect::around(points);
    let (width, height) = (around.width(), around.height());
    // A polygon is as wide as its circle, or less by a sagitta at either end.
    if (width - height).abs() as f64 > SAGITTA * width as f64 + 2.0 * slack || width == 0 {
        return None;
    }
    if width == height {
        let circle = Circle::within(&around);
        let mean = circle.mean_radius(points, slack);
        if mean.is_some_and(|mean| (mean - circle.radius).abs() <= LEVEL) {
            return Some(around);
        }
    }
    let circle = Circle::through(&points[1..], &around)?;
    circle.mean_radius(points, slack)?;
    circle.square(&points[1..], unit_nm)
}

/// A circle in halves of database units: the middle of a box and those of sides are then whole.
struct Circle {
    x: f64,
    y: f64,
    radius: f64,
}

impl Circle {
    /// The circle inscribed in a square.
    fn within(square: &Rect) -> Self {
        Self {
            x: (square.x0 + square.x1) as f64,
            y: (square.y0 + square.y1) as f64,
            radius: square.width() as f64,
        }
    }

    /// The circle nearest to corners in the least squares of x^2 + y^2 (I. Kasa, IEEE Trans. Instrum. Meas. 25, 8
    /// (1976)); `around` is the box around them. `None` if they are on a line.
    fn through(corners: &[Point], around: &Rect) -> Option<Self> {
        let count = corners.len() as f64;
        let middle = Self::within(around);
        let each = || corners.iter().map(|p| middle.to(2 * p.x, 2 * p.y));
        let [mean_x, mean_y] = each().fold([0.0; 2], |[a, b], [x, y]| [a + x / count, b + y / count]);
        let (mut xx, mut xy, mut yy, mut xr, mut yr) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for [x, y] in each().map(|[x, y]| [x - mean_x, y - mean_y]) {
            let square = x * x + y * y;
            xx += x * x;
            xy += x * y;
            yy += y * y;
            xr += 0.5 * x * square;
            yr += 0.5 * y * square;
        }
        let det = xx * yy - xy * xy;
        if det <= 0.0 {
            return None;
        }
        let [x, y] = [(xr * yy - yr * xy) / det, (yr * xx - xr * xy) / det];
        Some(Self {
            x: middle.x + mean_x + x,
            y: middle.y + mean_y + y,
            radius: (x * x + y * y + (xx + yy) / count).sqrt(),
        })
    }

    /// Vector from its middle to a place.
    fn to(&self, x: i64, y: i64) -> [f64; 2] {
        [x as f64 - self.x, y as f64 - self.y]
    }

    /// Mean distance of the points of a closed outline from the middle, if the outline stands for this circle: corners off it by
    /// `slack` (database units) at most, sides near it, and gone round once.
    fn mean_radius(&self, points: &[Point], slack: f64) -> Option<f64> {
        let (radius, slack) = (self.radius, 2.0 * slack);
        let from_middle = |x: i64, y: i64| {
            let [x, y] = self.to(x, y);
            x.hypot(y)
        };
        let (mut twice_area, mut sum) = (0.0, 0.0);
        for side in points.windows(2) {
            let (a, b) = (side[0], side[1]);
            let from = from_middle(2 * a.x, 2 * a.y);
            if (from - radius).abs() > slack {
                return None;
            }
            if from_middle(a.x + b.x, a.y + b.y) < radius * (1.0 - SAGITTA) - slack {
                return None;
            }
            let ([ax, ay], [bx, by]) = (self.to(2 * a.x, 2 * a.y), self.to(2 * b.x, 2 * b.y));
            twice_area += ax * by - ay * bx;
            sum += from;
        }
        let full = std::f64::consts::PI * radius * radius;
        let edge = std::f64::consts::TAU * radius * slack;
        let mean = sum / (points.len() - 1) as f64;
        ((twice_area.abs() / 2.0 - full).abs() <= AREA * full + edge).then_some(mean)
    }

    /// The square around it whose middle and whose half edge are on the grid of its corners: a pillar on a site of a lattice, which
    /// is there too, stays on it, though the corners' rounding moves the circle through them by parts of a step.
    fn square(&self, corners: &[Point], unit_nm: f64) -> Option<Rect> {
        let step = grid_of(corners, unit_nm);
        let steps = |half_units: f64| (half_units / (2 * step) as f64).round() as i64 * step;
        let first = corners.first()?;
        let [x, y] = self.to(2 * first.x, 2 * first.y).map(|v| steps(-v));
        let (x, y, half) = (first.x + x, first.y + y, steps(self.radius));
        Some(Rect {
            x0: x - half,
            y0: y - half,
            x1: x + half,
            y1: y + half,
        })
    }
}

/// Step of the grid that corners are on, from the first (database units): a nanometre at most, on which lattices are.
fn grid_of(corners: &[Point], unit_nm: f64) -> i64 {
    let divisor = |mut a: i64, mut b: i64| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let nanometre = (1.0 / unit_nm).round().max(1.0) as i64;
    let from_first = corners.iter().flat_map(|p| [p.x - corners[0].x, p.y - corners[0].y]);
    from_first.fold(nanometre, |step, way| divisor(way.abs(), step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::circle_corners;

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
        // Every diameter, coarse and fine, is read as the box around it, as the writer has it.
        for diameter in (60..=600).step_by(2) {
            for chord_error in [0.1, 0.5, 2.0] {
                let drawn = closed(circle_corners(diameter, chord_error));
                let around = Rect::around(&drawn);
                assert_eq!(around.width(), i64::from(diameter));
                assert_eq!(circle_of(&drawn, 1.0), Some(around), "{diameter} {chord_error}");
                let tenths: Vec<Point> = drawn.iter().map(|p| Point::new(10 * p.x, 10 * p.y)).collect();
                assert_eq!(
                    circle_of(&tenths, 0.1),
                    Some(Rect::around(&tenths)),
                    "{diameter} {chord_error}"
                );
            }
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

    /// A regular polygon on a circle, the first corner at a part of the angle between two, rounded to so many units.
    fn regular(corners: u32, radius: f64, turned: f64, grid: i64) -> Vec<Point> {
        let corner = |k: u32| {
            let (sin, cos) = (std::f64::consts::TAU * (f64::from(k) + turned) / f64::from(corners)).sin_cos();
            let rounded = |v: f64| (v / grid as f64).round() as i64 * grid;
            Point::new(7000 + rounded(radius * cos), -3000 + rounded(radius * sin))
        };
        (0..corners).chain([0]).map(corner).collect()
    }

    fn square(half: i64) -> Rect {
        Rect {
            x0: 7000 - half,
            y0: -3000 - half,
            x1: 7000 + half,
            y1: -3000 + half,
        }
    }

    /// Circles as other programs draw them: the box around an odd number of corners is no square and beside the middle,
    /// and that around corners beside the axes is too small. Also where a unit is a tenth of a nanometre, with corners
    /// on either grid.
    #[test]
    fn circles_of_any_number_of_corners_are_where_they_are() {
        for corners in 8..=40 {
            for turned in [0.0, 0.5] {
                let nm = regular(corners, 100.0, turned, 1);
                assert_eq!(circle_of(&nm, 1.0), Some(square(100)), "{corners} {turned}");
                for grid in [1, 10] {
                    let tenths = regular(corners, 1000.0, turned, grid);
                    assert_eq!(circle_of(&tenths, 0.1), Some(square(1000)), "{corners} {turned} {grid}");
                }
            }
        }
    }

    /// Polygons that are nearly circles: fewer corners than are taken for one, an oval, one corner off, half of one.
    #[test]
    fn other_polygons_are_no_circles_for_being_fitted() {
        for turned in [0.0, 0.5] {
            assert_eq!(circle_of(&regular(7, 100.0, turned, 1), 1.0), None);
            let drawn = regular(11, 100.0, turned, 1);
            let mut oval = drawn.clone();
            oval.iter_mut().for_each(|p| p.x += (p.x - 7000) / 20);
            assert_eq!(circle_of(&oval, 1.0), None);
            let mut dented = drawn.clone();
            dented[4].x += (7000 - dented[4].x) / 10;
            dented[4].y += (-3000 - dented[4].y) / 10;
            assert_eq!(circle_of(&dented, 1.0), None);
            let mut half = regular(24, 100.0, turned, 1);
            half.drain(12..24);
            assert_eq!(circle_of(&half, 1.0), None);
        }
        let on_a_line: Vec<Point> = (0..9)
            .map(|k| Point::new(k % 8, k % 8))
            .chain([Point::new(0, 0)])
            .collect();
        assert_eq!(circle_of(&on_a_line, 1.0), None);
    }
}
