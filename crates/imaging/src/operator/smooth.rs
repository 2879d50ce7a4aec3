//! A scene without what a coarse grid of points cannot hold.

use ndarray::{Array2, ArrayView2};
use pulp::Arch;

use super::source::{LOBES, lanczos};

/// A weighted mean over neighbours along both axes; beyond its borders a scene is as it is there.
pub(crate) struct Smoothing {
    /// Weights of the pixel itself and of those on each of its sides.
    weights: Vec<f32>,
}

impl Smoothing {
    /// Smoothing for points that are `step` pixels of the scene apart: waves of two steps keep half of their height. A
    /// grid that is finer than the scene needs none.
    pub(crate) fn new(step: f64) -> Self {
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

    pub(crate) fn apply(&self, plane: &Array2<f32>) -> Array2<f32> {
        self.along_both(plane, |from, to| {
            let reach = self.weights.len() - 1;
            let padded = [&vec![from[0]; reach][..], from, &vec![from[from.len() - 1]; reach]].concat();
            self.sums(&padded, to);
        })
    }

    /// The adjoint of [`Smoothing::apply`].
    pub(crate) fn adjoint(&self, plane: &Array2<f32>) -> Array2<f32> {
        self.along_both(plane, |from, to| {
            let (reach, n) = (self.weights.len() - 1, from.len());
            let dark = vec![0.0; 2 * reach];
            let mut wide = vec![0.0; n + 2 * reach];
            self.sums(&[&dark[..], from, &dark].concat(), &mut wide);
            // What went beyond the borders came from the pixels there.
            to.copy_from_slice(&wide[reach..reach + n]);
            to[0] += wide[..reach].iter().sum::<f32>();
            to[n - 1] += wide[reach + n..].iter().sum::<f32>();
        })
    }

    /// Weighted sums over the neighbours of values of which so many more are given on both sides.
    fn sums(&self, padded: &[f32], to: &mut [f32]) {
        let (reach, n) = (self.weights.len() - 1, to.len());
        Arch::new().dispatch(|| {
            let own = padded[reach..].iter().zip(&mut *to);
            own.for_each(|(v, t)| *t = self.weights[0] * v);
            for (k, w) in self.weights.iter().enumerate().skip(1) {
                let sides = padded[reach - k..][..n].iter().zip(&padded[reach + k..][..n]);
                to.iter_mut().zip(sides).for_each(|(t, (a, b))| *t += w * (a + b));
            }
        });
    }

    fn along_both(&self, plane: &Array2<f32>, line: impl Fn(&[f32], &mut [f32])) -> Array2<f32> {
        if self.weights.len() == 1 {
            return plane.clone();
        }
        let along_rows = |from: ArrayView2<'_, f32>| {
            let mut to = Array2::zeros(from.dim());
            for (from, mut to) in from.rows().into_iter().zip(to.rows_mut()) {
                line(
                    from.as_slice().expect("rows are whole"),
                    to.as_slice_mut().expect("rows are whole"),
                );
            }
            to
        };
        let rows = along_rows(plane.as_standard_layout().view());
        let both = along_rows(rows.t().as_standard_layout().view());
        both.t().as_standard_layout().into_owned()
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
