//! Outlines that stand for rectangles at any angle.

use super::shape::{Point, Rect, one_rounding, rounding, simplified};
use metalith_pillars::{PillarId, PillarShape, RotatedRectangles};

/// Corners of a rectangle.
const CORNERS: f64 = 4.0;

/// A rectangle at any angle, as its corners on the grid show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TiltedRectangle {
    /// The box around it.
    pub around: Rect,
    /// Corners, counter-clockwise or not, from the middle of that box (database units).
    corners: [[f64; 2]; 4],
    /// The shorter and the longer edge (database units).
    pub edges: [f64; 2],
    /// Tolerance of corners (database units).
    slack: f64,
}

/// The rectangle that a closed outline is to within the rounding of its corners, if it has area; the upright ones too. A
/// database unit is so long (nm).
pub fn tilted_rectangle_of(points: &[Point], unit_nm: f64) -> Option<TiltedRectangle> {
    let simple;
    let points = if points.len() == 5 {
        points
    } else {
        simple = simplified(points);
        &simple
    };
    let &[a, b, c, d, e] = points else { return None };
    if a != e {
        return None;
    }
    let around = Rect::around(points);
    let middle = [
        (around.x0 + around.x1) as f64 / 2.0,
        (around.y0 + around.y1) as f64 / 2.0,
    ];
    let corners = [a, b, c, d].map(|p| [p.x as f64 - middle[0], p.y as f64 - middle[1]]);
    let slack = rounding(unit_nm);
    let edges = edges_of(&corners);
    let is_rectangle = off_rectangle(&corners) <= CORNERS.sqrt() * slack;
    (is_rectangle && edges[0] > 2.0 * slack).then_some(TiltedRectangle {
        around,
        corners,
        edges,
        slack,
    })
}

/// Lengths of the shorter and the longer edge of a quadrilateral, each the mean of both sides.
fn edges_of(c: &[[f64; 2]; 4]) -> [f64; 2] {
    let mean = |k: usize| {
        let along = |axis: usize| c[k + 1][axis] - c[k][axis] + c[(k + 2) % 4][axis] - c[(k + 3) % 4][axis];
        0.5 * along(0).hypot(along(1))
    };
    let [first, second] = [0, 1].map(mean);
    [first.min(second), first.max(second)]
}

/// Root of the sum of the squares of the distances of four corners from those of the nearest rectangle. Diagonals of a parallelogram
/// have one middle, those of one with right angles are as long. The nearest rectangle is a projection: corners that were moved from a
/// rectangle are no farther from it, in this sum, than they were moved.
fn off_rectangle(corners: &[[f64; 2]; 4]) -> f64 {
    let half = |sign: f64, k: usize| [0, 1].map(|axis| (corners[k][axis] + sign * corners[k + 2][axis]) / 2.0);
    let [p, q] = [0, 1].map(|k| half(1.0, k));
    let [r, s] = [0, 1].map(|k| half(-1.0, k)).map(|[x, y]| x.hypot(y));
    (p[0] - q[0]).hypot(p[1] - q[1]).hypot(r - s)
}

impl TiltedRectangle {
    /// True if it may be rotated by a whole number of steps, so many in half a turn; a database unit is so long (nm). One rounding of
    /// its corners turns a rectangle, in the least squares, by no more than it moves a corner over half of the diagonal.
    pub fn is_rotated_in_steps(&self, steps: u16, unit_nm: f64) -> bool {
        let half_diagonal = 0.5 * self.edges[0].hypot(self.edges[1]);
        let off = RotatedRectangles::off_step(&self.corners, steps);
        off.is_some_and(|off| off.abs() * half_diagonal <= one_rounding(unit_nm))
    }

    /// Tolerance of its edges (database units): what both corners of an edge give way by.
    pub fn edges_off(&self) -> f64 {
        self.slack
    }

    /// True if it is a square to within the rounding of its corners.
    pub fn is_square(&self) -> bool {
        self.edges[1] - self.edges[0] <= 2.0 * self.slack
    }

    /// The number of the pillar that it is, if it is one of these; a database unit is so long (nm).
    pub fn number(&self, pillars: PillarShape, unit_nm: f64) -> Option<u16> {
        let corners = self.corners.map(|c| c.map(|v| v * unit_nm));
        let found = pillars.recognised(&corners, self.slack * unit_nm);
        found.map(|PillarId(number)| number)
    }

    /// True if all corners are among these, from the middle.
    pub fn has_corners(&self, drawn: &[Point]) -> bool {
        let is_drawn = |corner: &[f64; 2]| drawn.iter().any(|p| [p.x as f64, p.y as f64] == *corner);
        self.corners.iter().all(is_drawn)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use metalith_pillars::{Rectangles, RotatedRectangles};

    pub(crate) const PILLARS: PillarShape = PillarShape::Rectangle(Rectangles::Rotated(RotatedRectangles {
        width_nm: 90,
        length_nm: 240,
        steps: 180,
    }));

    fn closed(corners: impl IntoIterator<Item = (i64, i64)>) -> Vec<Point> {
        let mut points: Vec<Point> = corners.into_iter().map(|(x, y)| Point::new(x + 177, y - 31)).collect();
        points.push(points[0]);
        points
    }

    #[test]
    fn rectangles_at_any_angle_are_recognised_and_others_are_not() {
        for number in 1..=180 {
            let corners = PILLARS.corners(PillarId(number), 0.0);
            for outline in [closed(corners.clone()), closed(corners.into_iter().rev())] {
                let found = tilted_rectangle_of(&outline, 1.0).unwrap();
                assert_eq!(found.number(PILLARS, 1.0), Some(number));
                let (x, y) = PILLARS.reach(PillarId(number));
                let around = Rect {
                    x0: 177 - x,
                    y0: -31 - y,
                    x1: 177 + x,
                    y1: -31 + y,
                };
                assert_eq!(found.around, around);
                // A file in half nanometres.
                let fine: Vec<Point> = outline.iter().map(|p| Point::new(2 * p.x, 2 * p.y)).collect();
                assert_eq!(
                    tilted_rectangle_of(&fine, 0.5).unwrap().number(PILLARS, 0.5),
                    Some(number)
                );
            }
        }
        let corners = PILLARS.corners(PillarId(37), 0.0);
        // A vertex on a side changes nothing; a trapezoid, a rhombus, a triangle and a line are no rectangles.
        let more = [corners[0], corners[1], corners[2], corners[3], corners[0]];
        let mut more = closed(more);
        more.insert(1, more[0]);
        assert_eq!(tilted_rectangle_of(&more, 1.0).unwrap().number(PILLARS, 1.0), Some(37));
        let trapezoid = [(-100, 0), (100, 0), (50, 80), (-50, 80)];
        let rhombus = [(-100, 0), (0, -60), (100, 0), (0, 60)];
        let triangle = [(-100, 0), (100, 0), (0, 80)];
        let line = [(-100, 0), (100, 0), (100, 1), (-100, 1)];
        assert_eq!(tilted_rectangle_of(&closed(trapezoid), 1.0), None);
        assert_eq!(tilted_rectangle_of(&closed(rhombus), 1.0), None);
        assert_eq!(tilted_rectangle_of(&closed(triangle), 1.0), None);
        assert_eq!(tilted_rectangle_of(&closed(line), 1.0), None);
        let square = tilted_rectangle_of(&closed([(-50, -50), (50, -50), (50, 50), (-50, 50)]), 1.0).unwrap();
        assert!(square.is_square() && square.number(PILLARS, 1.0).is_none());
    }
}
