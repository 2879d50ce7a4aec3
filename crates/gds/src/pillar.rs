//! Outlines that stand for pillars.

use super::circle::circle_of;
use super::memo::OutlineMemo;
use super::rectangle::tilted_rectangle_of;
use super::shape::{Outline, Point, Rect, rectangle_of, simplified};
use super::transform::Transform;
use metalith_core::PillarShape;

/// An outline that may be a pillar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawnPillar {
    /// The box around it.
    pub around: Rect,
    /// What tells it from others, where its width does not.
    pub number: Option<u16>,
    /// Whether the corners are those of the pillar of this number, to the database unit.
    pub exact: bool,
}

/// What an outline in any place is, if it may be a pillar of this shape; a database unit is so long (nm). It may have more
/// vertices than it needs.
pub fn pillar_of(points: &[Point], shape: PillarShape, unit_nm: f64) -> Option<DrawnPillar> {
    let of_width = |around| DrawnPillar {
        around,
        number: None,
        exact: false,
    };
    match shape {
        PillarShape::Square => rectangle_of(&simplified(points)).map(of_width),
        PillarShape::Circle => circle_of(points, unit_nm).map(of_width),
        PillarShape::Rectangle(pillars) => {
            let tilted = tilted_rectangle_of(points, unit_nm)?;
            let number = tilted.number(pillars, unit_nm)?;
            Some(DrawnPillar {
                around: tilted.around,
                number: Some(number),
                exact: tilted.has_corners(&drawn_corners(shape, number, unit_nm)),
            })
        }
    }
}

/// Corners of a pillar without curves about its middle, each on the nearest place of the grid, not closed; a database unit is so
/// long (nm).
pub fn drawn_corners(shape: PillarShape, number: u16, unit_nm: f64) -> Vec<Point> {
    let unit = |nm: i64| (nm as f64 / unit_nm).round() as i64;
    let corners = shape.corners(number, 0.0).into_iter();
    corners.map(|(x, y)| Point::new(unit(x), unit(y))).collect()
}

/// Tells the pillars of one shape on a layout: rectangles, of which a lens has millions in some hundred rotations, are
/// recognised once each.
pub struct PillarFinder {
    shape: PillarShape,
    unit_nm: f64,
    /// Of outlines as they are placed; boxes from the first corner.
    known: OutlineMemo<Option<DrawnPillar>>,
    placed: Vec<Point>,
}

impl PillarFinder {
    /// Of one layout, whose database unit is so long (nm).
    pub fn new(shape: PillarShape, unit_nm: f64) -> Self {
        Self {
            shape,
            unit_nm,
            known: OutlineMemo::default(),
            placed: Vec::new(),
        }
    }

    /// As [`pillar_of`], of an outline where it is placed.
    #[inline]
    pub fn placed(&mut self, outline: Outline<'_>, placement: &Transform) -> Option<DrawnPillar> {
        let (shape, unit_nm, buffer) = (self.shape, self.unit_nm, &mut self.placed);
        let mut ask = || {
            buffer.clear();
            buffer.extend(outline.points().map(|p| placement.apply(p)));
            pillar_of(buffer, shape, unit_nm)
        };
        // Other outlines come with their boxes, or are few; what is turned otherwise is rounded where it stands.
        let (Some(orientation), Some(first), PillarShape::Rectangle(_)) =
            (outline.orientation(placement), outline.points().next(), shape)
        else {
            return ask();
        };
        let first = placement.apply(first);
        let back = Point::new(-first.x, -first.y);
        let moved = |pillar: DrawnPillar, by| DrawnPillar {
            around: pillar.around.moved(by),
            ..pillar
        };
        let from_first = self
            .known
            .of(outline, orientation, || ask().map(|pillar| moved(pillar, back)));
        from_first.map(|pillar| moved(pillar, first))
    }
}

#[cfg(test)]
mod tests {
    use super::super::rectangle::tests::PILLARS;
    use super::*;

    /// Each pillar in each orientation, twice, one time elsewhere: what is remembered is what is said without memory.
    #[test]
    fn what_is_remembered_is_what_is_said_of_the_outline_where_it_is_placed() {
        let shape = PillarShape::Rectangle(PILLARS);
        let mut finder = PillarFinder::new(shape, 1.0);
        for number in 1..=180 {
            let corners = PILLARS.corners(number);
            for off in [0, 1] {
                let mut points: Vec<Point> = corners.iter().map(|&(x, y)| Point::new(x + 31, y - 77)).collect();
                points[2].x += off;
                points.push(points[0]);
                for k in 0..16 {
                    let placement = Transform::Square {
                        orientation: k & 7,
                        dx: 1000 * i64::from(k),
                        dy: -350,
                    };
                    let placed: Vec<Point> = points.iter().map(|&p| placement.apply(p)).collect();
                    let want = pillar_of(&placed, shape, 1.0);
                    assert_eq!(finder.placed(Outline::new(&points), &placement), want);
                    assert!(want.is_some_and(|w| w.exact == (off == 0)), "{number} {k}: {want:?}");
                }
            }
        }
        let tilted = Transform::General {
            matrix: [0.8, -0.6, 0.6, 0.8],
            dx: 0.0,
            dy: 0.0,
        };
        let upright: Vec<Point> = [(-45, -120), (45, -120), (45, 120), (-45, 120), (-45, -120)]
            .map(|(x, y)| Point::new(x, y))
            .into();
        let found = finder.placed(Outline::new(&upright), &tilted).unwrap();
        // The rotation of 36.87 degrees, to the nearest of 180.
        assert_eq!(found.number, Some(37));
    }
}
