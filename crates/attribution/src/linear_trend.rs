//! A linear trend: whether values are linear in a place or whatever groups of measurements differ in.

use nalgebra::{DMatrix, DVector};

use crate::extent::Extent;
use crate::fit::SIGMAS_95;

/// Values are linear if none is farther off than this share of half of what they span, or than their noise says.
const OFF_SHARE: f64 = 0.1;

/// Values that are put as linear over a plane or a line.
#[derive(Clone, Debug)]
pub struct LinearTrend {
    /// Extent of the coordinates, in their unit.
    pub extent: Extent,
    /// Slope along each direction, with its standard deviation.
    pub slopes: Vec<(f64, f64)>,
    /// Value in the middle, with its standard deviation.
    pub at_middle: (f64, f64),
    /// Distance of the farthest value from this.
    pub off: f64,
    /// True if the values are linear, to what they are known to.
    pub is_linear: bool,
    /// Values beyond as many as determine the trend: with none, any values are linear.
    pub degrees_of_freedom: usize,
}

impl LinearTrend {
    /// Trend of values, each with its standard deviation, at these coordinates; none for a single place.
    pub fn new(at: &[[f64; 2]], values: &[(f64, f64)]) -> Option<Self> {
        let extent = Extent::of(at)?;
        let directions = &extent.directions;
        let numbers = directions.len() + 1;
        let a = DMatrix::from_fn(at.len(), numbers, |i, j| {
            directions.get(j).map_or(1.0, |d| extent.along(&at[i], d))
        });
        let b = DVector::from_fn(at.len(), |i, _| values[i].0);
        let solving = (a.transpose() * &a).try_inverse()? * a.transpose();
        let x = &solving * &b;
        let sigma = |j: usize| {
            let parts = values.iter().enumerate().map(|(i, v)| (solving[(j, i)] * v.1).powi(2));
            parts.sum::<f64>().sqrt()
        };
        let off = (&a * &x - &b).amax();
        let noise = values.iter().fold(0.0, |most: f64, v| most.max(v.1));
        Some(Self {
            slopes: (0..directions.len()).map(|j| (x[j], sigma(j))).collect(),
            at_middle: (x[numbers - 1], sigma(numbers - 1)),
            is_linear: off <= (SIGMAS_95 * noise).max(OFF_SHARE * 0.5 * (b.max() - b.min())),
            degrees_of_freedom: at.len().saturating_sub(numbers),
            off,
            extent,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Absolute, of values of a few: rounding.
    const ROUNDING: f64 = 1e-9;

    const SIGMA: f64 = 0.01;

    fn trend(at: &[[f64; 2]], value: impl Fn(&[f64; 2]) -> f64) -> LinearTrend {
        let values: Vec<(f64, f64)> = at.iter().map(|p| (value(p), SIGMA)).collect();
        LinearTrend::new(at, &values).unwrap()
    }

    #[test]
    fn values_on_a_plane_have_its_slopes() {
        let at = [[0.0, 0.0], [400.0, 0.0], [400.0, 400.0], [0.0, 400.0]];
        let plane = |p: &[f64; 2]| 0.5 + 0.03 * (p[0] - 200.0) - 0.018 * (p[1] - 200.0);
        let found = trend(&at, plane);
        assert_eq!(
            (
                found.extent.middle,
                found.extent.directions.len(),
                found.degrees_of_freedom
            ),
            ([200.0; 2], 2, 1)
        );
        let [x, y] = [found.slopes[0], found.slopes[1]];
        assert!(
            (x.0 - 0.03).abs() < ROUNDING
                && (y.0 + 0.018).abs() < ROUNDING
                && (found.at_middle.0 - 0.5).abs() < ROUNDING
        );
        // Four values at half of 400 um: sigma / (sqrt(4) 200 um).
        assert!((x.1 / (SIGMA / 400.0) - 1.0).abs() < ROUNDING, "{x:?}");
        assert!(found.is_linear && found.extent.half_spans == [200.0; 2]);
        // One corner off by a tenth of what the values span: no plane.
        let bent = trend(&at, |p| plane(p) + if p == &at[2] { 4.0 } else { 0.0 });
        assert!(!bent.is_linear && (bent.off - 1.0).abs() < ROUNDING, "{bent:?}");
    }

    #[test]
    fn values_in_a_line_have_one_slope_and_two_are_always_linear() {
        let at = [[300.0, 400.0], [0.0, 0.0], [-300.0, -400.0]];
        let found = trend(&at, |p| 2.0 + 0.01 * (0.6 * p[0] + 0.8 * p[1]));
        assert_eq!((found.extent.directions.len(), found.degrees_of_freedom), (1, 1));
        assert!((found.slopes[0].0 - 0.01).abs() < ROUNDING && (found.extent.half_spans[0] - 500.0).abs() < ROUNDING);
        let two = trend(&at[..2], |p| p[0]);
        assert!(two.is_linear && two.degrees_of_freedom == 0);
        assert!(LinearTrend::new(&at[..1], &[(1.0, SIGMA)]).is_none());
    }
}
