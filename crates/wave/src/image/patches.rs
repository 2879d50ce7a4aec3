//! Blur that changes over the field.

use ndarray::Array2;

use metalith_core::{Error, Result};

/// Kernels on a grid over an image, each in force at the middle of its patch and fading linearly to its neighbours.
#[derive(Clone, Debug)]
pub struct Patches {
    kernels: Vec<Array2<f64>>,
    grid: [usize; 2],
}

impl Patches {
    /// `kernels` in reading order, one for each of `grid` rows and columns of patches, all of one shape and with an odd
    /// number of pixels an axis. Each is brought to a sum of one: exposure is set by the light, not by the lens.
    ///
    /// # Errors
    /// If shapes or numbers do not fit, or a kernel has no energy.
    pub fn new(kernels: Vec<Array2<f64>>, grid: [usize; 2]) -> Result<Self> {
        let shape = kernels.first().map(Array2::dim).unwrap_or_default();
        let same = kernels
            .iter()
            .all(|k| k.dim() == shape && k.sum() > 0.0 && k.sum().is_finite());
        let odd = shape.0 % 2 == 1 && shape.1 % 2 == 1;
        if !same || !odd || kernels.len() != grid[0] * grid[1] {
            return Err(Error::invalid(
                format!(
                    "{} kernels, the first of {shape:?} pixels, for {grid:?} patches",
                    kernels.len()
                ),
                "give one kernel for each patch, all of the same odd number of pixels and with energy in them",
            ));
        }
        let kernels = kernels.into_iter().map(|k| &k / k.sum()).collect();
        Ok(Self { kernels, grid })
    }

    /// The same kernel everywhere.
    ///
    /// # Errors
    /// As [`Patches::new`].
    pub fn uniform(kernel: Array2<f64>) -> Result<Self> {
        Self::new(vec![kernel], [1, 1])
    }

    /// Kernels with their weights over an image of this shape; the weights of all add up to one everywhere.
    pub(super) fn weighted(&self, image: [usize; 2]) -> impl Iterator<Item = (&Array2<f64>, Array2<f64>)> {
        self.kernels.iter().enumerate().map(move |(i, kernel)| {
            let [rows, columns] = [0, 1].map(|axis| {
                let patch = if axis == 0 { i / self.grid[1] } else { i % self.grid[1] };
                hat(image[axis], self.grid[axis], patch)
            });
            let weight = Array2::from_shape_fn(image, |(y, x)| rows[y] * columns[x]);
            (kernel, weight)
        })
    }

    /// How far a kernel reaches from its middle [pixels].
    pub(super) fn reach(&self) -> usize {
        let (rows, columns) = self.kernels[0].dim();
        rows.max(columns) / 2
    }
}

/// Weight of one of `patches` along an axis of `pixels`: one at its middle, zero at the middles of its neighbours.
fn hat(pixels: usize, patches: usize, patch: usize) -> Vec<f64> {
    let last = patches as f64 - 1.0;
    (0..pixels)
        .map(|i| {
            let place = ((i as f64 + 0.5) / pixels as f64 * patches as f64 - 0.5).clamp(0.0, last);
            (1.0 - (place - patch as f64).abs()).max(0.0)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_add_up_to_one() {
        let patches = Patches::new(vec![Array2::ones((3, 3)); 6], [2, 3]).unwrap();
        let mut sum = Array2::zeros((17, 23));
        for (kernel, weight) in patches.weighted([17, 23]) {
            assert!((kernel.sum() - 1.0).abs() < 1e-12);
            sum += &weight;
        }
        assert!(sum.iter().all(|w: &f64| (w - 1.0).abs() < 1e-12));
        assert!(Patches::uniform(Array2::zeros((3, 3))).is_err());
        assert!(Patches::new(vec![Array2::ones((4, 3))], [1, 1]).is_err());
    }
}
