//! Which rectangles are the pillars of a layout from anywhere.

use std::collections::BTreeMap;

use super::sites::Scale;
use crate::memo::OutlineMemo;
use crate::{Point, Rect, Shape, tilted_rectangle_of};
use metalith_core::Rectangles;

/// Sizes that are told apart: a layout has one, and what its corners make of it.
const MOST_SIZES: usize = 1 << 12;

/// Edges that differ by less are of one size (nm): what rounding of corners to the grid makes of it.
const ALIKE_NM: i64 = 2;

/// Rotations in half a turn by which pillars of a layout from anywhere are told: by a degree, beside which the rounding of
/// corners is little.
const STEPS: u16 = 180;

/// Edges of the rectangles of a layout, counted.
#[derive(Default)]
pub(super) struct Sizes {
    /// By the shorter and the longer edge, to a nanometre: where in `counted` they are.
    numbers: BTreeMap<(i64, i64), usize>,
    counted: Vec<Size>,
    /// Rectangles, counted or not.
    pub rectangles: u64,
    /// What outlines are, if they are rectangles and no squares.
    known: OutlineMemo<Option<SeenRectangle>>,
}

/// Rectangles with the same edges, to a nanometre.
#[derive(Default)]
struct Size {
    count: u64,
    /// Of both edges (nm).
    sums: [f64; 2],
}

/// A rectangle, wherever it stands.
#[derive(Clone, Copy)]
struct SeenRectangle {
    /// The shorter and the longer edge, as drawn (nm).
    edges: [f64; 2],
    /// Where they are counted; nowhere if there are too many sizes.
    size: Option<usize>,
    /// The box around it, from its first corner.
    around: Rect,
}

/// Rectangles of one size.
pub(super) struct AlikeRectangles {
    pub pillars: Rectangles,
    /// How many there are.
    pub count: u64,
}

impl Sizes {
    /// Count so many copies of a shape, each so many times as large as in its cell, if it is a rectangle and no square: the box
    /// around it, in its cell.
    pub fn count(&mut self, shape: &Shape<'_>, copies: u64, magnification: f64, scale: Scale) -> Option<Rect> {
        let unequal = shape.rect.is_none_or(|r| r.width() != r.height());
        if !unequal || shape.circle.is_some() || shape.outline.len() != 5 {
            return None;
        }
        let points = shape.outline.points;
        let (numbers, counted) = (&mut self.numbers, &mut self.counted);
        let mut see = || {
            let tilted = tilted_rectangle_of(points, scale.nm(1.0)).filter(|r| !r.is_square())?;
            let edges = tilted.edges.map(|e| scale.nm(e * magnification));
            let key = (edges[0].round() as i64, edges[1].round() as i64);
            if counted.len() < MOST_SIZES && !numbers.contains_key(&key) {
                numbers.insert(key, counted.len());
                counted.push(Size::default());
            }
            Some(SeenRectangle {
                edges,
                size: numbers.get(&key).copied(),
                around: tilted.around.moved(Point::new(-points[0].x, -points[0].y)),
            })
        };
        // Edges are as long wherever the outline stands.
        let seen = match magnification {
            1.0 => self.known.of(points, 0, see),
            _ => see(),
        }?;
        self.rectangles += copies;
        if let Some(size) = seen.size.map(|k| &mut self.counted[k]) {
            size.count += copies;
            (0..2).for_each(|k| size.sums[k] += seen.edges[k] * copies as f64);
        }
        shape.outline.at.apply_rect(&seen.around.moved(points[0]))
    }

    /// The size that most have, if it is one of pillars no wider than this (nm).
    pub fn pillars(&self, widest_nm: i64) -> Option<AlikeRectangles> {
        let sizes = || self.numbers.iter().map(|(key, k)| (*key, &self.counted[*k]));
        let ((w, l), _) = sizes().max_by_key(|(key, size)| (size.count, std::cmp::Reverse(*key)))?;
        let near = sizes().filter(|((a, b), _)| (a - w).abs() <= ALIKE_NM && (b - l).abs() <= ALIKE_NM);
        let (count, sums) = near.fold((0, [0.0; 2]), |(n, [a, b]), (_, size)| {
            (n + size.count, [a + size.sums[0], b + size.sums[1]])
        });
        let [width, length] = sums.map(|sum| (sum / count as f64).round() as i64);
        let pillars = Rectangles {
            width_nm: u16::try_from(width).ok()?,
            length_nm: u16::try_from(length).ok()?,
            steps: STEPS,
        };
        (width < length && length <= widest_nm).then_some(AlikeRectangles { pillars, count })
    }
}
