//! Placement of a cell by a reference: mirror at the x axis, magnify, turn, shift, in this order.

use super::limits::{FARTHEST, MAGNIFICATION};
use super::shape::{Point, Rect};

/// A placement. Quarter turns and mirrors are exact in integers; what is magnified or turned otherwise is
/// computed in double precision through the whole chain of references and rounded once, to the nearest
/// database unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// `orientation & 3` quarter turns counter-clockwise after a mirror at the x axis if `orientation & 4`.
    Square { orientation: u8, dx: i64, dy: i64 },
    /// `x' = m[0] x + m[1] y + dx`, `y' = m[2] x + m[3] y + dy`.
    General { matrix: [f64; 4], dx: f64, dy: f64 },
}

/// Angles this close to a quarter turn (in quarter turns), and magnifications this close to one, are meant
/// to be it: writers convert from radians in double precision, and over the largest coordinate, 2^31, the
/// difference is a fiftieth of a database unit.
const EXACT: f64 = 1e-11;

impl Transform {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self::Square {
        orientation: 0,
        dx: 0,
        dy: 0,
    };

    /// The transform of a reference; none if the magnification is beyond limits.
    pub(super) fn of_reference(mirror: bool, magnification: f64, angle_deg: f64, at: Point) -> Option<Self> {
        if !(1.0 / MAGNIFICATION..=MAGNIFICATION).contains(&magnification) || !angle_deg.is_finite() {
            return None;
        }
        let quarters = (angle_deg / 90.0).rem_euclid(4.0);
        let nearest = quarters.round();
        if (quarters - nearest).abs() < EXACT && (magnification - 1.0).abs() < EXACT {
            return Some(Self::Square {
                orientation: nearest as u8 % 4 + if mirror { 4 } else { 0 },
                dx: at.x,
                dy: at.y,
            });
        }
        let (sin, cos) = if (quarters - nearest).abs() < EXACT {
            [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][nearest as usize % 4]
        } else {
            angle_deg.to_radians().sin_cos()
        };
        let flip = if mirror { -1.0 } else { 1.0 };
        let m = magnification;
        Some(Self::General {
            matrix: [m * cos, -m * sin * flip, m * sin, m * cos * flip],
            dx: at.x as f64,
            dy: at.y as f64,
        })
    }

    /// This transform, farther by a step.
    pub(super) fn moved(self, by: Point) -> Self {
        match self {
            Self::Square { orientation, dx, dy } => Self::Square {
                orientation,
                dx: dx + by.x,
                dy: dy + by.y,
            },
            Self::General { matrix, dx, dy } => Self::General {
                matrix,
                dx: dx + by.x as f64,
                dy: dy + by.y as f64,
            },
        }
    }

    /// The rotation, mirror and magnification alone.
    pub(super) fn without_shift(self) -> Self {
        match self {
            Self::Square { orientation, .. } => Self::Square {
                orientation,
                dx: 0,
                dy: 0,
            },
            Self::General { matrix, .. } => Self::General {
                matrix,
                dx: 0.0,
                dy: 0.0,
            },
        }
    }

    /// Place of a point of the cell.
    #[inline]
    pub fn apply(&self, p: Point) -> Point {
        match *self {
            Self::Square { orientation, dx, dy } => {
                let (x, y) = turn(orientation, p.x, p.y);
                Point::new(x + dx, y + dy)
            }
            Self::General { matrix: m, dx, dy } => {
                let (x, y) = (p.x as f64, p.y as f64);
                Point::new(held(m[0] * x + m[1] * y + dx), held(m[2] * x + m[3] * y + dy))
            }
        }
    }

    /// Twice the place of a point of which twice the coordinates are given.
    pub(super) fn twice(&self, p: Point) -> [i64; 2] {
        let (m, dx, dy) = self.matrix();
        let (x, y) = (p.x as f64, p.y as f64);
        [
            held(m[0] * x + m[1] * y + 2.0 * dx),
            held(m[2] * x + m[3] * y + 2.0 * dy),
        ]
    }

    /// Place of a rectangle of the cell, if it is still an upright one whatever its size.
    #[inline]
    pub fn apply_rect(&self, r: &Rect) -> Option<Rect> {
        let between = |ax: i64, ay: i64, bx: i64, by: i64| Rect {
            x0: ax.min(bx),
            y0: ay.min(by),
            x1: ax.max(bx),
            y1: ay.max(by),
        };
        // Done for every pillar: without a call of the general case.
        if let Self::Square { orientation, dx, dy } = *self {
            let ((ax, ay), (bx, by)) = (turn(orientation, r.x0, r.y0), turn(orientation, r.x1, r.y1));
            return Some(between(ax + dx, ay + dy, bx + dx, by + dy));
        }
        self.general_rect(r).map(|(a, b)| between(a.x, a.y, b.x, b.y))
    }

    /// Two opposite corners of a rectangle, if it is not turned by less than a quarter.
    #[inline(never)]
    fn general_rect(&self, r: &Rect) -> Option<(Point, Point)> {
        if let Self::General { matrix: m, .. } = self
            && m[1] != 0.0
            && m[0] != 0.0
        {
            return None;
        }
        Some((self.apply(Point::new(r.x0, r.y0)), self.apply(Point::new(r.x1, r.y1))))
    }

    /// Factor by which lengths grow.
    pub fn magnification(&self) -> f64 {
        match self {
            Self::Square { .. } => 1.0,
            Self::General { matrix: m, .. } => (m[0] * m[3] - m[1] * m[2]).abs().sqrt(),
        }
    }

    /// First `inner`, then this; none if the magnification of the chain is beyond limits.
    pub fn after(&self, inner: &Self) -> Option<Self> {
        if let (
            Self::Square { orientation, dx, dy },
            Self::Square {
                orientation: o,
                dx: x,
                dy: y,
            },
        ) = (*self, *inner)
        {
            let (x, y) = turn(orientation, x, y);
            return Some(Self::Square {
                orientation: turned(orientation, o),
                dx: x + dx,
                dy: y + dy,
            });
        }
        let (a, ax, ay) = self.matrix();
        let (b, bx, by) = inner.matrix();
        let matrix = [
            a[0] * b[0] + a[1] * b[2],
            a[0] * b[1] + a[1] * b[3],
            a[2] * b[0] + a[3] * b[2],
            a[2] * b[1] + a[3] * b[3],
        ];
        let magnification = (matrix[0] * matrix[3] - matrix[1] * matrix[2]).abs().sqrt();
        (1.0 / MAGNIFICATION..=MAGNIFICATION)
            .contains(&magnification)
            .then(|| Self::General {
                matrix,
                dx: a[0] * bx + a[1] * by + ax,
                dy: a[2] * bx + a[3] * by + ay,
            })
    }

    /// True if shapes keep their size and right angles stay on the axes.
    pub fn is_square(&self) -> bool {
        matches!(self, Self::Square { .. })
    }

    /// True if upright rectangles stay upright, whatever their size.
    #[inline]
    pub(super) fn keeps_upright(&self) -> bool {
        match self {
            Self::Square { .. } => true,
            Self::General { matrix: m, .. } => m[0] == 0.0 || m[1] == 0.0,
        }
    }

    /// True if a counter-clockwise outline becomes a clockwise one.
    pub fn mirrors(&self) -> bool {
        match self {
            Self::Square { orientation, .. } => orientation & 4 != 0,
            Self::General { matrix: m, .. } => m[0] * m[3] - m[1] * m[2] < 0.0,
        }
    }

    /// This transform as exact quarter turns and a shift by whole units, if its angle and magnification are nearly that.
    pub(super) fn squared(self) -> Self {
        /// Products of cosines are off by less.
        const NEARLY: f64 = 1e-9;
        let Self::General { matrix: m, dx, dy } = self else {
            return self;
        };
        let is_near = |orientation: &u8| {
            let (xx, xy) = turn(*orientation, 1, 0);
            let (yx, yy) = turn(*orientation, 0, 1);
            let exact = [xx, yx, xy, yy].map(|v| v as f64);
            m.iter().zip(exact).all(|(a, b)| (a - b).abs() <= NEARLY)
        };
        match (0..8).find(is_near) {
            Some(orientation) => Self::Square {
                orientation,
                dx: held(dx),
                dy: held(dy),
            },
            None => self,
        }
    }

    fn matrix(&self) -> ([f64; 4], f64, f64) {
        match *self {
            Self::General { matrix, dx, dy } => (matrix, dx, dy),
            Self::Square { orientation, dx, dy } => {
                let (xx, xy) = turn(orientation, 1, 0);
                let (yx, yy) = turn(orientation, 0, 1);
                ([xx as f64, yx as f64, xy as f64, yy as f64], dx as f64, dy as f64)
            }
        }
    }
}

#[inline]
fn turn(orientation: u8, x: i64, y: i64) -> (i64, i64) {
    let y = if orientation & 4 == 0 { y } else { -y };
    match orientation & 3 {
        0 => (x, y),
        1 => (-y, x),
        2 => (-x, -y),
        _ => (y, -x),
    }
}

/// The orientation of what is placed by `inner`, then by `outer`.
#[inline]
pub(super) fn turned(outer: u8, inner: u8) -> u8 {
    // Mirror first: turns of the inner transform change direction under a mirror of the outer.
    let turns = if outer & 4 == 0 {
        (outer & 3) + (inner & 3)
    } else {
        (outer & 3) + 4 - (inner & 3)
    };
    turns % 4 + ((outer ^ inner) & 4)
}

fn held(value: f64) -> i64 {
    (value.round() as i64).clamp(-FARTHEST, FARTHEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Composition agrees with applying one after the other, for all 64 pairs of orientations, in integers
    /// and through matrices.
    #[test]
    fn composition_is_application_in_turn() {
        let p = Point::new(7, 3);
        for a in 0..8u8 {
            for b in 0..8u8 {
                let outer = Transform::Square {
                    orientation: a,
                    dx: 100,
                    dy: -20,
                };
                let inner = Transform::Square {
                    orientation: b,
                    dx: -5,
                    dy: 11,
                };
                let chain = outer.after(&inner).unwrap();
                assert_eq!(chain.apply(p), outer.apply(inner.apply(p)));
                let (matrix, dx, dy) = outer.matrix();
                let general = Transform::General { matrix, dx, dy };
                assert_eq!(general.after(&inner).unwrap().apply(p), chain.apply(p));
                assert_eq!(general.mirrors(), outer.mirrors());
            }
        }
    }

    #[test]
    fn turns_and_magnification() {
        let at = Point::new(10, 20);
        let turned = Transform::of_reference(true, 1.0, 90.0, at).unwrap();
        // (3, 1) mirrored is (3, -1), a quarter turn on (1, 3).
        assert_eq!(turned.apply(Point::new(3, 1)), Point::new(11, 23));
        assert!(
            Transform::of_reference(false, 1.0, 360.0 - 1e-12, at)
                .unwrap()
                .is_square()
        );
        let doubled = Transform::of_reference(false, 2.0, 270.0, at).unwrap();
        assert_eq!(doubled.apply(Point::new(3, 1)), Point::new(12, 14));
        assert!(Transform::of_reference(false, 0.0, 0.0, at).is_none());
        assert!(Transform::of_reference(false, 1e9, 0.0, at).is_none());
        let large = Transform::of_reference(false, 1e5, 0.0, at).unwrap();
        assert!(large.after(&large).is_none());
    }
}
