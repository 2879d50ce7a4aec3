//! Outlines that stand for pillars.

use super::circle::circle_of;
use super::outline_memo::{BoxMemo, OutlineMemo};
use super::rectangle::tilted_rectangle_of;
use super::shape::{CORNER_STEPS, Outline, Point, Rect, Shape, grid_step, rectangle_of, simplified};
use super::transform::Transform;
use metalith_pillars::{OutlineForm, PillarId, PillarShape, SquaresAndCircles};

/// Points of a closed outline of four corners.
const CLOSED: usize = 5;

/// An outline that may be a pillar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawnPillar {
    /// The box around it.
    pub around: Rect,
    /// Number that identifies it, where its width does not.
    pub number: Option<u16>,
    /// True if the corners are those of the pillar of this number, to the database unit.
    pub exact: bool,
}

/// Pillar that an outline in any place is, if it may be one of this shape; a database unit is so long (nm). It may have
/// more vertices than it needs.
pub fn pillar_of(points: &[Point], shape: PillarShape, unit_nm: f64) -> Option<DrawnPillar> {
    let of_width = |around| DrawnPillar {
        around,
        number: None,
        exact: false,
    };
    match shape.outline() {
        OutlineForm::Square => rectangle_of(&simplified(points)).map(of_width),
        OutlineForm::Circle => circle_of(points, unit_nm).map(of_width),
        OutlineForm::Mixed => {
            let square = rectangle_of(&simplified(points)).map(|around| (false, around));
            let (is_circle, around) = square.or_else(|| Some((true, circle_of(points, unit_nm)?)))?;
            either(around, is_circle, unit_nm)
        }
        OutlineForm::Polygon => {
            let tilted = tilted_rectangle_of(points, unit_nm)?;
            let number = tilted.number(shape, unit_nm)?;
            Some(DrawnPillar {
                around: tilted.around,
                number: Some(number),
                exact: tilted.has_corners(&drawn_corners(shape, number, unit_nm)),
            })
        }
    }
}

/// The square or circle in a box, its width to a whole nanometre; a database unit is so long (nm).
fn either(around: Rect, is_circle: bool, unit_nm: f64) -> Option<DrawnPillar> {
    let [width_nm, height_nm] = [around.width(), around.height()].map(|edge| edge as f64 * unit_nm);
    let step_nm = CORNER_STEPS * 2.0 * grid_step(unit_nm) * unit_nm;
    let mean_nm = 0.5 * (width_nm + height_nm);
    let is_alike = (width_nm - height_nm).abs() <= step_nm && mean_nm <= f64::from(u16::MAX);
    let PillarId(number) =
        is_alike.then(|| SquaresAndCircles::number(is_circle, mean_nm.round_ties_even() as u16))??;
    Some(DrawnPillar {
        around,
        number: Some(number),
        exact: false,
    })
}

/// Corners of a pillar without curves about its middle, each on the nearest place of the grid, not closed; a database unit is so
/// long (nm).
pub fn drawn_corners(shape: PillarShape, number: u16, unit_nm: f64) -> Vec<Point> {
    let unit = |nm: i64| (nm as f64 / unit_nm).round() as i64;
    let corners = shape.corners(PillarId(number), 0.0).into_iter();
    corners.map(|(x, y)| Point::new(unit(x), unit(y))).collect()
}

/// Tells the pillars of one shape on a layout: rectangles, of which a lens has millions in some hundred rotations, are
/// recognised once each.
pub struct PillarFinder {
    shape: PillarShape,
    /// True if pillars are recognised by their corners, and those are the corners of upright boxes.
    boxed: bool,
    unit_nm: f64,
    /// Answers for outlines as they are placed; boxes from the first corner.
    known: OutlineMemo<Option<DrawnPillar>>,
    /// Answers for upright boxes.
    boxes: BoxMemo<Option<DrawnPillar>>,
    placed: Vec<Point>,
}

impl PillarFinder {
    /// Finder for one layout, whose database unit is so long (nm).
    pub fn new(shape: PillarShape, unit_nm: f64) -> Self {
        Self {
            shape,
            boxed: shape.outline() == OutlineForm::Polygon && !shape.has_one_size(),
            unit_nm,
            known: OutlineMemo::default(),
            boxes: BoxMemo::default(),
            placed: Vec::new(),
        }
    }

    /// True if pillars have the same corners in an orientation that leaves an upright box unchanged: half a turn leaves
    /// every rectangle unchanged, a mirror about an axis upright ones.
    pub(super) fn keeps(&self, orientation: u8) -> bool {
        self.shape.outline() == OutlineForm::Polygon && self.shape.keeps(orientation & 4 != 0, 0)
    }

    /// Variant of [`pillar_of`] for a shape where it is placed.
    #[inline]
    pub fn placed(&mut self, shape: &Shape<'_>, placement: &Transform) -> Option<DrawnPillar> {
        match shape.rect {
            // Upright pillars are boxes, told by their edges.
            Some(rect) if self.boxed && placement.is_square() => {
                let around = placement.apply_rect(&rect)?;
                let (shape, unit_nm) = (self.shape, self.unit_nm);
                let told = self.boxes.of(&around, || pillar_of(&around.outline(), shape, unit_nm));
                told.map(|pillar| DrawnPillar { around, ..pillar })
            }
            // What they are was seen when they were read.
            _ if self.shape == PillarShape::Mixed && placement.is_square() && shape.outline.len() >= CLOSED => {
                let is_circle = shape.circle.is_some();
                match shape.circle.or(shape.rect) {
                    Some(rect) => either(placement.apply_rect(&rect)?, is_circle, self.unit_nm),
                    None => self.drawn(shape.outline, placement),
                }
            }
            _ => self.drawn(shape.outline, placement),
        }
    }

    #[inline]
    fn drawn(&mut self, outline: Outline<'_>, placement: &Transform) -> Option<DrawnPillar> {
        let (shape, unit_nm, buffer) = (self.shape, self.unit_nm, &mut self.placed);
        let mut ask = || {
            buffer.clear();
            buffer.extend(outline.points().map(|p| placement.apply(p)));
            pillar_of(buffer, shape, unit_nm)
        };
        // Other outlines come with their boxes, or are few; what is turned otherwise is rounded where it stands.
        let (Some(orientation), Some(first), OutlineForm::Polygon) =
            (outline.orientation(placement), outline.points().next(), shape.outline())
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
    use super::super::shape::ShapeKind;
    use super::*;
    use metalith_core::LayerNumber;
    use metalith_pillars::UprightRectangles;

    /// A closed outline, as the reader of a layout gives it.
    fn shape(points: &[Point]) -> Shape<'_> {
        Shape {
            kind: ShapeKind::Boundary,
            layer: LayerNumber::new(1, 0),
            outline: Outline::new(points),
            rect: rectangle_of(points),
            circle: None,
            offset: 0,
        }
    }

    fn square(orientation: u8, dx: i64, dy: i64) -> Transform {
        Transform::Square { orientation, dx, dy }
    }

    /// Each pillar in each orientation, twice, one time elsewhere: what is remembered is what is said without memory.
    #[test]
    fn what_is_remembered_is_what_is_said_of_the_outline_where_it_is_placed() {
        let rotated = PILLARS;
        let mut finder = PillarFinder::new(rotated, 1.0);
        for number in 1..=180 {
            let corners = PILLARS.corners(PillarId(number), 0.0);
            for off in [0, 1] {
                let mut points: Vec<Point> = corners.iter().map(|&(x, y)| Point::new(x + 31, y - 77)).collect();
                points[2].x += off;
                points.push(points[0]);
                for k in 0..16 {
                    let placement = square(k & 7, 1000 * i64::from(k), -350);
                    let placed: Vec<Point> = points.iter().map(|&p| placement.apply(p)).collect();
                    let want = pillar_of(&placed, rotated, 1.0);
                    assert_eq!(finder.placed(&shape(&points), &placement), want);
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
        let found = finder.placed(&shape(&upright), &tilted).unwrap();
        // The rotation of 36.87 degrees, to the nearest of 180.
        assert_eq!(found.number, Some(37));
    }

    /// Each size in each orientation, twice, one unit longer too: boxes are identified by their edges as placed, and by
    /// nothing else.
    #[test]
    fn upright_pillars_are_told_by_their_edges_in_every_orientation() {
        let pillars = UprightRectangles::of_lengths([90, 100, 150, 200].into_iter()).unwrap();
        let upright = PillarShape::from(pillars);
        let mut finder = PillarFinder::new(upright, 1.0);
        let mut found = 0;
        for (number, off) in (1..=pillars.count()).flat_map(|number| [(number, 0), (number, 1)]) {
            let [w, h] = pillars.edges_nm(number).map(i64::from);
            let around = Rect {
                x0: 31 - w / 2,
                y0: -77 - h / 2,
                x1: 31 + w / 2 + off,
                y1: -77 + h / 2,
            };
            for k in 0..16 {
                let placement = square(k & 7, 1000 * i64::from(k), -350);
                let placed: Vec<Point> = around.outline().iter().map(|&p| placement.apply(p)).collect();
                let want = pillar_of(&placed, upright, 1.0);
                assert_eq!(
                    finder.placed(&shape(&around.outline()), &placement),
                    want,
                    "{w} x {h}, {off}"
                );
                found += usize::from(want.is_some_and(|w| w.exact));
            }
        }
        assert_eq!(found, 16 * usize::from(pillars.count()));
    }
}
