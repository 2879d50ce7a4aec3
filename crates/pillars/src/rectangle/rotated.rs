//! Rectangular pillars of one size, which differ by their rotation.

use std::f64::consts::{PI, SQRT_2};

use serde::Serialize;

use crate::Circle;
use crate::kind::{OutlineForm, PillarId, PillarKind, PolarisationBasis, Quantity};

/// Rectangular pillars of one size on a layout. What tells one from another is its number, from 1 to `steps`: its rotation in
/// steps of half a turn over `steps`. Half a turn leaves a rectangle as it is, so the last number stands for no rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct RotatedRectangles {
    /// The shorter edge (nm), along the direction of the rotation.
    pub width_nm: u16,
    /// The longer edge (nm), across it.
    pub length_nm: u16,
    /// Rotations in half a turn.
    pub steps: u16,
}

impl RotatedRectangles {
    /// Rotation of a pillar, from x towards y (rad), from 0 up to pi.
    pub fn rotation(self, number: u16) -> f64 {
        let steps = self.steps.max(1);
        PI * f64::from(number % steps) / f64::from(steps)
    }

    /// The number of the rotation nearest to an angle (rad).
    pub fn number(self, rotation: f64) -> u16 {
        let steps = self.steps.max(1);
        let nearest = (rotation / PI * f64::from(steps)).round() as i64;
        match nearest.rem_euclid(i64::from(steps)) as u16 {
            0 => steps,
            number => number,
        }
    }

    /// Angle between neighbouring rotations (degrees).
    pub fn step_deg(self) -> f64 {
        180.0 / f64::from(self.steps.max(1))
    }

    /// Corners of a pillar about its middle, each on the nearest place of the grid of whole nanometres, counter-clockwise.
    pub fn on_grid(self, number: u16) -> [(i64, i64); 4] {
        let (sin, cos) = self.rotation(number).sin_cos();
        let (w, l) = (f64::from(self.width_nm) / 2.0, f64::from(self.length_nm) / 2.0);
        let corner = |x: f64, y: f64| {
            let on_grid = |v: f64| v.round() as i64;
            (on_grid(cos * x - sin * y), on_grid(sin * x + cos * y))
        };
        let (a, b) = (corner(-w, -l), corner(w, -l));
        [a, b, (-a.0, -a.1), (-b.0, -b.1)]
    }

    /// The longest diagonal there is, of pillars as drawn (nm): corners on the grid lie up to 0.7 nm farther out than those of the
    /// rectangle itself.
    pub fn longest_diagonal_nm(self) -> f64 {
        let corners = (1..=self.steps.max(1)).flat_map(|number| self.on_grid(number));
        let squared = corners.map(|(x, y)| x * x + y * y).max();
        2.0 * (squared.unwrap_or(0) as f64).sqrt()
    }

    /// Angle by which the rounding of its corners to the grid turns a pillar (rad): its axis as drawn less
    /// [`RotatedRectangles::rotation`].
    pub fn turned_by_grid(self, number: u16) -> f64 {
        let [a, b, c, _] = self.on_grid(number).map(|(x, y)| (x as f64, y as f64));
        let (along, across) = ((b.0 - a.0, b.1 - a.1), (c.0 - b.0, c.1 - b.1));
        // The axis of the second moments of a parallelogram; that of the longer edge is a quarter turn on.
        let sum = |f: fn((f64, f64)) -> f64| f(along) + f(across);
        let axis = 0.5 * (2.0 * sum(|e| e.0 * e.1)).atan2(sum(|e| e.0 * e.0 - e.1 * e.1)) - PI / 2.0;
        let apart = axis - self.rotation(number);
        apart - PI * (apart / PI).round()
    }

    /// Rotation of the rectangle nearest to four corners in the least squares, less the nearest of so many rotations in half a turn
    /// (rad). None if the corners are in no four quadrants of a rectangle about their middle.
    pub fn off_step(corners: &[[f64; 2]; 4], steps: u16) -> Option<f64> {
        let fitted = FittedRectangle::of(corners)?;
        let step = PI / f64::from(steps.max(1));
        Some(fitted.rotation - step * (fitted.rotation / step).round())
    }

    /// Rotation of a pillar as it is drawn, its corners on the grid (rad).
    pub fn drawn_rotation(self, number: u16) -> f64 {
        self.rotation(number) + self.turned_by_grid(number)
    }
}

impl PillarKind for RotatedRectangles {
    fn name(&self) -> &'static str {
        "rectangle"
    }

    fn plural(&self) -> &'static str {
        "rectangles"
    }

    fn description(&self) -> String {
        format!(
            "rectangles of {} x {} nm rotated in steps of {}°",
            self.width_nm,
            self.length_nm,
            rounded(self.step_deg())
        )
    }

    #[inline]
    fn outline(&self) -> OutlineForm {
        OutlineForm::Polygon
    }

    fn basis(&self) -> Option<PolarisationBasis> {
        Some(PolarisationBasis::Circular)
    }

    #[inline]
    fn has_width(&self) -> bool {
        false
    }

    fn has_one_size(&self) -> bool {
        true
    }

    fn last(&self) -> Option<PillarId> {
        Some(PillarId(self.steps))
    }

    fn edge_range_nm(&self) -> Option<(u16, u16)> {
        Some((self.width_nm, self.length_nm))
    }

    #[inline]
    fn edges_nm(&self, _id: PillarId) -> [u16; 2] {
        [self.width_nm, self.length_nm]
    }

    fn axis_edges_nm(&self, _id: PillarId) -> Vec<u16> {
        Vec::new()
    }

    fn four_corners(&self, PillarId(number): PillarId) -> Option<[(i64, i64); 4]> {
        Some(self.on_grid(number))
    }

    fn reach(&self, PillarId(number): PillarId) -> (i64, i64) {
        let [a, b, ..] = self.on_grid(number);
        (a.0.abs().max(b.0.abs()), a.1.abs().max(b.1.abs()))
    }

    fn half_nm(&self, id: PillarId) -> [f64; 2] {
        let (x, y) = self.reach(id);
        [x as f64, y as f64]
    }

    fn widest_nm(&self, _last: PillarId) -> f64 {
        self.longest_diagonal_nm()
    }

    #[inline]
    fn gap(&self, pair: [PillarId; 2], [dx, dy]: [f64; 2]) -> f64 {
        let a = self.on_grid(pair[0].0).map(|(x, y)| [x as f64, y as f64]);
        let b = self.on_grid(pair[1].0).map(|(x, y)| [x as f64 + dx, y as f64 + dy]);
        let separation = along_normals(&a, &b).max(along_normals(&b, &a));
        if separation <= 0.0 {
            return separation;
        }
        let nearest = |of: &[[f64; 2]; 4], to: &[[f64; 2]; 4]| {
            let from_sides = |p: &[f64; 2]| {
                (0..4)
                    .map(|k| from_side(*p, to[k], to[(k + 1) % 4]))
                    .fold(f64::INFINITY, f64::min)
            };
            of.iter().map(from_sides).fold(f64::INFINITY, f64::min)
        };
        nearest(&a, &b).min(nearest(&b, &a))
    }

    fn least_gap(&self, last: PillarId, apart: [f64; 2]) -> f64 {
        // Pillars stay within circles, whatever their rotation.
        Circle::gap_of_widths([self.widest_nm(last); 2], apart)
    }

    fn keeps(&self, mirrored: bool, quarter_turns: u8) -> bool {
        !mirrored && quarter_turns.is_multiple_of(2)
    }

    fn recognised(&self, corners: &[[f64; 2]; 4], slack_nm: f64) -> Option<PillarId> {
        let fitted = FittedRectangle::of(corners)?;
        let number = self.number(fitted.rotation);
        let half = [self.width_nm, self.length_nm].map(|nm| 0.5 * f64::from(nm));
        let (sin, cos) = self.rotation(number).sin_cos();
        let off = |[x, y]: &[f64; 2]| {
            let along = [cos * x + sin * y, cos * y - sin * x];
            [0, 1].map(|k| (along[k].abs() - half[k]).powi(2)).iter().sum::<f64>()
        };
        let most = slack_nm + WHOLE_SIZES_NM;
        (fitted.about_middle.iter().map(off).sum::<f64>() <= 4.0 * most * most).then_some(PillarId(number))
    }

    fn words(&self, PillarId(number): PillarId) -> String {
        format!("rotated by {} degrees", rounded(self.rotation(number).to_degrees()))
    }

    fn cell_name(&self, PillarId(number): PillarId) -> String {
        format!("R{number}")
    }

    fn quantity(&self) -> Quantity {
        Quantity {
            word: "rotation",
            title: "Rotation",
            label: "rotation",
            unit: "°",
        }
    }

    fn value(&self, PillarId(number): PillarId) -> f64 {
        self.rotation(number).to_degrees()
    }

    fn step(&self) -> Option<f64> {
        Some(self.step_deg())
    }

    fn solver_revision(&self) -> u32 {
        1
    }
}

/// Largest distance of a corner of a rectangle whose edges are whole nanometres from that of the nearest one with any edges (nm): a
/// quarter along and a quarter across, since half of an edge is off by half of what the edge is.
const WHOLE_SIZES_NM: f64 = 0.25 * SQRT_2;

/// The rectangle nearest to four corners in the least squares.
struct FittedRectangle {
    /// From x towards y to the shorter edge (rad), in any half turn.
    rotation: f64,
    /// The corners from their middle.
    about_middle: [[f64; 2]; 4],
}

impl FittedRectangle {
    /// None if the corners are in no four quadrants of a rectangle about their middle.
    fn of(corners: &[[f64; 2]; 4]) -> Option<Self> {
        let middle = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).sum::<f64>() / 4.0);
        let about_middle = corners.map(|[x, y]| [x - middle[0], y - middle[1]]);
        let edge = |k: usize| [0, 1].map(|axis| 0.5 * (corner_sum(&about_middle, axis, k)));
        let length = |[x, y]: [f64; 2]| x.hypot(y);
        let (first, second) = (edge(0), edge(1));
        let (short, long) = if length(first) > length(second) {
            (second, first)
        } else {
            (first, second)
        };
        let half = [0.5 * length(short), 0.5 * length(long)];
        // The longer edge is the truer one: its direction is a quarter turn from the rotation.
        let rotation = long[1].atan2(long[0]) - PI / 2.0;
        let (sin, cos) = rotation.sin_cos();
        let (mut turned, mut quadrants) = (0.0, 0u8);
        for [x, y] in about_middle {
            let (u, v) = (cos * x + sin * y, cos * y - sin * x);
            quadrants |= 1 << (u8::from(u > 0.0) + 2 * u8::from(v > 0.0));
            turned += half[0].copysign(u) * v - half[1].copysign(v) * u;
        }
        let squared = half[0] * half[0] + half[1] * half[1];
        (quadrants == 0b1111 && squared > 0.0).then_some(Self {
            rotation: rotation + turned / (4.0 * squared),
            about_middle,
        })
    }
}

/// Twice the mean of two opposite edges of a quadrilateral along an axis, from corner `k` to the next.
fn corner_sum(c: &[[f64; 2]; 4], axis: usize, k: usize) -> f64 {
    c[k + 1][axis] - c[k][axis] + c[(k + 2) % 4][axis] - c[(k + 3) % 4][axis]
}

/// An angle (degrees) without the rounding of its computation.
fn rounded(deg: f64) -> f64 {
    (deg * 1e6).round() / 1e6
}

/// Largest distance by which a side of `a` has all of `b` beyond it; negative if none has.
fn along_normals(a: &[[f64; 2]; 4], b: &[[f64; 2]; 4]) -> f64 {
    let beyond = |k: usize| {
        let (from, to) = (a[k], a[(k + 1) % 4]);
        let (ex, ey) = (to[0] - from[0], to[1] - from[1]);
        let length = ex.hypot(ey).max(f64::MIN_POSITIVE);
        // Counter-clockwise: what is outside is to the right.
        let distance = |p: &[f64; 2]| ((p[0] - from[0]) * ey - (p[1] - from[1]) * ex) / length;
        b.iter().map(distance).fold(f64::INFINITY, f64::min)
    };
    (0..4).map(beyond).fold(f64::NEG_INFINITY, f64::max)
}

/// Distance of a point from a side.
fn from_side(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (ex, ey) = (b[0] - a[0], b[1] - a[1]);
    let (px, py) = (p[0] - a[0], p[1] - a[1]);
    let share = ((px * ex + py * ey) / (ex * ex + ey * ey).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (px - share * ex).hypot(py - share * ey)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PILLARS: RotatedRectangles = RotatedRectangles {
        width_nm: 100,
        length_nm: 250,
        steps: 180,
    };

    /// Rounding of a few operations on lengths of hundreds.
    const ROUNDING: f64 = 1e-9;

    #[test]
    fn numbers_stand_for_rotations_and_half_a_turn_for_none() {
        assert_eq!(PILLARS.rotation(180), 0.0);
        for number in 1..=180 {
            assert_eq!(PILLARS.number(PILLARS.rotation(number)), number);
            assert_eq!(PILLARS.number(PILLARS.rotation(number) - 3.0 * PI), number);
        }
        assert_eq!(PILLARS.on_grid(180), [(-50, -125), (50, -125), (50, 125), (-50, 125)]);
        assert_eq!(PILLARS.on_grid(90), [(125, -50), (125, 50), (-125, 50), (-125, -50)]);
        assert_eq!(PILLARS.reach(PillarId(90)), (125, 50));
    }

    #[test]
    fn corners_are_on_the_rectangle_and_are_recognised_in_any_order() {
        // Half the diagonal of a step of the grid.
        const ROUNDED: f64 = 0.7072;
        // More than a corner may be off by where the others are on their places.
        const OFF: f64 = 5.0;
        // What that may turn half of the longer edge by, with two corners that give way to opposite sides.
        const TURNED: f64 = ROUNDED / 125.0;
        for number in 1..=180 {
            let drawn = PILLARS.on_grid(number);
            let (sin, cos) = PILLARS.rotation(number).sin_cos();
            for ((x, y), (u, v)) in drawn
                .iter()
                .zip([(-50.0, -125.0), (50.0, -125.0), (50.0, 125.0), (-50.0, 125.0)])
            {
                let off = (*x as f64 - (cos * u - sin * v)).hypot(*y as f64 - (sin * u + cos * v));
                assert!(off <= ROUNDED, "{number}: {off}");
            }
            assert!(PILLARS.turned_by_grid(number).abs() < TURNED, "{number}");
            let mut corners = drawn.map(|(x, y)| [x as f64, y as f64]);
            for _ in 0..4 {
                corners.rotate_left(1);
                assert_eq!(PILLARS.recognised(&corners, ROUNDED), Some(PillarId(number)));
                let mut back = corners;
                back.reverse();
                assert_eq!(PILLARS.recognised(&back, ROUNDED), Some(PillarId(number)));
            }
            corners[0][0] += OFF;
            assert_eq!(PILLARS.recognised(&corners, ROUNDED), None);
        }
        let thinner = RotatedRectangles {
            width_nm: 90,
            ..PILLARS
        };
        let corners = thinner.on_grid(30).map(|(x, y)| [x as f64, y as f64]);
        assert_eq!(PILLARS.recognised(&corners, 1.5), None);
        assert_eq!(PILLARS.recognised(&[[0.0; 2]; 4], 200.0), None);
    }

    #[test]
    fn gaps_along_sides_between_corners_and_where_pillars_overlap() {
        for (numbers, apart, want) in [
            ([180, 180], [355.0, 0.0], 255.0),
            ([180, 180], [0.0, 355.0], 105.0),
            ([90, 180], [355.0, 0.0], 180.0),
            ([180, 180], [130.0, 290.0], 50.0),
            ([180, 180], [40.0, 200.0], -50.0),
        ] {
            let gap = PILLARS.gap(numbers.map(PillarId), apart);
            assert!((gap - want).abs() < ROUNDING, "{numbers:?} {apart:?}: {gap}");
        }
    }
}
