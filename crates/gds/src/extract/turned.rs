//! Lenses that are placed at an angle as a whole: the layout is turned back, so that rows of their lattice are along x.

use std::f64::consts::TAU;

use super::lattices::{Cluster, SHARE_OF_SITES};
use super::rounded::ROOM;
use crate::circle::circle_of;
use crate::shape::grid_step;
use crate::{
    CORNER_STEPS, Layout, LayoutCell, Outline, Point, Rect, Result, Selection, Shape, Text, Transform, Visitor,
    simplified, tilted_rectangle_of,
};
use metalith_core::Progress;
use metalith_pillars::LatticeKind;

/// Points of a closed outline of four corners.
const CLOSED: usize = 5;
/// What arithmetic on places adds to bounds that corners may reach (database units).
const SLIVER: f64 = 1e-3;
/// Steps of the lattice on either side of the middle that the first fit takes in.
const FIRST_REACH: f64 = 12.0;
/// Share of a step by which a place may be off in a fit.
const NEAR: f64 = 0.25;

/// Hand a layout to a visitor, turned back by an angle (rad) about the origin; whether corners were rounded by that, as they are where
/// shapes are not placed at this angle but drawn so.
///
/// # Errors
/// As [`Layout::visit`].
pub(super) fn visit_turned<V: Visitor>(
    layout: &Layout,
    selection: &Selection,
    turn: Option<f64>,
    visitor: &mut V,
    progress: &dyn Progress,
) -> Result<bool> {
    let Some(turn) = turn else {
        return layout.visit(selection, visitor, progress).map(|()| false);
    };
    let (sin, cos) = turn.sin_cos();
    let back = Transform::General {
        matrix: [cos, sin, -sin, cos],
        dx: 0.0,
        dy: 0.0,
    };
    let mut turned = Turned {
        visitor,
        back,
        direction: [cos, sin],
        unit_nm: layout.unit_nm(),
        is_rounded: false,
        placed: Vec::new(),
        points: Vec::new(),
    };
    layout.visit(selection, &mut turned, progress)?;
    Ok(turned.is_rounded)
}

/// Visitor of a layout that is turned back: shapes come one by one, as they are placed.
struct Turned<'v, V> {
    visitor: &'v mut V,
    back: Transform,
    /// Cosine and sine of the angle.
    direction: [f64; 2],
    unit_nm: f64,
    /// True if a shape was at another angle.
    is_rounded: bool,
    placed: Vec<Point>,
    points: Vec<Point>,
}

impl<V> Turned<'_, V> {
    /// A placement, turned back: exact where only quarter turns are left.
    fn back(&self, placement: &Transform) -> Option<Transform> {
        self.back.after(placement).map(Transform::squared)
    }
}

impl<V: Visitor> Visitor for Turned<'_, V> {
    fn cell(&mut self, cell: &LayoutCell, _placements: &[Transform]) -> metalith_core::Result<()> {
        self.visitor.cell(cell, &[Transform::IDENTITY])
    }

    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        for placement in placements {
            let Some(turned) = self.back(placement) else {
                continue;
            };
            self.points.clear();
            self.points.extend(shape.outline.points().map(|p| turned.apply(p)));
            let (rect, circle) = if turned.is_square() {
                let there = |r: Option<Rect>| turned.apply_rect(&r?);
                (there(shape.rect), there(shape.circle))
            } else {
                self.is_rounded = true;
                self.placed.clear();
                self.placed.extend(shape.outline.points().map(|p| placement.apply(p)));
                let rect = self.nearly_upright();
                (rect, if rect.is_none() { self.circle() } else { None })
            };
            let turned = Shape {
                outline: Outline::new(&self.points),
                rect,
                circle,
                ..*shape
            };
            self.visitor.shape(&turned, &[Transform::IDENTITY])?;
        }
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        for placement in placements {
            let Some(placement) = self.back(placement) else {
                continue;
            };
            let at = placement.apply(text.at);
            self.visitor.text(&Text { at, ..*text }, &[Transform::IDENTITY])?;
        }
        Ok(())
    }
}

/// Methods that see a shape as it is drawn, with corners that were rounded once.
impl<V> Turned<'_, V> {
    /// A place, turned back.
    fn turned(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [cos, sin] = self.direction;
        [cos * x + sin * y, cos * y - sin * x]
    }

    /// The upright rectangle that an outline becomes, to the rounding of its corners, with edges at the mean of both corners; a square
    /// where its edges are equal to their rounding.
    fn nearly_upright(&self) -> Option<Rect> {
        tilted_rectangle_of(&self.placed, self.unit_nm)?;
        let (simple, points) = (simplified(&self.placed), &self.placed);
        let points = if points.len() == CLOSED { points } else { &simple };
        let &[a, b, c, d, _] = points.as_slice() else {
            return None;
        };
        let corners = [a, b, c, d].map(|p| self.turned([p.x as f64, p.y as f64]));
        let [cos, sin] = self.direction.map(f64::abs);
        let rounding = CORNER_STEPS * grid_step(self.unit_nm);
        let ends = |axis: usize| {
            let mut v = corners.map(|c| c[axis]);
            v.sort_unstable_by(f64::total_cmp);
            // Either of two corners is off by both of its roundings.
            let near = (v[1] - v[0]).max(v[3] - v[2]) <= 2.0 * rounding * (cos + sin) + SLIVER;
            near.then(|| [(v[0] + v[1]) / 2.0, (v[2] + v[3]) / 2.0])
        };
        let [x, y] = [ends(0)?, ends(1)?];
        let [width, height] = [x[1] - x[0], y[1] - y[0]];
        // Each corner changes the difference of the edges by this part of its rounding along either axis.
        let is_square = (width - height).abs() <= 4.0 * rounding * cos.max(sin) + SLIVER;
        let edge = |[low, high]: [f64; 2]| {
            let width = if is_square { 0.5 * (width + height) } else { high - low }.round();
            let first = ((low + high - width) / 2.0).round() as i64;
            (first, first + width as i64)
        };
        let ((x0, x1), (y0, y1)) = (edge(x), edge(y));
        (x0 < x1 && y0 < y1).then_some(Rect { x0, y0, x1, y1 })
    }

    /// The square around the circle that an outline stands for, turned back about the origin.
    fn circle(&self) -> Option<Rect> {
        let drawn = circle_of(&self.placed, self.unit_nm)?;
        let middle = self.turned([drawn.x0 + drawn.x1, drawn.y0 + drawn.y1].map(|v| v as f64 / 2.0));
        let width = drawn.width();
        let [x0, y0] = middle.map(|v| (v - width as f64 / 2.0).round() as i64);
        Some(Rect {
            x0,
            y0,
            x1: x0 + width,
            y1: y0 + width,
        })
    }
}

/// A lattice at any angle: places are `origin + step w`, as complex numbers, with w on the lattice of step 1.
#[derive(Clone, Copy)]
struct Oblique {
    kind: LatticeKind,
    origin: [f64; 2],
    step: [f64; 2],
}

fn times([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    [a * c - b * d, a * d + b * c]
}

fn conjugate([a, b]: [f64; 2]) -> [f64; 2] {
    [a, -b]
}

impl Oblique {
    /// The lattice place of step 1 nearest to a place, and the distance from it.
    fn nearest(&self, place: [f64; 2]) -> ([f64; 2], [f64; 2]) {
        let off = [place[0] - self.origin[0], place[1] - self.origin[1]];
        let length2 = self.step[0].powi(2) + self.step[1].powi(2);
        let [u, v] = times(off, conjugate(self.step)).map(|x| x / length2);
        let w = match self.kind {
            LatticeKind::Square => [u.round(), v.round()],
            LatticeKind::Hexagonal => {
                let row = (v / 0.75f64.sqrt()).round();
                [(u - row / 2.0).round() + row / 2.0, row * 0.75f64.sqrt()]
            }
        };
        let at = times(self.step, w);
        (w, [off[0] - at[0], off[1] - at[1]])
    }

    fn length(&self) -> f64 {
        self.step[0].hypot(self.step[1])
    }

    /// The lattice nearest to places, numbered by this one, and how many of them are on it.
    fn fitted(&self, places: &[[f64; 2]]) -> Option<(Self, usize)> {
        let near = |[x, y]: [f64; 2]| x.hypot(y) <= NEAR * self.length();
        let (mut n, mut sw, mut sww, mut so, mut swo) = (0.0, [0.0; 2], 0.0, [0.0; 2], [0.0; 2]);
        for place in places {
            let (w, off) = self.nearest(*place);
            if !near(off) {
                continue;
            }
            n += 1.0;
            let product = times(conjugate(w), off);
            for k in 0..2 {
                sw[k] += w[k];
                so[k] += off[k];
                swo[k] += product[k];
            }
            sww += w[0].powi(2) + w[1].powi(2);
        }
        let det = n * sww - sw[0].powi(2) - sw[1].powi(2);
        if det <= 0.0 {
            return None;
        }
        let mixed = times(conjugate(sw), so);
        let turned = [0, 1].map(|k| (n * swo[k] - mixed[k]) / det);
        let moved = times(turned, sw);
        let fitted = Self {
            origin: [0, 1].map(|k| self.origin[k] + (so[k] - moved[k]) / n),
            step: [0, 1].map(|k| self.step[k] + turned[k]),
            ..*self
        };
        Some((fitted, n as usize))
    }
}

impl Cluster<'_> {
    /// Angle by which most centres are on a lattice that is turned (rad), if they are and it moves any of them, and its kind.
    pub(super) fn turn(&self) -> Option<(f64, LatticeKind)> {
        let tiles = self.sampled();
        let pairs: Vec<[f64; 2]> = tiles.iter().flat_map(|tile| nearest_pairs(tile)).collect();
        let length = typical_distance(&tiles)?;
        let near = |pair: &&[f64; 2]| (pair[0].hypot(pair[1]) - length).abs() <= 4.0 * self.unit_halves;
        let all: Vec<[f64; 2]> = tiles.iter().flatten().map(|p| [p.x as f64, p.y as f64]).collect();
        let bounds = self.bounds();
        let middle = [
            (bounds.x0 + bounds.x1) as f64 / 2.0,
            (bounds.y0 + bounds.y1) as f64 / 2.0,
        ];
        let away = |p: &[f64; 2]| (p[0] - middle[0]).hypot(p[1] - middle[1]);
        let mut places = all;
        places.sort_unstable_by(|a, b| away(a).total_cmp(&away(b)));
        let reach = away(places.last()?);
        let of_kind = |kind: LatticeKind| {
            let fold = if kind.is_square() { 4.0 } else { 6.0 };
            let sum = pairs.iter().filter(near).fold([0.0; 2], |[x, y], pair| {
                let (sin, cos) = (fold * pair[1].atan2(pair[0])).sin_cos();
                [x + cos, y + sin]
            });
            let angle = sum[1].atan2(sum[0]) / fold;
            let mut lattice = Oblique {
                kind,
                origin: *places.first()?,
                step: [length * angle.cos(), length * angle.sin()],
            };
            let mut within = FIRST_REACH * length;
            loop {
                let count = places.partition_point(|p| away(p) <= within);
                let (next, on) = lattice.fitted(&places[..count])?;
                lattice = next;
                if within > reach {
                    let angle = lattice.step[1].atan2(lattice.step[0]);
                    let folded = angle - (angle * fold / TAU).round() * TAU / fold;
                    let enough = SHARE_OF_SITES as usize * on >= (SHARE_OF_SITES as usize - 1) * places.len();
                    return enough.then_some((on, folded, kind));
                }
                within *= 2.0;
            }
        };
        let kinds = [LatticeKind::Square, LatticeKind::Hexagonal];
        let (_, angle, kind) = kinds.into_iter().filter_map(of_kind).max_by_key(|(on, ..)| *on)?;
        (angle.abs() * reach > 2.0 * self.unit_halves).then(|| (roundest(angle, ROOM * self.unit_halves / reach), kind))
    }
}

/// The roundest angle in degrees within some room about an angle: a lens that is placed at it is turned back without rounding (rad).
fn roundest(angle: f64, room: f64) -> f64 {
    let rounded = |per_degree: &f64| ((angle.to_degrees() * per_degree).round() / per_degree).to_radians();
    let nearest = [1.0, 2.0, 10.0, 100.0, 1e3].iter().map(rounded);
    nearest
        .into_iter()
        .find(|round| (round - angle).abs() <= room)
        .unwrap_or(angle)
}

/// Distance of neighbouring places (half steps): of those one in ten from the nearest pair, since samples need not be neighbours.
pub(super) fn typical_distance(tiles: &[Vec<Point>]) -> Option<f64> {
    let pairs = tiles.iter().flat_map(|tile| nearest_pairs(tile));
    let mut lengths: Vec<f64> = pairs.map(|[x, y]| x.hypot(y)).collect();
    let near = lengths.len() / 10;
    (near < lengths.len()).then(|| *lengths.select_nth_unstable_by(near, f64::total_cmp).1)
}

/// Ways from each place to the nearest other one.
fn nearest_pairs(tile: &[Point]) -> Vec<[f64; 2]> {
    let way = |a: &Point, b: &Point| [(b.x - a.x) as f64, (b.y - a.y) as f64];
    let nearest = |a: &Point| {
        let others = tile.iter().filter(|b| *b != a).map(|b| way(a, b));
        others.min_by(|a, b| a[0].hypot(a[1]).total_cmp(&b[0].hypot(b[1])))
    };
    tile.iter().filter_map(nearest).collect()
}
