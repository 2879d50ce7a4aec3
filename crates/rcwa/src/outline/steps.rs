//! Cross-sections with sides along the axes.

use serde::Serialize;

/// The union of centred rectangles, largest in y first.
///
/// Corners (nm) go around the first quadrant from the y axis to the x axis: half-widths along x rise, along y
/// fall. A square has one corner; a rounded square is a staircase of a few.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Steps(Vec<[f64; 2]>);

impl Steps {
    pub(crate) fn empty() -> Self {
        Self(Vec::new())
    }

    pub(crate) fn rectangle(widths_nm: [f64; 2]) -> Self {
        Self(vec![widths_nm.map(|w| 0.5 * w)])
    }

    /// A square whose corners are quarter circles, of so many steps each: the area is that of the rounded square.
    pub(crate) fn rounded(width_nm: f64, radius_nm: f64, steps: usize) -> Self {
        let radius = radius_nm.min(0.5 * width_nm);
        if radius <= 0.0 {
            return Self::rectangle([width_nm; 2]);
        }
        let flat = 0.5 * width_nm - radius;
        let rises = staircase_rises(steps);
        let corners_nm = (0..steps)
            .map(|k| [flat + radius * rises[k], flat + radius * rises[steps - 1 - k]])
            .collect();
        Self(corners_nm)
    }

    /// The largest width along x and y (nm).
    pub(crate) fn extent_nm(&self) -> [f64; 2] {
        match (self.0.first(), self.0.last()) {
            (Some(first), Some(last)) => [2.0 * last[0], 2.0 * first[1]],
            _ => [0.0, 0.0],
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.iter().all(|c| c[0] <= 0.0 || c[1] <= 0.0)
    }

    pub(crate) fn fills(&self, width_nm: f64) -> bool {
        self.0.iter().any(|c| c[0] >= 0.5 * width_nm && c[1] >= 0.5 * width_nm)
    }

    /// True if the diagonal mirrors it.
    pub(crate) fn is_square(&self) -> bool {
        let n = self.0.len();
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        (0..n).all(|k| same(self.0[k][0], self.0[n - 1 - k][1]))
    }

    pub(crate) fn is_sound(&self) -> bool {
        self.0.iter().flatten().all(|v| v.is_finite() && *v >= 0.0)
    }

    /// Bands of constant width along one axis: for `axis` 0 the width along x, where |y| is between two
    /// bounds; for `axis` 1 the width along y by bounds of |x|.
    pub(crate) fn bands(&self, axis: usize) -> Vec<Band> {
        let n = self.0.len();
        let across = 1 - axis;
        (0..n)
            .map(|k| {
                // Along x, corner k is widest up to its own y and down to the y of the next corner; along
                // y, up to its own x and down to the x of the corner before.
                let inner = if axis == 0 { k + 1 } else { k.wrapping_sub(1) };
                Band {
                    half_width: self.0[k][axis],
                    from: self.0.get(inner).map_or(0.0, |c| c[across]),
                    to: self.0[k][across],
                }
            })
            .collect()
    }
}

/// Band of a pillar: where |across| is between `from` and `to`, it reaches to +-`half_width` (nm).
pub(crate) struct Band {
    pub half_width: f64,
    pub from: f64,
    pub to: f64,
}

/// Corners of a staircase in the quarter of the unit circle, symmetric about the diagonal, reaching the
/// circle's full extent and covering its area: sin((k - b) q / (n - b)) of a quarter turn q, with the b
/// that makes the area right.
fn staircase_rises(steps: usize) -> Vec<f64> {
    let rises = |shift: f64| -> Vec<f64> {
        let step = std::f64::consts::FRAC_PI_2 / (steps as f64 - shift);
        (1..=steps).map(|k| ((k as f64 - shift) * step).sin()).collect()
    };
    let area = |u: &[f64]| -> f64 {
        (0..steps)
            .map(|k| (u[k] - if k == 0 { 0.0 } else { u[k - 1] }) * u[steps - 1 - k])
            .sum()
    };
    // The area falls from above the circle's at b = 0 to below it at b = 1.
    let (mut low, mut high) = (0.0, 0.999);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if area(&rises(middle)) > std::f64::consts::FRAC_PI_4 {
            low = middle;
        } else {
            high = middle;
        }
    }
    rises(0.5 * (low + high))
}
