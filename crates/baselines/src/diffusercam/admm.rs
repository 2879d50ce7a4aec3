//! A scene from the part of its image that the sensor has, with little total variation: the alternating direction method of
//! multipliers with the crop, the slopes and the borders of the scene split off, so that every step has a closed form (Antipa et
//! al., Optica 5, 1 (2018)). The total variation of `metalith-restoration` shares the splitting of slopes; its kernels change over
//! the field, so that it takes steps of conjugate gradients in place of the closed form.

use metalith_core::{Progress, Result, part};
use metalith_restoration::{ExponentialSlopes, SlopeBorder, SlopeLength, SlopeSplit, squared_frequencies};
use metalith_wave::kernels::{FftScratch, SquareFft};
use ndarray::{Array2, Zip};
use num_complex::Complex32;

use super::grid::CoarseGrid;

/// Settings of a descent: how far a scene is sought, and how strongly slopes are held down.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Descent {
    /// Rounds of all steps.
    pub rounds: usize,
    /// The penalty of slopes over that which follows from the noise.
    pub slopes: f32,
}

impl Descent {
    /// To the end, by the noise.
    pub(crate) const WHOLE: Self = Self {
        rounds: 80,
        slopes: 1.0,
    };
}

/// Slopes of a channel from one place to the next: photographs have 0.043 between neighbouring pixels of 576, and twice
/// as much between every second.
const SLOPES: ExponentialSlopes = ExponentialSlopes { expected: 0.075 };
/// The penalty of what the sensor would have seen beyond its border, over the weight of what it has seen.
const CROP: f64 = 1.0;
/// The penalty of light beyond the scene and below zero, over that of slopes.
const BORDER: f64 = 100.0;
/// Least penalty of slopes, over the weight of what is seen. Noise alone would ask for a hundredth of it; then what the kernel
/// errs by is taken for detail (13.8 dB of linear light for the picture of the test, 19.9 with this).
const LEAST_SLOPES: f64 = 0.03;

/// A channel of a camera whose kernel is the same everywhere.
pub(crate) struct Deconvolution {
    grid: CoarseGrid,
    fft: SquareFft,
    kernel: Vec<Complex32>,
    /// Weights of slopes at each frequency.
    slopes: Vec<f32>,
}

impl Deconvolution {
    /// Deconvolution on a grid.
    pub(crate) fn new(grid: CoarseGrid) -> Self {
        let fft = SquareFft::new(grid.size);
        let n = grid.size;
        let squared: Vec<f32> = squared_frequencies(n).into_iter().map(|s| s as f32).collect();
        Self {
            kernel: fft.of_plane(&grid.kernel, &mut FftScratch::default()),
            slopes: (0..fft.entries()).map(|i| squared[i / n] + squared[i % n]).collect(),
            grid,
            fft,
        }
    }

    /// The grid.
    pub(crate) fn grid(&self) -> &CoarseGrid {
        &self.grid
    }

    /// Image of a scene on the grid in squares of the sensor.
    pub(crate) fn seen(&self, scene: &Array2<f32>) -> Array2<f32> {
        let [rows, columns] = self.grid.data;
        part(self.image(scene).view(), 0..rows, 0..columns).to_owned()
    }

    fn spectrum(&self, plane: &Array2<f32>) -> Vec<Complex32> {
        self.fft.of_plane(plane, &mut FftScratch::default())
    }

    fn plane(&self, spectrum: &mut [Complex32]) -> Array2<f32> {
        let n = self.grid.size;
        self.fft.to_plane(spectrum, (n, n), &mut FftScratch::default())
    }

    fn image(&self, scene: &Array2<f32>) -> Array2<f32> {
        let mut spectrum = self.spectrum(scene);
        spectrum.iter_mut().zip(&self.kernel).for_each(|(v, k)| *v *= k);
        self.plane(&mut spectrum)
    }

    /// The scene that explains the light of the squares, whose noise has this variance.
    ///
    /// # Errors
    /// If the user stopped it.
    pub(crate) fn solve(
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
        let (crop, border) = (CROP as f32, BORDER as f32 * slope_weight);
        let zero = || Array2::<f32>::zeros((n, n));
        let (mut scene, mut image) = (zero(), zero());
        // Dual variables of the splits, in units of their penalties.
        let (mut crop_dual, mut border_dual) = (zero(), zero());
        let mut split = SlopeSplit::new((n, n), SLOPES, SlopeLength::Anisotropic, SlopeBorder::Periodic);
        for _ in 0..descent.rounds {
            progress.check_stopped()?;
            // The whole image: what was seen where there is a sensor, else what the scene says.
            let mut whole = &image + &crop_dual;
            Zip::from(part(whole.view_mut(), 0..rows, 0..columns))
                .and(data)
                .for_each(|w, d| *w = (d + crop * *w) / (1.0 + crop));
            let mut inside = zero();
            let free = &scene + &border_dual;
            let positive = part(free.view(), 0..scene_rows, 0..scene_columns).mapv(|v| v.max(0.0));
            part(inside.view_mut(), 0..scene_rows, 0..scene_columns).assign(&positive);
            // Towards the three of them, less their dual variables.
            let mut right = self.spectrum(&(&whole - &crop_dual));
            right
                .iter_mut()
                .zip(&self.kernel)
                .for_each(|(v, k)| *v *= k.conj() * crop);
            let mut rest = split.goal(&scene) * slope_weight;
            rest.scaled_add(border, &(&inside - &border_dual));
            let rest = self.spectrum(&rest);
            for (((v, r), k), slopes) in right.iter_mut().zip(&rest).zip(&self.kernel).zip(&self.slopes) {
                *v = (*v + r) / (crop * k.norm_sqr() + slope_weight * slopes + border);
            }
            let mut spectrum = right.clone();
            scene = self.plane(&mut right);
            spectrum.iter_mut().zip(&self.kernel).for_each(|(v, k)| *v *= k);
            image = self.plane(&mut spectrum);
            crop_dual += &(&image - &whole);
            border_dual += &(&scene - &inside);
            split.follow(&scene);
            progress.advance(1);
        }
        Ok(part(scene.view(), 0..scene_rows, 0..scene_columns).to_owned())
    }
}
