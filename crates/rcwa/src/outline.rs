//! Cross-sections of a pillar and their Fourier coefficients, in closed form.

use serde::Serialize;

/// A cross-section that both axes mirror: the union of centred rectangles, largest in y first.
///
/// Corners go around the first quadrant from the y axis to the x axis: half-widths along x rise, along y
/// fall. A square has one corner; a rounded square is a staircase of a few.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outline {
    corners_nm: Vec<[f64; 2]>,
}

/// Steps of the staircase that stands for a rounded corner. Four steps of equal area move |t| by less
/// than 0.001 against eight for radii up to 40 nm; see the tests.
const CORNER_STEPS: usize = 4;

/// Steps of the staircase that stands for a quarter of a circle.
const CIRCLE_STEPS: usize = 16;

impl Outline {
    /// Nothing: a uniform layer of the surrounding medium.
    pub fn empty() -> Self {
        Self { corners_nm: Vec::new() }
    }

    /// A centred square.
    pub fn square(width_nm: f64) -> Self {
        Self::rectangle(width_nm, width_nm)
    }

    /// A centred rectangle.
    pub fn rectangle(width_x_nm: f64, width_y_nm: f64) -> Self {
        Self {
            corners_nm: vec![[0.5 * width_x_nm, 0.5 * width_y_nm]],
        }
    }

    /// A centred square whose corners are quarter circles: a staircase of the same area and the same
    /// symmetries. The radius is at most half the width.
    pub fn rounded(width_nm: f64, radius_nm: f64) -> Self {
        Self::staircase(width_nm, radius_nm, CORNER_STEPS)
    }

    /// A centred circle: a staircase of the same area and the same symmetries. The rules for products of Fourier series are
    /// those of sides along the axes, which converges more slowly for a circle than for a square.
    pub fn circle(diameter_nm: f64) -> Self {
        Self::staircase(diameter_nm, 0.5 * diameter_nm, CIRCLE_STEPS)
    }

    fn staircase(width_nm: f64, radius_nm: f64, steps: usize) -> Self {
        let radius = radius_nm.min(0.5 * width_nm);
        if radius <= 0.0 {
            return Self::square(width_nm);
        }
        let flat = 0.5 * width_nm - radius;
        let rises = staircase_rises(steps);
        let corners_nm = (0..steps)
            .map(|k| [flat + radius * rises[k], flat + radius * rises[steps - 1 - k]])
            .collect();
        Self { corners_nm }
    }

    /// The largest width along x and y (nm).
    pub fn extent_nm(&self) -> [f64; 2] {
        match (self.corners_nm.first(), self.corners_nm.last()) {
            (Some(first), Some(last)) => [2.0 * last[0], 2.0 * first[1]],
            _ => [0.0, 0.0],
        }
    }

    /// Whether nothing is there.
    pub fn is_empty(&self) -> bool {
        self.corners_nm.iter().all(|c| c[0] <= 0.0 || c[1] <= 0.0)
    }

    /// Whether it covers the whole of a square this wide.
    pub(super) fn fills(&self, width_nm: f64) -> bool {
        self.corners_nm
            .iter()
            .any(|c| c[0] >= 0.5 * width_nm && c[1] >= 0.5 * width_nm)
    }

    /// Whether the diagonal mirrors it as well, so that x and y polarisation see the same.
    pub fn is_square(&self) -> bool {
        let n = self.corners_nm.len();
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        (0..n).all(|k| same(self.corners_nm[k][0], self.corners_nm[n - 1 - k][1]))
    }

    /// Every number finite and in order.
    pub(super) fn is_sound(&self) -> bool {
        self.corners_nm.iter().flatten().all(|v| v.is_finite() && *v >= 0.0)
    }

    /// Bands of constant width along one axis: for `axis` 0 the width along x, where |y| is between two
    /// bounds; for `axis` 1 the width along y by bounds of |x|.
    pub(super) fn bands(&self, axis: usize) -> Vec<Band> {
        let n = self.corners_nm.len();
        let across = 1 - axis;
        (0..n)
            .map(|k| {
                // Along x, corner k is widest up to its own y and down to the y of the next corner; along
                // y, up to its own x and down to the x of the corner before.
                let inner = if axis == 0 { k + 1 } else { k.wrapping_sub(1) };
                Band {
                    half_width: self.corners_nm[k][axis],
                    from: self.corners_nm.get(inner).map_or(0.0, |c| c[across]),
                    to: self.corners_nm[k][across],
                }
            })
            .collect()
    }
}

/// Where |across| is between `from` and `to`, the pillar reaches to +-`half_width` (nm).
pub(super) struct Band {
    pub half_width: f64,
    pub from: f64,
    pub to: f64,
}

/// Fourier coefficients 0..=highest of the indicator of |x| < half_width with this period; coefficients
/// of opposite order are equal.
pub(super) fn slab_coefficients(half_width: f64, period: f64, highest: usize) -> Vec<f64> {
    let duty = 2.0 * half_width / period;
    let turn = std::f64::consts::PI;
    (0..=highest)
        .map(|k| match k {
            0 => duty,
            _ => (turn * k as f64 * duty).sin() / (turn * k as f64),
        })
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of a handful of products in double precision.
    const ROUNDING: f64 = 1e-12;

    fn area(outline: &Outline, axis: usize) -> f64 {
        outline
            .bands(axis)
            .iter()
            .map(|b| 4.0 * b.half_width * (b.to - b.from))
            .sum()
    }

    #[test]
    fn a_rounded_square_keeps_area_extent_and_symmetry() {
        let (width, radius) = (200.0, 40.0);
        for steps in [2, 4, 7] {
            let outline = Outline::staircase(width, radius, steps);
            let want = width * width - (4.0 - std::f64::consts::PI) * radius * radius;
            for axis in [0, 1] {
                assert!((area(&outline, axis) - want).abs() < want * ROUNDING, "{steps}");
            }
            let extent = outline.extent_nm();
            assert!((extent[0] - width).abs() < ROUNDING * width && extent[0] == extent[1]);
            assert!(outline.is_square());
        }
        assert_eq!(Outline::rounded(200.0, 0.0), Outline::square(200.0));
        assert!(!Outline::rectangle(100.0, 120.0).is_square());
    }

    #[test]
    fn a_circle_has_its_area_and_both_diameters() {
        let circle = Outline::circle(260.0);
        let want = std::f64::consts::PI * 130.0 * 130.0;
        assert!((area(&circle, 0) - want).abs() < want * ROUNDING);
        assert!((circle.extent_nm()[0] - 260.0).abs() < ROUNDING * 260.0 && circle.is_square());
    }

    #[test]
    fn slab_coefficients_sum_to_the_slab() {
        let (half, period) = (60.0, 350.0);
        let f = slab_coefficients(half, period, 4000);
        // Away from the edge a Fourier series that ends at k errs by about 1 / (pi k sin(pi x / p)).
        const TRUNCATED: f64 = 1e-3;
        for (x, want) in [(0.0, 1.0), (100.0, 0.0)] {
            let sum: f64 = (1..f.len())
                .map(|k| 2.0 * f[k] * (2.0 * std::f64::consts::PI * k as f64 * x / period).cos())
                .sum::<f64>()
                + f[0];
            assert!((sum - want).abs() < TRUNCATED, "{x}: {sum}");
        }
    }
}
