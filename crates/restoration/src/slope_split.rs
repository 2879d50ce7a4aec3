//! Slopes of a picture, along rows and along columns, and their part in total variation.

use ndarray::{Array2, Axis, Slice, Zip};

/// Border: what follows the last row and the last column of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlopeBorder {
    /// The last one again: the slope at the border is zero.
    Even,
    /// The first one.
    Periodic,
}

/// Slopes towards the next row and the next column.
pub(crate) fn slopes(x: &Array2<f32>, border: SlopeBorder) -> [Array2<f32>; 2] {
    let (rows, columns) = x.dim();
    let next = |i: usize, n: usize| match border {
        SlopeBorder::Even => (i + 1 < n).then_some(i + 1),
        SlopeBorder::Periodic => Some((i + 1) % n),
    };
    [
        Array2::from_shape_fn((rows, columns), |(i, j)| {
            next(i, rows).map_or(0.0, |k| x[[k, j]] - x[[i, j]])
        }),
        Array2::from_shape_fn((rows, columns), |(i, j)| {
            next(j, columns).map_or(0.0, |k| x[[i, k]] - x[[i, j]])
        }),
    ]
}

/// The adjoint of [`slopes`].
pub(crate) fn slopes_adjoint([down, right]: &[Array2<f32>; 2], border: SlopeBorder) -> Array2<f32> {
    let (rows, columns) = down.dim();
    match border {
        SlopeBorder::Even => Array2::from_shape_fn((rows, columns), |(i, j)| {
            let mut sum = 0.0;
            if i + 1 < rows {
                sum -= down[[i, j]];
            }
            if i > 0 {
                sum += down[[i - 1, j]];
            }
            if j + 1 < columns {
                sum -= right[[i, j]];
            }
            if j > 0 {
                sum += right[[i, j - 1]];
            }
            sum
        }),
        SlopeBorder::Periodic => Array2::from_shape_fn((rows, columns), |(i, j)| {
            down[[(i + rows - 1) % rows, j]] - down[[i, j]] + right[[i, (j + columns - 1) % columns]] - right[[i, j]]
        }),
    }
}

/// Sums of the slopes that meet at a pixel: the adjoint of [`slopes`] of the slopes, with an even border.
pub(crate) fn bends(x: &Array2<f32>) -> Array2<f32> {
    let mut out = Array2::zeros(x.dim());
    for axis in [Axis(0), Axis(1)] {
        let [near, far] = [Slice::from(..-1), Slice::from(1..)];
        let slope = &x.slice_axis(axis, far) - &x.slice_axis(axis, near);
        let mut to = out.slice_axis_mut(axis, far);
        to += &slope;
        let mut to = out.slice_axis_mut(axis, near);
        to -= &slope;
    }
    out
}

/// Slopes made shorter by the threshold, none below zero: the closest point of total variation.
pub(crate) fn shrunk(slopes: &[Array2<f32>; 2], threshold: f32) -> [Array2<f32>; 2] {
    let mut out = slopes.clone();
    let [down, right] = &mut out;
    Zip::from(down).and(right).for_each(|a, b| {
        let length = a.hypot(*b);
        let keep = if length > threshold {
            1.0 - threshold / length
        } else {
            0.0
        };
        *a *= keep;
        *b *= keep;
    });
    out
}

/// Slopes that follow an exponential law.
#[derive(Clone, Copy, Debug)]
pub struct ExponentialSlopes {
    /// Root mean square along one axis, from one place to the next.
    pub expected: f64,
}

impl ExponentialSlopes {
    /// Penalty over that of normal slopes: the threshold is then a fifth of what is expected.
    const PENALTY: f64 = 5.0;

    /// Penalty of squared slopes, over the weight of values with this variance.
    pub fn penalty(&self, variance: f64) -> f64 {
        Self::PENALTY * variance / self.expected.powi(2)
    }

    /// Threshold that slopes shrink by: the price of a slope, at the mean square of a normal law, over its penalty.
    pub fn threshold(&self) -> f64 {
        std::f64::consts::SQRT_2 * self.expected / Self::PENALTY
    }
}

/// Length that total variation adds up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlopeLength {
    /// The lengths of slopes as vectors.
    Isotropic,
    /// The lengths of both components.
    Anisotropic,
}

/// The slopes of a picture as a separate variable, by the alternating direction method of multipliers (Boyd et al.,
/// Foundations and Trends in Machine Learning 3, 1 (2011), section 6.4).
///
/// A round has three steps: the split slopes, the dual variable, and the picture that comes nearest to the goal for its
/// slopes. The dual variable may follow the split slopes ([`SlopeSplit::next_goal`]) or the picture
/// ([`SlopeSplit::goal`], then [`SlopeSplit::follow`]).
pub struct SlopeSplit {
    threshold: f32,
    length: SlopeLength,
    border: SlopeBorder,
    split: [Array2<f32>; 2],
    /// Dual variable, in units of the penalty.
    dual: [Array2<f32>; 2],
}

impl SlopeSplit {
    /// Split of nothing yet, for pictures of this shape.
    pub fn new(shape: (usize, usize), law: ExponentialSlopes, length: SlopeLength, border: SlopeBorder) -> Self {
        let zero = || [Array2::zeros(shape), Array2::zeros(shape)];
        Self {
            threshold: law.threshold() as f32,
            length,
            border,
            split: zero(),
            dual: zero(),
        }
    }

    /// The slopes of a picture plus the dual variable, which are split off here.
    fn divide(&mut self, x: &Array2<f32>) -> [Array2<f32>; 2] {
        let own = slopes(x, self.border);
        let sums = [0, 1].map(|a| &own[a] + &self.dual[a]);
        self.split = match self.length {
            SlopeLength::Isotropic => shrunk(&sums, self.threshold),
            SlopeLength::Anisotropic => sums
                .each_ref()
                .map(|s| s.mapv(|v| v.signum() * (v.abs() - self.threshold).max(0.0))),
        };
        sums
    }

    /// Split the slopes of a picture and update the dual variable by the same picture. The answer is the adjoint of the slopes
    /// of the goal of the next picture.
    pub fn next_goal(&mut self, x: &Array2<f32>) -> Array2<f32> {
        let sums = self.divide(x);
        let goal = [0, 1].map(|a| &self.split[a] * 2.0 - &sums[a]);
        self.dual = [0, 1].map(|a| &sums[a] - &self.split[a]);
        slopes_adjoint(&goal, self.border)
    }

    /// Split the slopes of a picture. The answer is the adjoint of the slopes of the goal of the next picture, which
    /// [`SlopeSplit::follow`] is to get.
    pub fn goal(&mut self, x: &Array2<f32>) -> Array2<f32> {
        self.divide(x);
        let goal = [0, 1].map(|a| &self.split[a] - &self.dual[a]);
        slopes_adjoint(&goal, self.border)
    }

    /// Update the dual variable by the picture that was found for a goal.
    pub fn follow(&mut self, x: &Array2<f32>) {
        let own = slopes(x, self.border);
        for ((dual, own), split) in self.dual.iter_mut().zip(&own).zip(&self.split) {
            *dual += &(own - split);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_have_their_adjoint() {
        let x = Array2::from_shape_fn((7, 9), |(i, j)| ((i * 5 + j * 3) % 7) as f32);
        let y = [3, 4].map(|k| Array2::from_shape_fn((7, 9), |(i, j)| ((i * k + j) % 5) as f32));
        for border in [SlopeBorder::Even, SlopeBorder::Periodic] {
            let a: f32 = slopes(&x, border).iter().zip(&y).map(|(s, y)| (s * y).sum()).sum();
            // Sums of whole numbers.
            assert_eq!(a, (&x * &slopes_adjoint(&y, border)).sum());
        }
        let even = slopes(&x, SlopeBorder::Even);
        assert_eq!(bends(&x), slopes_adjoint(&even, SlopeBorder::Even));
    }
}
