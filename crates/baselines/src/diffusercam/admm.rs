//! A scene from the part of its image that the sensor has, with little total variation: the alternating direction method of
//! multipliers with the crop, the slopes and the borders of the scene split off, so that every step has a closed form (Antipa et
//! al., Optica 5, 1 (2018)).

use metalith_core::{Error, Progress, Result, part};
use metalith_imaging::SquareFft;
use metalith_imaging::restore::{ExponentialSlopes, squared_frequencies};
use ndarray::{Array2, Zip};
use num_complex::Complex32;

use super::grid::{CoarseGrid, inverse, transformed};

/// How far a scene is sought, and how strongly slopes are held down.
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    /// Of all steps.
    pub rounds: usize,
    /// The penalty of slopes over that which follows from the noise.
    pub slopes: f32,
}

impl Descent {
    /// To the end, by the noise.
    pub const WHOLE: Self = Self {
        rounds: 80,
        slopes: 1.0,
    };
}

/// Of a channel from one place to the next: photographs have 0.043 between neighbouring pixels of 576, and twice as much
/// between every second.
const SLOPES: ExponentialSlopes = ExponentialSlopes { expected: 0.075 };
/// The penalty of what the sensor would have seen beyond its border, over the weight of what it has seen.
const CROP: f64 = 1.0;
/// The penalty of light beyond the scene and below zero, over that of slopes.
const BORDER: f64 = 100.0;
/// Least penalty of slopes, over the weight of what is seen. Noise alone would ask for a hundredth of it; then what the kernel
/// errs by is taken for detail (13.8 dB of linear light for the picture of the test, 19.9 with this).
const LEAST_SLOPES: f64 = 0.03;

/// A channel of a camera whose kernel is the same everywhere.
pub struct Deconvolution {
    grid: CoarseGrid,
    fft: SquareFft,
    kernel: Vec<Complex32>,
    /// What slopes count of each frequency.
    slopes: Vec<f32>,
}

impl Deconvolution {
    /// On a grid.
    pub fn new(grid: CoarseGrid) -> Self {
        let fft = SquareFft::new(grid.size);
        let n = grid.size;
        let squared: Vec<f32> = squared_frequencies(n).into_iter().map(|s| s as f32).collect();
        Self {
            kernel: transformed(&fft, &grid.kernel),
            slopes: (0..fft.entries()).map(|i| squared[i / n] + squared[i % n]).collect(),
            grid,
            fft,
        }
    }

    /// The grid.
    pub fn grid(&self) -> &CoarseGrid {
        &self.grid
    }

    /// What squares of the sensor see of a scene on the grid.
    pub fn seen(&self, scene: &Array2<f32>) -> Array2<f32> {
        let [rows, columns] = self.grid.data;
        part(self.image(scene).view(), 0..rows, 0..columns).to_owned()
    }

    fn image(&self, scene: &Array2<f32>) -> Array2<f32> {
        let mut spectrum = transformed(&self.fft, scene);
        spectrum.iter_mut().zip(&self.kernel).for_each(|(v, k)| *v *= k);
        inverse(&self.fft, &mut spectrum)
    }

    /// The scene that explains the light of the squares, whose noise has this variance.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn solve(
        &self,
        data: &Array2<f32>,
        variance: f64,
        descent: Descent,
        progress: &dyn Progress,
    ) -> Result<Array2<f32>> {
        let n = self.grid.size;
        let [rows, columns] = self.grid.data;
        let [scene_rows, scene_columns] = self.grid.scene();
        let by_noise = SLOPES.penalty(variance).max(LEAST_SLOPES) as f32;
        let slope_weight = descent.slopes * by_noise;
        let threshold = SLOPES.threshold() as f32;
        let (crop, border) = (CROP as f32, BORDER as f32 * slope_weight);
        let zero = || Array2::<f32>::zeros((n, n));
        let (mut scene, mut image) = (zero(), zero());
        // Prices of the three splits, in units of their penalties.
        let (mut crop_price, mut border_price) = (zero(), zero());
        let mut slope_price = [zero(), zero()];
        for _ in 0..descent.rounds {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            // The whole image: what was seen where there is a sensor, else what the scene says.
            let mut whole = &image + &crop_price;
            Zip::from(part(whole.view_mut(), 0..rows, 0..columns))
                .and(data)
                .for_each(|w, d| *w = (d + crop * *w) / (1.0 + crop));
            let own = steps(&scene);
            let sums = [&own[0] + &slope_price[0], &own[1] + &slope_price[1]];
            let split = sums
                .each_ref()
                .map(|s| s.mapv(|v| v.signum() * (v.abs() - threshold).max(0.0)));
            let mut inside = zero();
            let free = &scene + &border_price;
            let positive = part(free.view(), 0..scene_rows, 0..scene_columns).mapv(|v| v.max(0.0));
            part(inside.view_mut(), 0..scene_rows, 0..scene_columns).assign(&positive);
            // Towards the three of them, less their prices.
            let mut right = transformed(&self.fft, &(&whole - &crop_price));
            right
                .iter_mut()
                .zip(&self.kernel)
                .for_each(|(v, k)| *v *= k.conj() * crop);
            let goal = [&split[0] - &slope_price[0], &split[1] - &slope_price[1]];
            let mut rest = steps_adjoint(&goal) * slope_weight;
            rest.scaled_add(border, &(&inside - &border_price));
            let rest = transformed(&self.fft, &rest);
            for (((v, r), k), slopes) in right.iter_mut().zip(&rest).zip(&self.kernel).zip(&self.slopes) {
                *v = (*v + r) / (crop * k.norm_sqr() + slope_weight * slopes + border);
            }
            let mut spectrum = right.clone();
            scene = inverse(&self.fft, &mut right);
            spectrum.iter_mut().zip(&self.kernel).for_each(|(v, k)| *v *= k);
            image = inverse(&self.fft, &mut spectrum);
            crop_price += &(&image - &whole);
            border_price += &(&scene - &inside);
            let own = steps(&scene);
            for a in 0..2 {
                slope_price[a] += &(&own[a] - &split[a]);
            }
            progress.advance(1);
        }
        Ok(part(scene.view(), 0..scene_rows, 0..scene_columns).to_owned())
    }
}

/// Steps to the next row and to the next column; the last is followed by the first.
fn steps(x: &Array2<f32>) -> [Array2<f32>; 2] {
    let (rows, columns) = x.dim();
    [
        Array2::from_shape_fn((rows, columns), |(i, j)| x[[(i + 1) % rows, j]] - x[[i, j]]),
        Array2::from_shape_fn((rows, columns), |(i, j)| x[[i, (j + 1) % columns]] - x[[i, j]]),
    ]
}

/// The adjoint of [`steps`].
fn steps_adjoint([down, right]: &[Array2<f32>; 2]) -> Array2<f32> {
    let (rows, columns) = down.dim();
    Array2::from_shape_fn((rows, columns), |(i, j)| {
        down[[(i + rows - 1) % rows, j]] - down[[i, j]] + right[[i, (j + columns - 1) % columns]] - right[[i, j]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_have_their_adjoint() {
        let x = Array2::from_shape_fn((7, 9), |(i, j)| ((i * 5 + j * 3) % 7) as f32);
        let y = [3, 4].map(|k| Array2::from_shape_fn((7, 9), |(i, j)| ((i * k + j) % 5) as f32));
        let a: f32 = steps(&x).iter().zip(&y).map(|(s, y)| (s * y).sum()).sum();
        // Sums of whole numbers.
        assert_eq!(a, (x * steps_adjoint(&y)).sum());
    }
}
