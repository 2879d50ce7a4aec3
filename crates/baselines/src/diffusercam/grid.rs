//! Grids of places of the scene: one for each pixel of the sensor in the simulation, every second in the restoration.

use metalith_imaging::SceneView;
use metalith_imaging::scene::averaged;
use metalith_wave::kernels::{FftScratch, SquareFft, fft_size};
use ndarray::Array2;
use num_complex::Complex32;
use rayon::prelude::*;

/// Steps of the grid over the pixels of a scene from which on these are averaged: between places some would not be looked at.
const FINER: f64 = 1.2;

/// A scene on a square grid whose step moves the caustic by one pixel, and the convolutions with it.
pub(crate) struct FineGrid {
    /// Steps from the middle of the scene to its border.
    half: [usize; 2],
    /// Tangent of a step.
    step: f64,
    frame: [usize; 2],
    /// Place of the sensor's first pixel in the whole image.
    first: [i64; 2],
    fft: SquareFft,
    /// Kernels by channel and plane of the scene.
    kernels: Vec<Vec<Vec<Complex32>>>,
}

impl FineGrid {
    /// Grid for a scene, the tangent of a step, rows and columns of the sensor, and kernels by channel and plane of the
    /// scene, all of one shape.
    pub(crate) fn new(view: &SceneView, step: f64, frame: [usize; 2], kernels: &[Vec<Array2<f32>>]) -> Self {
        let half = half_of(view, step);
        let (rows, columns) = kernels[0][0].dim();
        let kernel = [rows, columns];
        let first = [0, 1].map(|a| (half[a] + kernel[a] / 2) as i64 - (frame[a] / 2) as i64);
        let fft = SquareFft::new(fft_size(Self::places(view, step, kernel)));
        let spectrum = |k: &Array2<f32>| fft.of_plane(k, &mut FftScratch::default());
        Self {
            half,
            step,
            frame,
            first,
            kernels: kernels
                .par_iter()
                .map(|own| own.iter().map(spectrum).collect())
                .collect(),
            fft,
        }
    }

    /// Places along the longer axis that hold a scene and its convolution with kernels of these rows and columns.
    pub(crate) fn places(view: &SceneView, step: f64, kernel: [usize; 2]) -> usize {
        let half = half_of(view, step);
        (2 * half[0] + kernel[0]).max(2 * half[1] + kernel[1])
    }

    /// A plane of the scene at the places of the grid.
    pub(crate) fn sampled(&self, plane: &Array2<f32>, view: &SceneView) -> Array2<f32> {
        if self.step > FINER * view.pixel() {
            let view = view.no_finer(self.step);
            return sampled(&averaged(plane, &view), &view, self.half, self.step);
        }
        sampled(plane, view, self.half, self.step)
    }

    /// Frames of all channels from planes of the scene on the grid.
    pub(crate) fn frames(&self, planes: &[Array2<f32>]) -> Vec<Array2<f32>> {
        let spectra: Vec<Vec<Complex32>> = planes
            .par_iter()
            .map(|p| self.fft.of_plane(p, &mut FftScratch::default()))
            .collect();
        self.kernels
            .par_iter()
            .map(|own| {
                let mut sum = vec![Complex32::ZERO; self.fft.entries()];
                for (kernel, plane) in own.iter().zip(&spectra) {
                    sum.iter_mut()
                        .zip(kernel)
                        .zip(plane)
                        .for_each(|((s, k), p)| *s += k * p);
                }
                let whole = self
                    .fft
                    .to_plane(&mut sum, (self.fft.size(), self.fft.size()), &mut FftScratch::default());
                let n = self.fft.size() as i64;
                let [rows, columns] = self.frame;
                Array2::from_shape_fn((rows, columns), |(y, x)| {
                    let at = [y as i64 + self.first[0], x as i64 + self.first[1]];
                    if at.iter().all(|v| (0..n).contains(v)) {
                        whole[[at[0] as usize, at[1] as usize]]
                    } else {
                        0.0
                    }
                })
            })
            .collect()
    }
}

/// The scene at every second place, and what it sends to the pixels of one channel in each square of two by two.
pub(crate) struct CoarseGrid {
    half: [usize; 2],
    step: f64,
    /// Places of the squares that count the channel.
    places: Vec<[usize; 2]>,
    /// Rows and columns of squares.
    pub data: [usize; 2],
    /// Values an axis of the transforms.
    pub size: usize,
    /// Kernel from a place of the scene to the squares, around the first one.
    pub kernel: Array2<f32>,
}

impl CoarseGrid {
    /// Grid for the kernel of a grey surface on the pixels of a sensor, and the pixels of a square that count the
    /// channel.
    pub(crate) fn new(fine: &FineGrid, grey: &Array2<f32>, places: &[[usize; 2]]) -> Self {
        let half = fine.half.map(|h| h / 2);
        // The finer grid and this one have their middles together: its first place is that of `skipped`.
        let skipped = [0, 1].map(|a| fine.half[a] as i64 - 2 * half[a] as i64);
        let data = fine.frame.map(|n| n / 2);
        let (rows, columns) = grey.dim();
        // Squares that a place sends light to, from the place's own index on.
        let range = |a: usize, n: usize| {
            let low = (-fine.first[a] + skipped[a] - 3).div_euclid(2);
            [low, low + n as i64 / 2 + 4]
        };
        let ranges = [range(0, rows), range(1, columns)];
        let size = (0..2).map(|a| {
            let last = (ranges[a][1] + 2 * half[a] as i64 + 1).max(data[a] as i64);
            (last - ranges[a][0].min(0)) as usize
        });
        let size = fft_size(size.max().unwrap_or(1));
        let mut kernel = Array2::<f32>::zeros((size, size));
        let share = 1.0 / places.len() as f32;
        let wrapped = |i: i64| i.rem_euclid(size as i64) as usize;
        for my in ranges[0][0]..ranges[0][1] {
            for mx in ranges[1][0]..ranges[1][1] {
                let mut sum = 0.0;
                for place in places {
                    for (dy, wy) in [(-1, 0.5), (0, 1.0), (1, 0.5)] {
                        for (dx, wx) in [(-1, 0.5), (0, 1.0), (1, 0.5)] {
                            // Between the places of this grid the scene changes linearly.
                            let of =
                                |m: i64, a: usize, d: i64| 2 * m + place[a] as i64 + fine.first[a] - skipped[a] - d;
                            let (qy, qx) = (of(my, 0, dy), of(mx, 1, dx));
                            if (0..rows as i64).contains(&qy) && (0..columns as i64).contains(&qx) {
                                sum += wy * wx * grey[[qy as usize, qx as usize]];
                            }
                        }
                    }
                }
                kernel[[wrapped(my), wrapped(mx)]] += share * sum;
            }
        }
        Self {
            half,
            step: 2.0 * fine.step,
            places: places.to_vec(),
            data,
            size,
            kernel,
        }
    }

    /// Rows and columns of the scene on this grid.
    pub(crate) fn scene(&self) -> [usize; 2] {
        self.half.map(|h| 2 * h + 1)
    }

    /// A plane of the scene at the places of the grid.
    pub(crate) fn sampled(&self, plane: &Array2<f32>, view: &SceneView) -> Array2<f32> {
        sampled(plane, view, self.half, self.step)
    }

    /// Light of the channel in each square: the mean of the pixels that count it.
    pub(crate) fn data(&self, light: &Array2<f32>) -> Array2<f32> {
        let share = 1.0 / self.places.len() as f32;
        Array2::from_shape_fn((self.data[0], self.data[1]), |(y, x)| {
            let pixels = self.places.iter().map(|p| light[[2 * y + p[0], 2 * x + p[1]]]);
            share * pixels.sum::<f32>()
        })
    }

    /// Mean variance of the light of a square, for how much each pixel is to be trusted.
    pub(crate) fn variance(&self, inverse_variance: &Array2<f32>) -> f64 {
        let known = inverse_variance.iter().filter(|t| **t > 0.0);
        let (sum, count) = known.fold((0.0, 0.0), |(s, n), t| (s + 1.0 / f64::from(*t), n + 1.0));
        sum / f64::max(count, 1.0) / self.places.len() as f64
    }
}

/// A plane on a grid of places of the scene as a picture of it, by cubics through four places (Catmull and Rom).
pub(crate) fn on_scene(plane: &Array2<f32>, step: f64, view: &SceneView) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    let weights = |place: f64, n: usize| {
        let i = place.floor();
        let t = place - i;
        let all = [
            0.5 * (-t + 2.0 * t * t - t * t * t),
            0.5 * (2.0 - 5.0 * t * t + 3.0 * t * t * t),
            0.5 * (t + 4.0 * t * t - 3.0 * t * t * t),
            0.5 * (t * t * t - t * t),
        ];
        let at = move |k: usize| (i as i64 + k as i64 - 1).clamp(0, n as i64 - 1) as usize;
        [0, 1, 2, 3].map(|k| (at(k), all[k] as f32))
    };
    Array2::from_shape_fn((view.rows, view.columns), |(y, x)| {
        let [tx, ty] = view.tangents(y as f64, x as f64);
        let across = weights(tx / step + (columns / 2) as f64, columns);
        let down = weights(ty / step + (rows / 2) as f64, rows);
        down.iter()
            .map(|(i, wy)| wy * across.iter().map(|(j, wx)| wx * plane[[*i, *j]]).sum::<f32>())
            .sum()
    })
}

/// Steps from the middle of a scene to its border.
fn half_of(view: &SceneView, step: f64) -> [usize; 2] {
    [view.rows, view.columns].map(|n| (0.5 * n as f64 * view.pixel() / step).floor() as usize)
}

/// Between its pixels a plane changes linearly; beyond its border there is no light.
fn sampled(plane: &Array2<f32>, view: &SceneView, half: [usize; 2], step: f64) -> Array2<f32> {
    let at = |y: i64, x: i64| {
        if y >= 0 && x >= 0 && y < view.rows as i64 && x < view.columns as i64 {
            plane[[y as usize, x as usize]]
        } else {
            0.0
        }
    };
    Array2::from_shape_fn((2 * half[0] + 1, 2 * half[1] + 1), |(i, j)| {
        let tangent = |k: usize, a: usize| (k as f64 - half[a] as f64) * step;
        let [row, column] = view.place([tangent(j, 1), tangent(i, 0)]);
        let (y, x) = (row.floor(), column.floor());
        let (s, t) = ((row - y) as f32, (column - x) as f32);
        let (y, x) = (y as i64, x as i64);
        (1.0 - s) * ((1.0 - t) * at(y, x) + t * at(y, x + 1)) + s * ((1.0 - t) * at(y + 1, x) + t * at(y + 1, x + 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes of one pixel, three and a half of which are a step: a place sees their mean, and not the stripe that it is on.
    #[test]
    fn scenes_that_are_finer_than_the_steps_are_averaged() {
        /// Tolerance of half of a stripe that a box has more of one kind.
        const UNEVEN: f32 = 0.16;
        let view = SceneView {
            rows: 200,
            columns: 200,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        };
        let stripes = Array2::from_shape_fn((200, 200), |(_, x)| (x % 2) as f32);
        let grid = FineGrid::new(&view, 0.02, [10, 10], &[vec![Array2::ones((1, 1))]]);
        let seen = grid.sampled(&stripes, &view);
        assert!(seen.iter().all(|v| (v - 0.5).abs() < UNEVEN), "{seen}");
    }
}
