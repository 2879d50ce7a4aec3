//! Circles, which differ by their diameter, and the polygon that stands for one.

use std::f64::consts::{FRAC_PI_4, PI};

use crate::kind::{OutlineForm, PillarId, PillarKind};

/// Fewest and most steps of an eighth of the circle.
const STEPS: [f64; 2] = [2.0, 512.0];

/// Largest distance between a circle and its polygon where nothing else is said: half a unit of the grid.
pub const CHORD_ERROR: f64 = 0.5;

/// Corners of the polygon in a circle about the origin, on the grid of whole units, counter-clockwise from the x axis.
///
/// All corners are on the circle to within their rounding, chords are at most `chord_error` and that rounding from it. The
/// polygon reaches half the diameter, which is even, along both axes, turns at each of its corners, and has all eight symmetries
/// of the square.
pub fn circle_corners(diameter: u32, chord_error: f64) -> Vec<(i64, i64)> {
    let radius = f64::from(diameter) / 2.0;
    // The sagitta of a chord over an angle a is r (1 - cos(a / 2)).
    let half_angle = (1.0 - (chord_error / radius.max(chord_error)).min(1.0)).acos();
    let steps = (PI / half_angle.max(f64::MIN_POSITIVE) / 8.0)
        .ceil()
        .clamp(STEPS[0], STEPS[1]) as usize;
    let corner = |k: usize| {
        let (sin, cos) = (FRAC_PI_4 * k as f64 / steps as f64).sin_cos();
        // On the diagonal both are the same number, whatever the rounding of sine and cosine.
        let x = (radius * cos).round() as i64;
        (x, if k == steps { x } else { (radius * sin).round() as i64 })
    };
    let eighth: Vec<(i64, i64)> = (0..=steps).map(corner).collect();
    let quarter = eighth
        .iter()
        .copied()
        .chain(eighth[1..steps].iter().rev().map(|&(x, y)| (y, x)));
    let quarter: Vec<(i64, i64)> = quarter.collect();
    let mut corners: Vec<(i64, i64)> = (0..4)
        .flat_map(|turn| {
            quarter.iter().map(move |&(x, y)| match turn {
                0 => (x, y),
                1 => (-y, x),
                2 => (-x, -y),
                _ => (y, -x),
            })
        })
        .collect();
    corners.dedup();
    without_straight(&corners)
}

/// The corners at which a closed outline turns.
fn without_straight(corners: &[(i64, i64)]) -> Vec<(i64, i64)> {
    let n = corners.len();
    let turns = |k: &usize| {
        let ((ax, ay), (bx, by), (cx, cy)) = (corners[(k + n - 1) % n], corners[*k], corners[(k + 1) % n]);
        (bx - ax) * (cy - by) != (by - ay) * (cx - bx)
    };
    (0..n).filter(turns).map(|k| corners[k]).collect()
}

/// Circles; the width is the diameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Circle;

impl Circle {
    /// Distance of two circles with these diameters whose centres are (dx, dy) apart, all in one unit; negative where they overlap.
    pub fn gap_of_widths(widths: [f64; 2], [dx, dy]: [f64; 2]) -> f64 {
        dx.hypot(dy) - 0.5 * (widths[0] + widths[1])
    }
}

impl PillarKind for Circle {
    fn name(&self) -> &'static str {
        "circle"
    }

    fn plural(&self) -> &'static str {
        "circles"
    }

    #[inline]
    fn outline(&self) -> OutlineForm {
        OutlineForm::Circle
    }

    fn corners(&self, PillarId(width): PillarId, chord_error_nm: f64) -> Vec<(i64, i64)> {
        circle_corners(width.into(), chord_error_nm)
    }

    fn area_share(&self) -> f64 {
        FRAC_PI_4
    }

    #[inline]
    fn gap(&self, pair: [PillarId; 2], apart: [f64; 2]) -> f64 {
        Self::gap_of_widths(pair.map(|PillarId(width)| f64::from(width)), apart)
    }

    fn solver_revision(&self) -> u32 {
        2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_on_the_circle_and_chords_near_it() {
        // Half the diagonal of a step of the grid.
        const ROUNDED: f64 = 0.7072;
        for (diameter, chord_error) in [(100, 0.5), (254, 0.25), (4000, 0.5), (10, 0.5)] {
            let corners = circle_corners(diameter, chord_error);
            let radius = f64::from(diameter) / 2.0;
            let n = corners.len();
            for k in 0..n {
                let ((x0, y0), (x1, y1)) = (corners[k], corners[(k + 1) % n]);
                let middle = ((x0 + x1) as f64 / 2.0).hypot((y0 + y1) as f64 / 2.0);
                let corner = (x0 as f64).hypot(y0 as f64);
                assert!((corner - radius).abs() < ROUNDED, "{diameter}: corner at {corner}");
                assert!(radius - middle < chord_error + ROUNDED, "{diameter}: chord at {middle}");
                let (x2, y2) = corners[(k + 2) % n];
                assert!(
                    (x1 - x0) * (y2 - y1) - (y1 - y0) * (x2 - x1) > 0,
                    "{diameter}: a left turn at each corner"
                );
            }
            for (x, y) in &corners {
                for other in [(-x, *y), (*x, -y), (*y, *x)] {
                    assert!(corners.contains(&other), "{diameter}: {other:?}");
                }
            }
            assert_eq!(corners.iter().map(|c| c.0).max(), Some(i64::from(diameter) / 2));
        }
    }
}
