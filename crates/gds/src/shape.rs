//! Shapes on a layer.

use std::f64::consts::SQRT_2;

use super::transform::{Transform, turned};
use metalith_core::LayerNumber;
use metalith_pillars::{OutlineForm, PillarShape};

/// Tolerance of recognition: largest distance along an axis of a corner from where the outline that it stands for has it, in steps
/// of the grid. Rounding to the grid moves a corner no farther. Two corners make an edge: one of a step more or less is the same.
pub const CORNER_STEPS: f64 = 0.5;

/// Times that a corner of a circle or a rectangle is rounded to the grid at most: in the file, and where its cell is placed at an angle
/// or turned back.
const ROUNDINGS: f64 = 2.0;

/// Tolerance of the place of a corner of a circle or a rectangle, in steps of the grid: [`CORNER_STEPS`] along both axes, each time it
/// is rounded.
const ROUNDED: f64 = ROUNDINGS * CORNER_STEPS * SQRT_2;

/// Step of the grid that corners may be rounded to, in database units, of which one is so long (nm): the unit or a nanometre,
/// whichever is more.
pub fn grid_step(unit_nm: f64) -> f64 {
    (1.0 / unit_nm).max(1.0)
}

/// Tolerance of the place of a corner in database units, of which one is so long (nm).
pub(super) fn rounding(unit_nm: f64) -> f64 {
    ROUNDED * grid_step(unit_nm)
}

/// True if edges of these lengths may be those of a square whose corners were rounded to a grid of this step, one after the other
/// along each axis: two corners give way by [`CORNER_STEPS`] along both.
pub fn are_of_square([width, height]: [i64; 2], step: f64) -> bool {
    (width - height).abs() as f64 <= 4.0 * CORNER_STEPS * step
}

/// Largest distance that one rounding moves a corner by, in database units, of which one is so long (nm).
pub(super) fn one_rounding(unit_nm: f64) -> f64 {
    rounding(unit_nm) / ROUNDINGS
}

/// A place in database units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Point {
    pub x: i64,
    pub y: i64,
}

impl Point {
    #[inline]
    pub fn new(x: i64, y: i64) -> Self {
        Self { x, y }
    }
}

/// An upright rectangle in database units; `x0 <= x1`, `y0 <= y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct Rect {
    pub x0: i64,
    pub y0: i64,
    pub x1: i64,
    pub y1: i64,
}

impl Rect {
    /// Contains nothing; grows by [`Rect::include`].
    pub const EMPTY: Self = Self {
        x0: i64::MAX,
        y0: i64::MAX,
        x1: i64::MIN,
        y1: i64::MIN,
    };

    pub fn is_empty(&self) -> bool {
        self.x0 > self.x1
    }

    /// Extent along x; zero if empty.
    pub fn width(&self) -> i64 {
        if self.is_empty() { 0 } else { self.x1 - self.x0 }
    }

    /// Extent along y; zero if empty.
    pub fn height(&self) -> i64 {
        if self.is_empty() { 0 } else { self.y1 - self.y0 }
    }

    /// Grow to hold a point.
    pub fn include(&mut self, p: Point) {
        self.x0 = self.x0.min(p.x);
        self.y0 = self.y0.min(p.y);
        self.x1 = self.x1.max(p.x);
        self.y1 = self.y1.max(p.y);
    }

    /// Grow to hold another rectangle.
    pub fn unite(&mut self, other: &Rect) {
        if !other.is_empty() {
            self.include(Point::new(other.x0, other.y0));
            self.include(Point::new(other.x1, other.y1));
        }
    }

    /// This rectangle, farther by a step.
    #[inline]
    pub(super) fn moved(&self, by: Point) -> Self {
        Self {
            x0: self.x0 + by.x,
            y0: self.y0 + by.y,
            x1: self.x1 + by.x,
            y1: self.y1 + by.y,
        }
    }

    /// Corners, counter-clockwise, the last the first again.
    pub(super) fn outline(&self) -> [Point; 5] {
        let corner = Point::new;
        let first = corner(self.x0, self.y0);
        [
            first,
            corner(self.x1, self.y0),
            corner(self.x1, self.y1),
            corner(self.x0, self.y1),
            first,
        ]
    }

    /// The smallest rectangle around points.
    pub fn around(points: &[Point]) -> Self {
        let mut rect = Self::EMPTY;
        points.iter().for_each(|&p| rect.include(p));
        rect
    }
}

/// Element of the format that a shape was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ShapeKind {
    Boundary,
    Box,
    /// Drawn with a pen; the outline is that of what it leaves.
    Path,
}

/// Points of an outline, in the coordinates of the cell it is drawn in. They are moved there when they are asked for: most
/// pillars are known by the box around them, or by the copy that was looked at before.
#[derive(Clone, Copy, Debug)]
pub struct Outline<'a> {
    /// Points as they were read.
    pub(super) points: &'a [Point],
    /// Transform that takes the points into the cell, exactly.
    pub(super) at: Transform,
    /// The number of these points in the layout, if they are of a cell that is placed shape by shape: all copies have it.
    pub(super) number: Option<u32>,
}

impl<'a> Outline<'a> {
    /// Outline of points of the cell.
    pub fn new(points: &'a [Point]) -> Self {
        Self::at(points, Transform::IDENTITY)
    }

    /// Outline of points that are turned by quarters, mirrored and moved.
    pub(super) fn at(points: &'a [Point], at: Transform) -> Self {
        debug_assert!(at.is_square());
        Self {
            points,
            at,
            number: None,
        }
    }

    /// This outline, whose points have this number in the layout.
    #[inline]
    pub(super) fn numbered(self, number: u32) -> Self {
        Self {
            number: Some(number),
            ..self
        }
    }

    /// True if a number identifies its points among the outlines of the layout.
    #[inline]
    pub fn has_number(&self) -> bool {
        self.number.is_some()
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points, in the order of the file.
    #[inline]
    pub fn points(self) -> impl ExactSizeIterator<Item = Point> + Clone + 'a {
        self.points.iter().map(move |&p| self.at.apply(p))
    }

    /// The points where a placement of the cell puts them.
    pub fn placed(self, placement: &Transform) -> Vec<Point> {
        self.points().map(|p| placement.apply(p)).collect()
    }

    /// Turn of its points in a placement, as the orientation of a [`Transform`], if only by quarters and mirrors.
    #[inline]
    pub(super) fn orientation(self, placement: &Transform) -> Option<u8> {
        match (self.at, *placement) {
            (Transform::Square { orientation: own, .. }, Transform::Square { orientation, .. }) => {
                Some(turned(orientation, own))
            }
            _ => None,
        }
    }

    /// The box around the points.
    pub fn around(self) -> Rect {
        let around = Rect::around(self.points);
        self.at.apply_rect(&around).unwrap_or(around)
    }
}

/// One area on a layer, in the coordinates of the cell it is drawn in.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    pub kind: ShapeKind,
    pub layer: LayerNumber,
    /// The outline as the file has it: the last point repeats the first where the format is kept.
    pub outline: Outline<'a>,
    /// Upright rectangle that the shape is, if it is one, with area and with five points.
    pub rect: Option<Rect>,
    /// The square around the circle that it stands for, if it does: see [`crate::circle_of`].
    pub circle: Option<Rect>,
    /// Place of the element in the file.
    pub offset: u64,
}

impl Shape<'_> {
    /// The square around it, if it may be a pillar of this shape as it stands, by its box alone; rectangles are
    /// identified by their corners, where they are placed: see [`crate::pillar_of`].
    #[inline]
    pub fn pillar(&self, shape: PillarShape) -> Option<&Rect> {
        match shape.outline() {
            OutlineForm::Square => self.rect.as_ref(),
            OutlineForm::Circle => self.circle.as_ref(),
            OutlineForm::Polygon | OutlineForm::Mixed => None,
        }
    }
}

/// A label: no area, no exposure.
#[derive(Clone, Copy, Debug)]
pub struct Text<'a> {
    pub layer: LayerNumber,
    pub string: &'a [u8],
    pub at: Point,
    pub offset: u64,
}

/// The upright rectangle that a closed outline of five points is, if it has area.
#[inline]
pub fn rectangle_of(points: &[Point]) -> Option<Rect> {
    let &[a, b, c, d, e] = points else { return None };
    let upright = (a.x == b.x && b.y == c.y && c.x == d.x && d.y == a.y)
        || (a.y == b.y && b.x == c.x && c.y == d.y && d.x == a.x);
    if a != e || !upright || a.x == c.x || a.y == c.y {
        return None;
    }
    Some(Rect {
        x0: a.x.min(c.x),
        y0: a.y.min(c.y),
        x1: a.x.max(c.x),
        y1: a.y.max(c.y),
    })
}

/// The outline, closed, without doubled points and without points on the way from one to the next: what
/// decides whether an outline with more vertices than it needs is a rectangle.
pub fn simplified(points: &[Point]) -> Vec<Point> {
    let mut ring: Vec<Point> = points.to_vec();
    ring.dedup();
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    // A point is needed unless it lies between its neighbours; dropping one may free another.
    let between = |a: Point, b: Point, c: Point| {
        let (ux, uy) = (i128::from(b.x - a.x), i128::from(b.y - a.y));
        let (vx, vy) = (i128::from(c.x - b.x), i128::from(c.y - b.y));
        ux * vy == uy * vx && ux * vx + uy * vy >= 0
    };
    let mut kept: Vec<Point> = Vec::with_capacity(ring.len() + 1);
    for &p in &ring {
        while kept.len() >= 2 && between(kept[kept.len() - 2], kept[kept.len() - 1], p) {
            kept.pop();
        }
        kept.push(p);
    }
    while kept.len() >= 3 && between(kept[kept.len() - 2], kept[kept.len() - 1], kept[0]) {
        kept.pop();
    }
    let mut first = 0;
    while kept.len() - first >= 3 && between(kept[kept.len() - 1], kept[first], kept[first + 1]) {
        first += 1;
    }
    kept.drain(..first);
    if let Some(&start) = kept.first() {
        kept.push(start);
    }
    kept
}
