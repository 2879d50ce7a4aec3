//! Transforms of the plane.

/// A linear transform, and a shift behind it: `[[xx, xy, x], [yx, yy, y]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine(pub [[f64; 3]; 2]);

/// Largest relative difference of the columns of a transform that keeps angles.
const SAME: f64 = 1e-9;

/// Steps of angles (degrees) and magnifications, below which they are rounding.
const STEPS_PER_DEGREE: f64 = 1e9;
const STEPS_PER_ONE: f64 = 1e12;

impl Affine {
    pub(super) fn shift([x, y]: [f64; 2]) -> Self {
        Self([[1.0, 0.0, x], [0.0, 1.0, y]])
    }

    pub(super) fn scale([x, y]: [f64; 2]) -> Self {
        Self([[x, 0.0, 0.0], [0.0, y, 0.0]])
    }

    /// Turn by an angle; exact for multiples of a right angle.
    pub(super) fn turn(degrees: f64) -> Self {
        let (sin, cos) = match degrees.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            other => other.to_radians().sin_cos(),
        };
        Self([[cos, -sin, 0.0], [sin, cos, 0.0]])
    }

    /// This behind `inner`.
    pub(super) fn of(&self, inner: &Self) -> Self {
        let row = |[a, b, c]: [f64; 3]| {
            let column = |k: usize| a * inner.0[0][k] + b * inner.0[1][k];
            [column(0), column(1), column(2) + c]
        };
        Self(self.0.map(row))
    }

    pub(super) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.0.map(|[a, b, c]| a * x + b * y + c)
    }

    /// A difference of two places.
    pub(super) fn along(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.0.map(|[a, b, _]| a * x + b * y)
    }

    /// Mean factor by which it lengthens.
    pub(super) fn factor(&self) -> f64 {
        let [[a, b, _], [c, d, _]] = self.0;
        (a * d - b * c).abs().sqrt()
    }

    /// Mirrored or not, magnification and angle (degrees), if it keeps angles.
    pub(super) fn similarity(&self) -> Option<(bool, f64, f64)> {
        let [[a, b, _], [c, d, _]] = self.0;
        let (first, second) = (a.hypot(c), b.hypot(d));
        let mirrored = a * d < b * c;
        let kept = (first - second).abs() <= SAME * first && (a * b + c * d).abs() <= SAME * first * second;
        let rounded = |v: f64, steps: f64| (v * steps).round() / steps;
        let angle = rounded(c.atan2(a).to_degrees().rem_euclid(360.0), STEPS_PER_DEGREE);
        (kept && first > 0.0).then_some((mirrored, rounded(first, STEPS_PER_ONE), angle % 360.0))
    }
}
