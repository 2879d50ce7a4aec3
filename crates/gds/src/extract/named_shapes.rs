//! Shapes that are no pillars, and have a name.

use std::collections::HashSet;

use super::unrecognised_shapes::Why;
use crate::{Point, simplified};

/// Corners of a cross.
const CROSS: usize = 12;
/// Corners at which an outline is looked at, at most: circles with a hole have some hundred.
const MOST_CORNERS: usize = 1024;

/// The name of an outline that is no pillar.
pub(super) fn name_of(points: &[Point]) -> Why {
    if points.len() > MOST_CORNERS {
        return Why::OddShape;
    }
    if has_hole(points) {
        return Why::Ring;
    }
    if is_cross(&simplified(points)) {
        return Why::Cross;
    }
    Why::OddShape
}

/// True if an outline goes along a line and back: formats without holes draw one that way.
fn has_hole(points: &[Point]) -> bool {
    let mut sides = HashSet::new();
    let mut distinct = points.to_vec();
    distinct.dedup();
    distinct.windows(2).any(|side| {
        sides.insert((side[0], side[1]));
        sides.contains(&(side[1], side[0]))
    })
}

/// True if every third of twelve corners turns the other way.
fn is_cross(closed: &[Point]) -> bool {
    if closed.len() != CROSS + 1 {
        return false;
    }
    let corner = |k: usize| closed[k % CROSS];
    let turn = |k: usize| {
        let (a, b, c) = (corner(k), corner(k + 1), corner(k + 2));
        let (ux, uy) = (i128::from(b.x - a.x), i128::from(b.y - a.y));
        let (vx, vy) = (i128::from(c.x - b.x), i128::from(c.y - b.y));
        (ux * vy - uy * vx).signum()
    };
    let turns: Vec<i128> = (0..CROSS).map(turn).collect();
    let is_inner = |first: usize| {
        (0..CROSS).all(|k| {
            turns[k]
                == if k % 3 == first {
                    -turns[first + 1]
                } else {
                    turns[first + 1]
                }
        })
    };
    turns[0] != 0 && (0..3).any(is_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn closed(corners: &[(i64, i64)]) -> Vec<Point> {
        let first = corners.iter().take(1);
        corners.iter().chain(first).map(|&(x, y)| Point::new(x, y)).collect()
    }

    #[test]
    fn crosses_and_rings_have_their_names() {
        let arm = [(-20, -60), (20, -60), (20, -20), (60, -20), (60, 20), (20, 20)];
        let cross: Vec<_> = arm.iter().copied().chain(arm.iter().map(|(x, y)| (-x, -y))).collect();
        assert_eq!(name_of(&closed(&cross)), Why::Cross);
        let back: Vec<_> = cross.iter().rev().copied().collect();
        assert_eq!(name_of(&closed(&back)), Why::Cross);
        let stairs: Vec<_> = (0..6).flat_map(|k| [(10 * k, 10 * k), (10 * k + 10, 10 * k)]).collect();
        assert_eq!(name_of(&closed(&stairs)), Why::OddShape);
        let outer = [(0, 0), (100, 0), (100, 100), (0, 100), (0, 0)];
        let inner = [(20, 20), (20, 80), (80, 80), (80, 20), (20, 20)];
        let ring: Vec<_> = outer.into_iter().chain(inner).collect();
        assert_eq!(name_of(&closed(&ring)), Why::Ring);
        assert_eq!(name_of(&closed(&outer[..3])), Why::OddShape);
    }
}
