//! Choice of the rectangles that are the pillars of any layout.

use std::collections::{BTreeMap, BTreeSet};

use super::sites::Scale;
use crate::outline_memo::{BoxMemo, OutlineMemo};
use crate::{Point, Rect, Shape, Transform, tilted_rectangle_of};
use metalith_pillars::{PillarShape, RotatedRectangles, UprightRectangles};

/// Sizes that are distinguished: a layout has one, and what its corners make of it.
const MOST_SIZES: usize = 1 << 12;

/// Edges that differ by less are of one size (nm): what rounding of corners to the grid makes of it.
const ALIKE_NM: i64 = 2;

/// Rotations in half a turn by which pillars of a layout from anywhere are told: by a degree, beside which the rounding of
/// corners is little.
const STEPS: u16 = 180;

/// Rotations in half a turn where those are not all: by a tenth of a degree, which moves no corner of a pillar of 600 nm by more than
/// its rounding.
const FINE_STEPS: u16 = 1800;

/// Widths of squares that are counted: those beyond are no pillars (nm).
const MOST_WIDTHS: usize = 1 << 15;

/// Share of upright rectangles whose sizes decide the lengths that edges may have: what is left may be marks and numerals. Rarer
/// pillars whose edges are between those are recognised all the same.
const PILLARS: f64 = 0.9999;

/// Edges of the rectangles of a layout, counted.
#[derive(Default)]
pub(super) struct Sizes {
    /// Indices in `counted`, by the shorter and the longer edge, to a nanometre.
    numbers: BTreeMap<(i64, i64), usize>,
    counted: Vec<Size>,
    /// Rectangles, counted or not.
    pub rectangles: u64,
    /// Number of them whose edges are not along the axes.
    tilted: u64,
    /// Squares by their width (nm).
    squares: Vec<u64>,
    /// Memory of outlines that are rectangles and no squares, and of upright boxes.
    known: OutlineMemo<Option<SeenRectangle>>,
    boxes: BoxMemo<Option<SeenRectangle>>,
}

/// Rectangles with the same edges, to a nanometre.
#[derive(Default)]
struct Size {
    count: u64,
    /// Sums of both edges (nm).
    sums: [f64; 2],
    /// Number of those that are rotated by none of [`STEPS`].
    between: u64,
}

/// A rectangle, wherever it stands.
#[derive(Clone, Copy)]
struct SeenRectangle {
    /// The shorter and the longer edge, as drawn (nm).
    edges: [f64; 2],
    /// Index of its size in the counts; `None` if there are too many sizes.
    size: Option<usize>,
    /// The box around it, from its first corner.
    around: Rect,
    /// True if it is rotated by one of [`STEPS`], to the rounding of its corners.
    by_steps: bool,
}

/// Rectangles that are pillars.
pub(super) struct FoundRectangles {
    pub shape: PillarShape,
    /// True if squares are such pillars too.
    pub with_squares: bool,
    /// Number of them that are no squares.
    pub count: u64,
}

impl Sizes {
    /// Count so many copies of a shape, each so many times as large as in its cell and turned by quarters or not, if it is a
    /// rectangle and no square: the box around it, in its cell.
    pub(crate) fn count(&mut self, shape: &Shape<'_>, copies: u64, placed: &Transform, scale: Scale) -> Option<Rect> {
        let magnification = placed.magnification();
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
                by_steps: tilted.is_rotated_in_steps(STEPS, scale.nm(1.0)),
                edges,
                size: numbers.get(&key).copied(),
                around: tilted.around.moved(Point::new(-points[0].x, -points[0].y)),
            })
        };
        // Edges are as long wherever the outline stands, and rotations of one that is turned by quarters in steps as before.
        let seen = match (magnification, &shape.rect) {
            (1.0, Some(rect)) => self.boxes.of(rect, see),
            (1.0, None) => self.known.of(shape.outline, 0, see),
            _ => see(),
        }?;
        self.rectangles += copies;
        if shape.rect.is_none() || !placed.is_square() {
            self.tilted += copies;
        }
        if let Some(size) = seen.size.map(|k| &mut self.counted[k]) {
            size.count += copies;
            let by_steps = if placed.is_square() {
                seen.by_steps
            } else {
                let corners = shape.outline.placed(placed);
                let tilted = tilted_rectangle_of(&corners, scale.nm(1.0));
                tilted.is_some_and(|t| t.is_rotated_in_steps(STEPS, scale.nm(1.0)))
            };
            size.between += if by_steps { 0 } else { copies };
            (0..2).for_each(|k| size.sums[k] += seen.edges[k] * copies as f64);
        }
        match shape.rect {
            Some(rect) => Some(rect),
            None => shape.outline.at.apply_rect(&seen.around.moved(points[0])),
        }
    }

    /// Rectangles found, if they are pillars no longer than this (nm): upright ones of several sizes, or rectangles of
    /// the size that most have, by their rotation. `are_rounded` if they were turned back, which rounds upright ones.
    pub(crate) fn pillars(&self, longest_nm: i64, are_rounded: bool) -> Option<FoundRectangles> {
        self.upright(longest_nm, are_rounded).or_else(|| self.alike(longest_nm))
    }

    /// True if all rectangles are these pillars, and, where squares are too, all of so many squares.
    pub(crate) fn all_are(&self, found: &FoundRectangles, squares: u64) -> bool {
        let Some(pillars) = found.shape.upright() else {
            return found.count == self.rectangles;
        };
        let lengths: BTreeSet<i64> = pillars.lengths_nm().map(i64::from).collect();
        let sizes = self
            .numbers
            .iter()
            .filter(|((a, b), _)| lengths.contains(a) && lengths.contains(b));
        let squared = lengths.iter().filter_map(|nm| self.squares.get(*nm as usize));
        self.tilted == 0
            && sizes.map(|(_, k)| self.counted[*k].count).sum::<u64>() == self.rectangles
            && squared.sum::<u64>() == squares
    }

    /// Upright rectangles of more than one size, with edges in equal steps; squares among them are such too.
    fn upright(&self, longest_nm: i64, are_rounded: bool) -> Option<FoundRectangles> {
        let few = ((1.0 - PILLARS) * self.rectangles as f64).max(1.0);
        if self.tilted as f64 > few {
            return None;
        }
        let unequal = self.numbers.iter().map(|(key, k)| (*key, self.counted[*k].count));
        let mut unequal: Vec<_> = unequal.filter(|((_, long), _)| *long <= longest_nm).collect();
        unequal.sort_by_key(|(key, count)| (std::cmp::Reverse(*count), *key));
        let enough = self.rectangles as f64 - few;
        let mut count = 0;
        let most = unequal.iter().take_while(|(_, n)| {
            let is_needed = (count as f64) < enough;
            count += n;
            is_needed
        });
        let most: Vec<_> = most.copied().collect();
        let (w, l) = most.first()?.0;
        let alike = |(a, b): (i64, i64)| (a - w).abs() <= ALIKE_NM && (b - l).abs() <= ALIKE_NM;
        if most.iter().all(|(key, _)| alike(*key)) {
            return None;
        }
        let squares = self.squares.iter().enumerate().filter(|(_, n)| **n as f64 > few);
        let squares = squares.map(|(nm, n)| (nm as i64, *n));
        let edges = most.iter().flat_map(|((a, b), n)| [(*a, *n), (*b, *n)]);
        let counted: Option<Vec<(u16, u64)>> = edges
            .chain(squares)
            .map(|(nm, n)| Some((u16::try_from(nm).ok()?, n)))
            .collect();
        let counted = counted?;
        let lengths = if are_rounded {
            rounded_lengths(counted)
        } else {
            counted.into_iter().map(|(nm, _)| nm).collect()
        };
        Some(FoundRectangles {
            shape: UprightRectangles::of_lengths(lengths.into_iter())?.into(),
            with_squares: true,
            count: most.iter().map(|(_, n)| n).sum(),
        })
    }

    /// Count so many squares of a width (nm).
    #[inline]
    pub(crate) fn count_squares(&mut self, width_nm: i64, copies: u64) {
        let Ok(width) = usize::try_from(width_nm) else { return };
        if width < MOST_WIDTHS {
            if width >= self.squares.len() {
                self.squares.resize(width + 1, 0);
            }
            self.squares[width] += copies;
        }
    }

    fn alike(&self, longest_nm: i64) -> Option<FoundRectangles> {
        let sizes = || self.numbers.iter().map(|(key, k)| (*key, &self.counted[*k]));
        let ((w, l), _) = sizes().max_by_key(|(key, size)| (size.count, std::cmp::Reverse(*key)))?;
        let near = sizes().filter(|((a, b), _)| (a - w).abs() <= ALIKE_NM && (b - l).abs() <= ALIKE_NM);
        let (count, between, sums) = near.fold((0, 0, [0.0; 2]), |(n, between, [a, b]), (_, size)| {
            (
                n + size.count,
                between + size.between,
                [a + size.sums[0], b + size.sums[1]],
            )
        });
        let [width, length] = sums.map(|sum| (sum / count as f64).round() as i64);
        let pillars = RotatedRectangles {
            width_nm: u16::try_from(width).ok()?,
            length_nm: u16::try_from(length).ok()?,
            steps: if between == 0 { STEPS } else { FINE_STEPS },
        };
        (width < length && length <= longest_nm).then_some(FoundRectangles {
            shape: pillars.into(),
            with_squares: false,
            count,
        })
    }
}

/// Lengths of edges that rounding has made several of, each with its count: their mean to an even number, for those that differ by less
/// than what rounding makes of them.
fn rounded_lengths(mut counted: Vec<(u16, u64)>) -> Vec<u16> {
    counted.sort_unstable();
    let near = |a: &(u16, u64), b: &(u16, u64)| i64::from(b.0 - a.0) <= ALIKE_NM;
    let mean = |group: &[(u16, u64)]| {
        let (sum, count) = group.iter().fold((0.0, 0.0), |(sum, count), (nm, n)| {
            (sum + f64::from(*nm) * *n as f64, count + *n as f64)
        });
        (sum / count / 2.0).round() as u16 * 2
    };
    counted.chunk_by(near).map(mean).collect()
}
