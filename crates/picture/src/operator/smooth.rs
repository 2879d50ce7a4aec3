//! A scene without what a coarse grid of points cannot hold.

use ndarray::{Array2, ArrayView1, ArrayViewMut1, Axis};

use super::source::{LOBES, lanczos};

/// A weighted mean over neighbours along both axes; beyond its borders a scene is as it is there.
pub struct Smoothing {
    /// Weights of the pixel itself and of those on each of its sides.
    weights: Vec<f32>,
}

impl Smoothing {
    /// For points that are `step` pixels of the scene apart: waves of two steps keep half of their height. A grid that is
    /// finer than the scene needs none.
    pub fn new(step: f64) -> Self {
        let reach = if step > 0.5 {
            (LOBES as f64 * step).ceil() as usize
        } else {
            0
        };
        let own: Vec<f64> = (0..=reach)
            .map(|k| if k == 0 { 1.0 } else { lanczos(k as f64 / step) })
            .collect();
        let sum = own[0] + 2.0 * own[1..].iter().sum::<f64>();
        Self {
            weights: own.iter().map(|w| (w / sum) as f32).collect(),
        }
    }

    pub fn apply(&self, plane: &Array2<f32>) -> Array2<f32> {
        self.along_both(plane, |from, mut to| {
            for i in 0..from.len() {
                to[i] = self.weights[0] * from[i];
                for (k, w) in self.weights.iter().enumerate().skip(1) {
                    to[i] += w * (from[i.saturating_sub(k)] + from[(i + k).min(from.len() - 1)]);
                }
            }
        })
    }

    /// The adjoint of [`Smoothing::apply`].
    pub fn adjoint(&self, plane: &Array2<f32>) -> Array2<f32> {
        self.along_both(plane, |from, mut to| {
            to.fill(0.0);
            let last = from.len() - 1;
            for i in 0..from.len() {
                to[i] += self.weights[0] * from[i];
                for (k, w) in self.weights.iter().enumerate().skip(1) {
                    to[i.saturating_sub(k)] += w * from[i];
                    to[(i + k).min(last)] += w * from[i];
                }
            }
        })
    }

    fn along_both(
        &self,
        plane: &Array2<f32>,
        line: impl Fn(ArrayView1<'_, f32>, ArrayViewMut1<'_, f32>),
    ) -> Array2<f32> {
        if self.weights.len() == 1 {
            return plane.clone();
        }
        let mut from = plane.clone();
        let mut to = Array2::zeros(plane.dim());
        for axis in [Axis(1), Axis(0)] {
            for (a, b) in from.lanes(axis).into_iter().zip(to.lanes_mut(axis)) {
                line(a, b);
            }
            std::mem::swap(&mut from, &mut to);
        }
        from
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_smooth_stays_and_what_is_fine_goes() {
        let smoothing = Smoothing::new(1.7);
        let ramp = Array2::from_shape_fn((40, 40), |(y, x)| (2 * x + y) as f32);
        let out = smoothing.apply(&ramp);
        // Single precision.
        assert!((10..30).all(|i| (out[[i, i]] / ramp[[i, i]] - 1.0).abs() < 1e-5));
        let stripes = Array2::from_shape_fn((40, 40), |(_, x)| if x % 2 == 0 { 1.0f32 } else { -1.0 });
        // Stripes of one pixel are finer than the grid holds by 1.7: a tenth may be left.
        assert!(smoothing.apply(&stripes)[[20, 20]].abs() < 0.1);
        assert_eq!(Smoothing::new(0.3).apply(&stripes), stripes);
    }

    #[test]
    fn the_adjoint_is_that_of_the_mean() {
        let smoothing = Smoothing::new(1.7);
        let plane = |k: usize| Array2::from_shape_fn((9, 13), |(y, x)| ((y * 3 + x * k) % 7) as f32 - 2.0);
        let (a, b) = (plane(5), plane(4));
        let (forward, back) = ((&smoothing.apply(&a) * &b).sum(), (&a * &smoothing.adjoint(&b)).sum());
        // Single precision of a hundred terms.
        assert!((forward - back).abs() < 1e-3, "{forward} {back}");
    }
}
