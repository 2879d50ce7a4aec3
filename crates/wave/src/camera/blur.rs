//! Blur that changes over the field.

use ndarray::Array2;
use num_complex::Complex64;

use crate::error::{Result, WaveError};
use crate::kernels::Fourier;

/// Images of a point on a grid over the field, each in force at the middle of its patch and fading linearly to its
/// neighbours.
#[derive(Clone, Debug)]
pub struct Blur {
    kernels: Vec<Array2<f64>>,
    grid: [usize; 2],
}

impl Blur {
    /// `kernels` in reading order, one for each of `grid` rows and columns of patches, all of one shape and with an odd
    /// number of pixels an axis; the point is in the middle one. The sum of a kernel is the share of the light that
    /// arrives: one for a lens without losses.
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
            return Err(WaveError::Kernels {
                kernels: kernels.len(),
                shape,
                grid,
            });
        }
        Ok(Self { kernels, grid })
    }

    /// The same kernel everywhere.
    ///
    /// # Errors
    /// As [`Blur::new`].
    pub fn uniform(kernel: Array2<f64>) -> Result<Self> {
        Self::new(vec![kernel], [1, 1])
    }

    /// The image of a scene, without noise: each point spread by the kernel in force where it is. Beyond its border the
    /// scene goes on as its own mirror image.
    pub fn image(&self, scene: &Array2<f64>) -> Array2<f64> {
        let shape = <[usize; 2]>::from(scene.dim());
        let fourier = Fourier::new(shape, self.reach());
        let mut sum = Array2::zeros(fourier.size());
        for (kernel, weight) in self.weighted(shape) {
            sum += &(fourier.of_image(&(scene * &weight)) * fourier.of_kernel(kernel));
        }
        fourier.to_image(sum)
    }

    /// Kernels with their weights over an image of this shape; the weights of all add up to one everywhere.
    pub(crate) fn weighted(&self, image: [usize; 2]) -> impl Iterator<Item = (&Array2<f64>, Array2<f64>)> {
        self.kernels.iter().enumerate().map(move |(i, kernel)| {
            let [rows, columns] = [0, 1].map(|axis| {
                let patch = if axis == 0 { i / self.grid[1] } else { i % self.grid[1] };
                hat(image[axis], self.grid[axis], patch)
            });
            let weight = Array2::from_shape_fn(image, |(y, x)| rows[y] * columns[x]);
            (kernel, weight)
        })
    }

    /// How far a kernel reaches from its middle (pixels).
    pub(crate) fn reach(&self) -> usize {
        let (rows, columns) = self.kernels[0].dim();
        rows.max(columns) / 2
    }
}

/// The image of a point on pixels, from the optical transfer function of a square window of them.
///
/// `otf[[j, i]]` is at j and i cycles a window along y and x, those beyond half standing for negative ones; shape
/// `[n, n]` with an even n. The kernel has n + 1 pixels an axis: what is half a window away is shared by both ends.
///
/// # Errors
/// If the transfer function is not square or n is odd.
pub fn kernel_of_otf(otf: &Array2<Complex64>) -> Result<Array2<f64>> {
    let n = otf.nrows();
    if otf.ncols() != n || !n.is_multiple_of(2) || n == 0 {
        let even = n.next_multiple_of(2).max(2);
        return Err(WaveError::Shape {
            what: "a transfer function",
            given: otf.dim().into(),
            wanted: [even; 2],
        });
    }
    let fourier = Fourier::periodic([n, n]);
    let periodic = fourier.to_image(otf.clone());
    let share = |i: usize| if i == 0 || i == n { 0.5 } else { 1.0 };
    Ok(Array2::from_shape_fn((n + 1, n + 1), |(y, x)| {
        share(y) * share(x) * periodic[[(y + n / 2) % n, (x + n / 2) % n]]
    }))
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

    /// Of sums and transforms of a few hundred values of size one.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn weights_add_up_to_one() {
        let blur = Blur::new(vec![Array2::ones((3, 3)); 6], [2, 3]).unwrap();
        let mut sum = Array2::zeros((17, 23));
        for (_, weight) in blur.weighted([17, 23]) {
            sum += &weight;
        }
        assert!(sum.iter().all(|w: &f64| (w - 1.0).abs() < ROUNDING));
        assert!(Blur::uniform(Array2::zeros((3, 3))).is_err());
        assert!(Blur::new(vec![Array2::ones((4, 3))], [1, 1]).is_err());
    }

    #[test]
    fn a_blur_is_the_sum_over_the_kernel_and_mirrors_at_the_border() {
        let scene = Array2::from_shape_fn((12, 17), |(y, x)| ((y * 7 + x * x * 3) % 11) as f64 / 10.0);
        let kernel = Array2::from_shape_fn((3, 5), |(y, x)| (1 + y * 5 + x) as f64);
        let got = Blur::uniform(kernel.clone()).unwrap().image(&scene);
        let mirror = |i: i64, n: i64| {
            (if i < 0 {
                -1 - i
            } else if i >= n {
                2 * n - 1 - i
            } else {
                i
            }) as usize
        };
        for ((y, x), got) in got.indexed_iter() {
            let mut want = 0.0;
            for ((ky, kx), k) in kernel.indexed_iter() {
                let (sy, sx) = (y as i64 + 1 - ky as i64, x as i64 + 2 - kx as i64);
                want += k * scene[[mirror(sy, 12), mirror(sx, 17)]];
            }
            assert!(
                (got - want).abs() < ROUNDING * kernel.sum(),
                "{y} {x}: {got} is not {want}"
            );
        }
    }

    /// The phase of a transfer function that falls with frequency along x moves a point to larger x.
    #[test]
    fn a_kernel_is_where_its_transfer_function_says() {
        let n = 8;
        let signed = |i: usize| if 2 * i > n { i as f64 - n as f64 } else { i as f64 };
        let otf = Array2::from_shape_fn((n, n), |(_, x)| {
            Complex64::cis(-std::f64::consts::TAU * signed(x) / n as f64) * 0.7
        });
        let kernel = kernel_of_otf(&otf).unwrap();
        assert!((kernel[[4, 5]] - 0.7).abs() < ROUNDING && (kernel.sum() - 0.7).abs() < ROUNDING);
        assert!(kernel_of_otf(&Array2::zeros((8, 6))).is_err() && kernel_of_otf(&Array2::zeros((7, 7))).is_err());
        // What is half a window away belongs to both ends.
        let far = Array2::from_shape_fn((n, n), |(_, x)| Complex64::from(if x % 2 == 0 { 1.0 } else { -1.0 }));
        let kernel = kernel_of_otf(&far).unwrap();
        assert!((kernel[[4, 0]] - 0.5).abs() < ROUNDING && (kernel[[4, 8]] - 0.5).abs() < ROUNDING);
    }
}
