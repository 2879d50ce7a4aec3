//! The error of a restored picture, expected from the spectrum of its scene.
//!
//! A restoration by Tikhonov's method is linear. Of each frequency of a scene, in each cell of the field and each plane of colour,
//! it loses a share of the power; what it makes of noise comes to that, whatever power the scene has. Both are found on one random
//! scene ([`crate::Rehearsal`]). The shares times the power that scenes have, and the noise of as much light as they have, are the
//! expected error.

use std::ops::Range;

use metalith_wave::camera::Noise;
use metalith_wave::kernels::{fft_size, mirrored};
use ndarray::{Array2, Array3, Axis};
use num_complex::Complex32;
use rayon::prelude::*;

use crate::Zone;
use crate::operator::{FftScratch, SquareFft};
use crate::restore::SceneStatistics;

/// Cells an axis of the field that power is told apart in, two for each third of it. Within a zone what is lost changes, and
/// where a scene happens to be bright in it would decide: with whole zones the forecast of twelve photographs differs by up to
/// 0.6 dB with the seed of the random scene, with these by up to 0.3 dB. Cells of half the size tell the bands of frequency
/// apart no better.
const CELLS: usize = 6;

/// Zones of which the field is made.
const ZONES: [Zone; 3] = [Zone::Centre, Zone::Edge, Zone::Corner];

/// Index into [`ZONES`] of a cell, row by row.
fn zone_of(cell: usize) -> usize {
    let middle = [cell / CELLS, cell % CELLS].map(|i| i * 3 / CELLS == 1);
    2 - middle.iter().filter(|m| **m).count()
}

/// Rows and columns of each cell of a picture, row by row.
fn cells(rows: usize, columns: usize) -> impl Iterator<Item = [Range<usize>; 2]> {
    let part = |n: usize, k: usize| k * n / CELLS..(k + 1) * n / CELLS;
    (0..CELLS * CELLS).map(move |i| [part(rows, i / CELLS), part(columns, i % CELLS)])
}

/// Upper ends of bands of frequency (cycles a pixel): half of the power of a restoration is lost somewhere between the fifth and
/// the tenth, by the place in the field. The last one holds all that is finer.
const BANDS: [f64; 14] = [
    0.008, 0.016, 0.03, 0.045, 0.06, 0.08, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.4, 1.0,
];

/// Powers of a plane by band.
type Bands = [f64; BANDS.len()];

/// Power of a picture, mean square of its light: by cell of the field, plane of colour and band of frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenePower {
    cells: Vec<Vec<Bands>>,
    /// Mean light by cell of the field.
    light: Vec<f64>,
}

impl ScenePower {
    /// Of linear sRGB `[row, column, colour]`.
    pub fn of(picture: &Array3<f64>) -> Self {
        let colours = picture.axis_iter(Axis(2));
        let planes: Vec<Array2<f32>> = colours.map(|plane| plane.mapv(|v| v as f32)).collect();
        let independent = SceneStatistics::colours().independent(&planes);
        let bands: Vec<Vec<Bands>> = independent.par_iter().map(bands).collect();
        Self {
            cells: (0..CELLS * CELLS)
                .map(|cell| bands.iter().map(|b| b[cell]).collect())
                .collect(),
            light: means_by_cell(picture, |v| v),
        }
    }

    /// Expected of photographs, the same everywhere.
    pub fn natural() -> Self {
        let planes = SceneStatistics::colours().band_powers(&BANDS);
        Self {
            cells: vec![planes; CELLS * CELLS],
            light: vec![SceneStatistics::mean_light(); CELLS * CELLS],
        }
    }

    /// The mean over pictures; none of none.
    pub fn mean(all: &[Self]) -> Option<Self> {
        let (first, rest) = all.split_first()?;
        let mut sum = first.clone();
        for one in rest {
            sum.values_mut().zip(one.values()).for_each(|(a, b)| *a += b);
        }
        sum.values_mut().for_each(|v| *v /= all.len() as f64);
        Some(sum)
    }

    /// Mean square over the colours of a picture by cell, each power times its share of these; all of it of none.
    fn squares(&self, shares: Option<&Self>) -> Vec<f64> {
        let sizes = SceneStatistics::colours().sizes();
        let of_plane = |cell: usize, plane: usize| -> f64 {
            let power = self.cells[cell][plane];
            match shares {
                Some(shares) => power.iter().zip(&shares.cells[cell][plane]).map(|(p, s)| p * s).sum(),
                None => power.iter().sum(),
            }
        };
        let of_cell = |cell: usize| {
            let planes = sizes.iter().enumerate();
            planes.map(|(plane, size)| size * of_plane(cell, plane)).sum::<f64>() / sizes.len() as f64
        };
        (0..CELLS * CELLS).map(of_cell).collect()
    }

    fn values(&self) -> impl Iterator<Item = &f64> {
        self.cells.iter().flatten().flatten().chain(&self.light)
    }

    fn values_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.cells.iter_mut().flatten().flatten().chain(&mut self.light)
    }
}

/// What a camera and a restoration lose of any scene, and what they make of noise.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// Power of the error without noise over that of the scene.
    lost: ScenePower,
    /// Mean squared error of the random scene without noise over the sum of the powers of its bands, by zone of [`ZONES`]: bands are
    /// independent over a whole picture, in a part of it they have some of what is beside it.
    of_bands: [f64; ZONES.len()],
    /// Power that noise has in the picture, by cell of the field.
    noise: Vec<f64>,
    /// Mean light of the random scene by cell of the field.
    light: Vec<f64>,
    exposed: Exposed,
}

/// How much noise there is for how much light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exposed {
    noise: Noise,
    /// Mean signal of the frame of the random scene, of full scale.
    signal: f64,
}

impl Exposed {
    /// Of the noise of a sensor, and the mean signal that a scene gave.
    pub fn of(noise: Noise, signal: f64) -> Self {
        Self { noise, signal }
    }

    /// Variance of the noise of a scene that is so many times as bright, over that of the random scene.
    fn against(&self, brighter: f64) -> f64 {
        let own = self.noise.variance(self.signal);
        match own > 0.0 {
            true => self.noise.variance(self.signal * brighter) / own,
            false => 1.0,
        }
    }
}

impl Forecast {
    /// From a scene, the picture that was restored of it without noise, and what noise adds to that, all linear sRGB
    /// `[row, column, colour]`.
    pub(crate) fn between(truth: &Array3<f64>, picture: &Array3<f64>, noise: &Array3<f64>, exposed: Exposed) -> Self {
        let error = picture - truth;
        let mut lost = ScenePower::of(&error);
        let found = zone_means(&means_by_cell(&error, |v| v * v));
        let bands = zone_means(&lost.squares(None));
        let scene = ScenePower::of(truth);
        lost.values_mut()
            .zip(scene.values())
            .for_each(|(lost, scene)| *lost /= scene.max(f64::MIN_POSITIVE));
        Self {
            lost,
            of_bands: std::array::from_fn(|zone| match bands[zone] {
                0.0 => 1.0,
                all => found[zone] / all,
            }),
            noise: means_by_cell(noise, |v| v * v),
            light: scene.light,
            exposed,
        }
    }

    /// Expected PSNR of linear light (dB) in all zones ([`Zone::ALL`]) of scenes with this power: that of the mean squared
    /// error.
    pub fn psnr_linear_db(&self, scenes: &ScenePower) -> Vec<f64> {
        let noise = |cell: usize| {
            let brighter = scenes.light[cell] / self.light[cell].max(f64::MIN_POSITIVE);
            self.noise[cell] * self.exposed.against(brighter)
        };
        let lost = scenes.squares(Some(&self.lost));
        let errors = (0..CELLS * CELLS).map(|cell| self.of_bands[zone_of(cell)] * lost[cell] + noise(cell));
        let errors: Vec<f64> = errors.collect();
        let whole = errors.iter().sum::<f64>() / errors.len() as f64;
        let zones = zone_means(&errors);
        [whole]
            .iter()
            .chain(&zones)
            .map(|error| -10.0 * error.log10())
            .collect()
    }
}

/// Means over the cells of each zone of [`ZONES`].
fn zone_means(cells: &[f64]) -> [f64; ZONES.len()] {
    let mut sums = [(0.0, 0.0); ZONES.len()];
    for (cell, value) in cells.iter().enumerate() {
        let (sum, count) = &mut sums[zone_of(cell)];
        (*sum, *count) = (*sum + value, *count + 1.0);
    }
    sums.map(|(sum, count)| sum / count)
}

/// Mean of what is made of each value of a picture over the pixels and colours of each cell.
fn means_by_cell(picture: &Array3<f64>, of: impl Fn(f64) -> f64) -> Vec<f64> {
    let (rows, columns, _) = picture.dim();
    let mean = |[y, x]: [Range<usize>; 2]| {
        let values = metalith_core::part(picture.view(), y, x);
        values.iter().map(|v| of(*v)).sum::<f64>() / values.len().max(1) as f64
    };
    cells(rows, columns).map(mean).collect()
}

/// Mean squares of a plane by cell and band. The plane is continued by its mirror images on all sides, so that its borders are
/// no edges.
fn bands(plane: &Array2<f32>) -> Vec<Bands> {
    let (rows, columns) = plane.dim();
    let size = fft_size(2 * rows.max(columns));
    let fft = SquareFft::new(size);
    let mut scratch = FftScratch::default();
    let from = [(size - rows) / 2, (size - columns) / 2];
    let source = |i: usize, from: usize, n: usize| mirrored(i as i64 - from as i64, n);
    let mut square = vec![0.0; size * size];
    for (iy, line) in square.chunks_exact_mut(size).enumerate() {
        let row = plane.row(source(iy, from[0], rows));
        for (ix, v) in line.iter_mut().enumerate() {
            *v = row[source(ix, from[1], columns)];
        }
    }
    let mut spectrum = vec![Complex32::ZERO; fft.entries()];
    fft.forward(&mut square, size, &mut spectrum, &mut scratch);
    let cycles = |k: usize| k.min(size - k) as f64 / size as f64;
    let mut powers = vec![[0.0; BANDS.len()]; CELLS * CELLS];
    let mut lower = 0.0;
    for (band, upper) in BANDS.into_iter().enumerate() {
        let inside = |i: usize| (lower..upper).contains(&cycles(i / size).hypot(cycles(i % size)));
        let mut part: Vec<Complex32> = spectrum
            .iter()
            .enumerate()
            .map(|(i, v)| if inside(i) { *v } else { Complex32::ZERO })
            .collect();
        fft.inverse(&mut part, &mut square, size, &mut scratch);
        for (powers, [y, x]) in powers.iter_mut().zip(cells(rows, columns)) {
            let count = (y.len() * x.len()).max(1);
            let lines = y.map(|iy| &square[(iy + from[0]) * size + from[1]..][x.clone()]);
            let sum: f64 = lines.flatten().map(|v| f64::from(*v).powi(2)).sum();
            powers[band] = sum / count as f64;
        }
        lower = upper;
    }
    powers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneView;

    fn random(seed: u64, rows: usize, columns: usize) -> Array3<f64> {
        let view = SceneView {
            rows,
            columns,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        };
        let planes = SceneStatistics::colours().random_scene(&view, seed);
        Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| f64::from(planes[c][[y, x]]))
    }

    /// Noise of reading alone.
    fn exposed() -> Exposed {
        let noise = Noise {
            photon: 0.0,
            read: 0.01,
        };
        Exposed::of(noise, 0.1)
    }

    #[test]
    fn power_of_all_bands_is_the_mean_square() {
        /// Products of bands are zero over the whole picture, but for mirrors that do not fit the square of its
        /// transform; not in its parts.
        const TOLERANCE: [f64; 4] = [0.03, 0.1, 0.1, 0.1];
        let picture = random(3, 150, 120);
        let power = ScenePower::of(&picture);
        // Lost altogether.
        let all = Forecast {
            lost: ScenePower {
                cells: vec![vec![[1.0; BANDS.len()]; 3]; CELLS * CELLS],
                light: vec![1.0; CELLS * CELLS],
            },
            of_bands: [1.0; ZONES.len()],
            noise: vec![0.0; CELLS * CELLS],
            light: power.light.clone(),
            exposed: exposed(),
        };
        let scores = crate::scores(&Array3::zeros(picture.dim()), &picture).unwrap();
        for ((got, want), tolerance) in all.psnr_linear_db(&power).iter().zip(scores).zip(TOLERANCE) {
            let ratio = 10f64.powf(0.1 * (want.psnr_linear_db - got));
            assert!((ratio - 1.0).abs() < tolerance, "{got} {want:?}");
        }
    }

    #[test]
    fn natural_power_is_the_mean_over_random_scenes() {
        /// Of forty draws, whose brightest places have much of the power.
        const DRAWS: f64 = 0.15;
        let all: Vec<ScenePower> = (0..40).map(|seed| ScenePower::of(&random(seed, 256, 256))).collect();
        let (found, natural) = (ScenePower::mean(&all).unwrap(), ScenePower::natural());
        for zone in 0..ZONES.len() {
            for plane in 0..3 {
                // Coarser bands than the picture resolves are left out.
                for band in 3..BANDS.len() {
                    let of_zone = |p: &ScenePower| {
                        let cells: Vec<f64> = p.cells.iter().map(|cell| cell[plane][band]).collect();
                        zone_means(&cells)[zone]
                    };
                    let [a, b] = [&found, &natural].map(of_zone);
                    assert!((a / b - 1.0).abs() < DRAWS, "{zone} {plane} {band}: {a} {b}");
                }
            }
        }
    }

    /// What a blur loses is found on one scene, and holds for another of other power.
    #[test]
    fn what_is_lost_of_one_scene_is_lost_of_another() {
        /// Decibels, of one draw.
        const DRAW_DB: f64 = 0.3;
        let blurred = |picture: &Array3<f64>| {
            let (rows, columns, _) = picture.dim();
            Array3::from_shape_fn(picture.dim(), |(y, x, c)| {
                let near = |i: usize, n: usize| [i.saturating_sub(1), i, (i + 1).min(n - 1)];
                let mut sum = 0.0;
                for iy in near(y, rows) {
                    for ix in near(x, columns) {
                        sum += picture[[iy, ix, c]] / 9.0;
                    }
                }
                sum
            })
        };
        let rehearsed = random(1, 160, 160);
        let none = Array3::zeros(rehearsed.dim());
        let forecast = Forecast::between(&rehearsed, &blurred(&rehearsed), &none, exposed());
        // Twice as fine, and of another contrast.
        let fine = random(2, 320, 320);
        let other = Array3::from_shape_fn((160, 160, 3), |(y, x, c)| 0.5 * fine[[2 * y, 2 * x, c]]);
        let scores = crate::scores(&blurred(&other), &other).unwrap();
        for (got, want) in forecast.psnr_linear_db(&ScenePower::of(&other)).iter().zip(scores) {
            assert!((got - want.psnr_linear_db).abs() < DRAW_DB, "{got} {want:?}");
        }
        // Noise is the same whatever the scene: of a smooth one it is all of the error.
        let deviation = 0.03;
        let noise = Array3::from_shape_fn(rehearsed.dim(), |(y, x, c)| {
            if (y + x + c) % 2 == 0 { deviation } else { -deviation }
        });
        let forecast = Forecast::between(&rehearsed, &blurred(&rehearsed), &noise, exposed());
        let smooth = Array3::from_shape_fn(rehearsed.dim(), |(y, x, _)| 0.3 + 1e-3 * (0.02 * (y + x) as f64).sin());
        let scores = crate::scores(&(&blurred(&smooth) + &noise), &smooth).unwrap();
        for (got, want) in forecast.psnr_linear_db(&ScenePower::of(&smooth)).iter().zip(scores) {
            assert!((got - want.psnr_linear_db).abs() < DRAW_DB, "{got} {want:?}");
        }
    }

    /// Photons of a brighter scene make more noise, those of reading do not.
    #[test]
    fn noise_follows_the_light() {
        /// Decibels, of rounding.
        const ROUNDING: f64 = 1e-9;
        let dark = Array3::from_elem((60, 60, 3), 0.1);
        let none = Array3::zeros(dark.dim());
        let noise = none.mapv(|v: f64| v + 0.02);
        let db = |photon: f64, read: f64, light: f64| {
            let exposed = Exposed::of(Noise { photon, read }, 0.05);
            let forecast = Forecast::between(&dark, &dark, &noise, exposed);
            forecast.psnr_linear_db(&ScenePower::of(&(&dark * (light / 0.1))))
        };
        for (photon, read, lost) in [(1e-4, 0.0, 6.0206), (0.0, 1e-3, 0.0), (0.0, 0.0, 0.0)] {
            let (same, brighter) = (db(photon, read, 0.1), db(photon, read, 0.4));
            assert!(
                same.iter().all(|db| (db + 20.0 * 0.02f64.log10()).abs() < ROUNDING),
                "{same:?}"
            );
            let all = same.iter().zip(&brighter);
            // The ratio of the light, to four places.
            assert!(
                all.into_iter().all(|(a, b)| (a - b - lost).abs() < 1e-4),
                "{same:?} {brighter:?}"
            );
        }
    }
}
