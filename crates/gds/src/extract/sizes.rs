//! Which rectangles are the pillars of a layout from anywhere.

use std::collections::BTreeMap;

use super::sites::Scale;
use crate::memo::OutlineMemo;
use crate::{Shape, tilted_rectangle_of};
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
    /// By the shorter and the longer edge, to a nanometre: how many, and the sums of both (nm).
    counted: BTreeMap<(i64, i64), (u64, [f64; 2])>,
    /// Rectangles, counted or not.
    pub rectangles: u64,
    known: OutlineMemo<Option<[f64; 2]>>,
}

/// Rectangles of one size.
pub(super) struct AlikeRectangles {
    pub pillars: Rectangles,
    /// How many there are.
    pub count: u64,
}

impl Sizes {
    /// The shorter and the longer edge of the rectangle that a shape is, as drawn (nm), if it is one and no square.
    pub fn edges(&mut self, shape: &Shape<'_>, scale: Scale) -> Option<[f64; 2]> {
        let unequal = shape.rect.is_none_or(|r| r.width() != r.height());
        if !unequal || shape.circle.is_some() || shape.outline.len() != 5 {
            return None;
        }
        // Edges are as long wherever the outline stands.
        let points = shape.outline.points;
        self.known.of(points, 0, || {
            let tilted = tilted_rectangle_of(points, scale.nm(1.0)).filter(|r| !r.is_square())?;
            Some(tilted.edges.map(|e| scale.nm(e)))
        })
    }

    /// So many copies of a rectangle with these edges (nm).
    pub fn add(&mut self, edges: [f64; 2], copies: u64) {
        self.rectangles += copies;
        let key = (edges[0].round() as i64, edges[1].round() as i64);
        if self.counted.len() < MOST_SIZES || self.counted.contains_key(&key) {
            let (count, sums) = self.counted.entry(key).or_default();
            *count += copies;
            (0..2).for_each(|k| sums[k] += edges[k] * copies as f64);
        }
    }

    /// The size that most have, if it is one of pillars no wider than this (nm).
    pub fn pillars(&self, widest_nm: i64) -> Option<AlikeRectangles> {
        let (&(w, l), _) = self
            .counted
            .iter()
            .max_by_key(|(key, (count, _))| (*count, std::cmp::Reverse(**key)))?;
        let alike = |(a, b): &(i64, i64)| (a - w).abs() <= ALIKE_NM && (b - l).abs() <= ALIKE_NM;
        let near = self.counted.iter().filter(|(key, _)| alike(key));
        let (count, sums) = near.fold((0, [0.0; 2]), |(n, [a, b]), (_, (count, own))| {
            (n + count, [a + own[0], b + own[1]])
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
