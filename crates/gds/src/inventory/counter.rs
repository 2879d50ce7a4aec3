//! Numbers that the first reading keeps in addition for an inventory: kinds of areas, ranges of the places of references, texts.

use std::collections::HashMap;

use serde::Serialize;

use crate::circle::circle_of;
use crate::element::{ElementContent, ElementKind};
use crate::rectangle::tilted_rectangle_of;
use crate::shape::{Point, Rect, rectangle_of, simplified};
use crate::transform::Transform;
use metalith_core::LayerNumber;

/// Texts that are kept with their strings; all are counted.
const TEXTS: usize = 100;

/// Ranges of places that are kept of references by angle or magnification; each costs some 100 bytes.
const REACHES: usize = 1 << 20;

/// Numbers of areas by what they are, and the range of their sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct KindTally {
    pub squares: u64,
    pub rectangles: u64,
    /// Rectangles and squares whose edges are not along the axes.
    pub rotated_rectangles: u64,
    pub circles: u64,
    pub polygons: u64,
    pub paths: u64,
    /// Smallest and largest side of squares and rectangles and diameter of circles (database units); the smallest is above the
    /// largest if there are none.
    #[serde(skip)]
    pub(super) sides: [i64; 2],
}

impl Default for KindTally {
    fn default() -> Self {
        Self {
            squares: 0,
            rectangles: 0,
            rotated_rectangles: 0,
            circles: 0,
            polygons: 0,
            paths: 0,
            sides: [i64::MAX, i64::MIN],
        }
    }
}

impl KindTally {
    /// Number of each kind, and the word for one.
    pub fn named(&self) -> [(u64, &'static str); 6] {
        [
            (self.squares, "square"),
            (self.circles, "circle"),
            (self.rectangles, "rectangle"),
            (self.rotated_rectangles, "rotated rectangle"),
            (self.polygons, "polygon"),
            (self.paths, "path"),
        ]
    }

    /// Areas that may be pillars.
    pub fn pillar_like(&self) -> u64 {
        [self.squares, self.rectangles, self.rotated_rectangles, self.circles]
            .into_iter()
            .fold(0, u64::saturating_add)
    }

    /// Smallest and largest side of squares and rectangles and diameter of circles; a database unit is so long (nm).
    pub fn sides_nm(&self, unit_nm: f64) -> Option<[f64; 2]> {
        (self.sides[0] <= self.sides[1]).then(|| self.sides.map(|side| side as f64 * unit_nm))
    }

    /// Count an upright rectangle.
    #[inline]
    fn rectangle(&mut self, rect: &Rect, copies: u64) {
        let (width, height) = (rect.width(), rect.height());
        let count = if width == height {
            &mut self.squares
        } else {
            &mut self.rectangles
        };
        *count = count.saturating_add(copies);
        self.side(width.min(height), width.max(height));
    }

    #[inline]
    fn side(&mut self, smallest: i64, largest: i64) {
        self.sides = [self.sides[0].min(smallest), self.sides[1].max(largest)];
    }

    /// Count a closed outline.
    pub(super) fn outline(&mut self, points: &[Point], unit_nm: f64, copies: u64) {
        if let Some(rect) = rectangle_of(points).or_else(|| rectangle_of(&simplified(points))) {
            self.rectangle(&rect, copies);
        } else if let Some(square) = circle_of(points, unit_nm) {
            self.circles = self.circles.saturating_add(copies);
            self.side(square.width(), square.width());
        } else if let Some(rectangle) = tilted_rectangle_of(points, unit_nm) {
            self.rotated_rectangles = self.rotated_rectangles.saturating_add(copies);
            let [short, long] = rectangle.edges.map(|edge| edge.round() as i64);
            self.side(short, long);
        } else {
            self.polygons = self.polygons.saturating_add(copies);
        }
    }

    /// Add so many copies of another, between the least and the greatest of these magnifications.
    pub(super) fn add(&mut self, other: &Self, times: u64, magnifications: [f64; 2]) {
        let add = |sum: &mut u64, n: u64| *sum = sum.saturating_add(n.saturating_mul(times));
        add(&mut self.squares, other.squares);
        add(&mut self.rectangles, other.rectangles);
        add(&mut self.rotated_rectangles, other.rotated_rectangles);
        add(&mut self.circles, other.circles);
        add(&mut self.polygons, other.polygons);
        add(&mut self.paths, other.paths);
        if other.sides[0] <= other.sides[1] {
            let [smallest, largest] = [0, 1].map(|end| (other.sides[end] as f64 * magnifications[end]).round() as i64);
            self.side(smallest, largest);
        }
    }
}

/// References from one cell to one other by one rotation, mirror and magnification.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// Number of the name of the cell referred to.
    pub number: u32,
    /// Transform without its shift.
    pub turn: Transform,
    /// The box around all shifts.
    pub shifts: Rect,
}

/// A text in the coordinates of its cell.
#[derive(Clone, Debug)]
pub(crate) struct CountedText {
    pub layer: LayerNumber,
    pub string: Vec<u8>,
    pub at: Point,
}

/// Counts of one cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct CellCounts {
    /// By the index of the layer in the cell; shorter where the last layers have no areas.
    pub kinds: Vec<KindTally>,
    pub reaches: Vec<Reach>,
    pub texts: Vec<CountedText>,
    /// True if there are more reaches than are kept.
    pub incomplete: bool,
}

/// Counts of the cell that is being read.
pub(crate) struct Counter {
    unit_nm: f64,
    now: CellCounts,
    /// Shifts of references without rotation, by number of the name.
    plain: Vec<Rect>,
    turned: HashMap<(u32, [u64; 4]), usize>,
    texts: usize,
    reaches: usize,
}

impl Counter {
    pub(crate) fn new() -> Self {
        Self {
            unit_nm: 1.0,
            now: CellCounts::default(),
            plain: Vec::new(),
            turned: HashMap::new(),
            texts: 0,
            reaches: 0,
        }
    }

    /// The database unit is so long (m).
    pub(crate) fn unit(&mut self, metres: f64) {
        self.unit_nm = metres * 1e9;
    }

    #[inline]
    fn kinds(&mut self, layer: usize) -> &mut KindTally {
        if layer >= self.now.kinds.len() {
            self.now.kinds.resize(layer + 1, KindTally::default());
        }
        &mut self.now.kinds[layer]
    }

    /// Count an outline of five points on a layer of the cell, by its index.
    #[inline]
    pub(crate) fn five_points(&mut self, layer: usize, points: &[Point; 5]) {
        let unit_nm = self.unit_nm;
        let kinds = self.kinds(layer);
        match rectangle_of(points) {
            Some(rect) => kinds.rectangle(&rect, 1),
            None => kinds.outline(points, unit_nm, 1),
        }
    }

    /// Count so many copies of an element with a layer.
    pub(crate) fn element(&mut self, layer: usize, element: &ElementContent, copies: u64) {
        let unit_nm = self.unit_nm;
        match element.kind {
            ElementKind::Boundary | ElementKind::Box => self.kinds(layer).outline(&element.points, unit_nm, copies),
            ElementKind::Path => {
                let kinds = self.kinds(layer);
                kinds.paths = kinds.paths.saturating_add(copies);
            }
            ElementKind::Text if self.texts < TEXTS => {
                self.texts += 1;
                self.now.texts.push(CountedText {
                    layer: element.layer,
                    string: element.string.clone(),
                    at: element.points[0],
                });
            }
            _ => {}
        }
    }

    /// Take in a reference without rotation to the cell of a number.
    #[inline]
    pub(crate) fn plain(&mut self, number: u32, at: Point) {
        let number = number as usize;
        if number >= self.plain.len() {
            self.plain.resize(number + 1, Rect::EMPTY);
        }
        self.plain[number].include(at);
    }

    /// Take in a reference with all its copies; `reach` is left, bottom, right, top of their places from the first.
    pub(crate) fn reference(&mut self, number: u32, element: &ElementContent, reach: [i64; 4]) {
        let (columns, all) = (u64::from(element.columns.max(1)), element.copies().max(1));
        let mut shifts = Rect::EMPTY;
        // Shifts of an array are affine in column and row.
        for k in [0, (columns - 1).min(all - 1), all - columns.min(all), all - 1] {
            let at = element.copy(k).apply(Point::new(0, 0));
            shifts.include(Point::new(at.x + reach[0], at.y + reach[1]));
            shifts.include(Point::new(at.x + reach[2], at.y + reach[3]));
        }
        let turn = element.copy(0).without_shift();
        let key = match turn {
            Transform::Square { orientation, .. } => [orientation.into(), 0, 0, 0],
            Transform::General { matrix, .. } => matrix.map(f64::to_bits),
        };
        let reaches = &mut self.now.reaches;
        if let Some(&place) = self.turned.get(&(number, key)) {
            reaches[place].shifts.unite(&shifts);
        } else if self.reaches + reaches.len() < REACHES {
            self.turned.insert((number, key), reaches.len());
            reaches.push(Reach { number, turn, shifts });
        } else {
            self.now.incomplete = true;
        }
    }

    /// Counts of the cell, which is complete and refers to the names of these numbers.
    pub(crate) fn end(&mut self, referred: &[u32]) -> CellCounts {
        for &number in referred {
            let shifts = self
                .plain
                .get_mut(number as usize)
                .map(|s| std::mem::replace(s, Rect::EMPTY));
            if let Some(shifts) = shifts.filter(|s| !s.is_empty()) {
                let turn = Transform::IDENTITY;
                self.now.reaches.push(Reach { number, turn, shifts });
            }
        }
        self.turned.clear();
        // Long names are read another way, which adds their reaches first.
        self.now.reaches.sort_by_key(|reach| reach.number);
        self.reaches += self.now.reaches.len();
        std::mem::take(&mut self.now)
    }
}
