//! Circles, arcs and bulges as corners.

use std::f64::consts::{PI, TAU};

/// Largest distance between an arc and its chords (database units).
const CHORD_ERROR: f64 = metalith_pillars::CHORD_ERROR;

/// Fewest and most sides of a full circle.
const SIDES: [f64; 2] = [16.0, 8188.0];

/// An arc of an ellipse: its middle, half axes as vectors, and the angles from the first to the second axis at which it begins and
/// ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    pub middle: [f64; 2],
    pub axes: [[f64; 2]; 2],
    pub from: f64,
    pub to: f64,
}

impl Arc {
    /// An arc of a circle, from an angle to a larger one (radians).
    pub(super) fn of_circle(middle: [f64; 2], radius: f64, from: f64, to: f64) -> Self {
        Self {
            middle,
            axes: [[radius, 0.0], [0.0, radius]],
            from,
            to,
        }
    }

    /// True if it goes all round.
    pub(super) fn is_closed(&self) -> bool {
        // Angles of files have some six digits.
        (self.to - self.from).abs() >= TAU - 1e-6
    }

    fn at(&self, angle: f64) -> [f64; 2] {
        let (sin, cos) = angle.sin_cos();
        let [a, b] = self.axes;
        [0, 1].map(|k| self.middle[k] + a[k] * cos + b[k] * sin)
    }

    /// Its corners, both ends among them; a closed one ends before its start. A unit of the drawing is so many database units.
    pub(super) fn corners(&self, unit: f64) -> Vec<[f64; 2]> {
        let radius = unit * self.axes.iter().map(|a| a[0].hypot(a[1])).fold(0.0, f64::max);
        // The sagitta of a chord over an angle a is r (1 - cos(a / 2)).
        let half_angle = (1.0 - (CHORD_ERROR / radius.max(CHORD_ERROR)).min(1.0)).acos();
        // A multiple of four: circles keep their symmetry.
        let full = 4.0
            * (PI / half_angle.max(f64::MIN_POSITIVE) / 4.0)
                .clamp(SIDES[0] / 4.0, SIDES[1] / 4.0)
                .ceil();
        if self.is_closed() {
            let side = TAU / full;
            return (0..full as usize)
                .map(|k| self.at(self.from + side * k as f64))
                .collect();
        }
        let sides = (full * (self.to - self.from).abs() / TAU).ceil().max(1.0);
        let side = (self.to - self.from) / sides;
        (0..=sides as usize)
            .map(|k| self.at(self.from + side * k as f64))
            .collect()
    }
}

/// Corners of the arc from `a` to `b` of which `bulge` is the tangent of a quarter of the angle, counter-clockwise if it is above zero;
/// `a` is among them, `b` is not.
pub(super) fn bulged(a: [f64; 2], b: [f64; 2], bulge: f64, unit: f64) -> Vec<[f64; 2]> {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let chord = dx.hypot(dy);
    // A sagitta of less than a thousandth of the chord error is a line.
    if (0.5 * chord * bulge * unit).abs() < 1e-3 * CHORD_ERROR {
        return vec![a];
    }
    let sweep = 4.0 * bulge.atan();
    // From the middle of the chord to that of the circle, to the left of the chord.
    let height = chord * (1.0 - bulge * bulge) / (4.0 * bulge);
    let middle = [
        0.5 * (a[0] + b[0]) - height * dy / chord,
        0.5 * (a[1] + b[1]) + height * dx / chord,
    ];
    let (x, y) = (a[0] - middle[0], a[1] - middle[1]);
    let from = y.atan2(x);
    let mut corners = Arc::of_circle(middle, x.hypot(y), from, from + sweep).corners(unit);
    corners.pop();
    corners[0] = a;
    corners
}
