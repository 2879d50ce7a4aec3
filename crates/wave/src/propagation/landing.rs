//! Where all the light of an element lands on the sensor's plane, coarsely: its veil as well as its image.
//!
//! The aperture is cut into overlapping tiles whose squared windows add up to one everywhere, so that no power is
//! lost or counted twice. The spectrum of a tile says how much power leaves it in which direction, and each part
//! goes to the plane as a ray from the middle of the tile. Phases between tiles are left out: what interferes over
//! less than the size of a tile and its diffraction is not resolved. That is sqrt(wavelength * distance) at best,
//! 35 um for a lens of 2.4 mm focal length, and for what is finer there is [`Fold`](crate::Fold).

use std::f64::consts::PI;

use ndarray::Array2;
use num_complex::Complex32;
use rustfft::FftPlanner;

use super::{Aperture, PlaneWave};
use crate::error::{Result, WaveError};
use crate::kernels::cis_all;

/// Sites an axis of a tile: 22 um at a pitch of 350 nm, two thirds of the best size for 2.4 mm, and a power of two.
pub(super) const TILE: usize = 64;
/// From one tile to the next [sites]: sine windows that overlap by half add up to one when squared.
pub(super) const HOP: usize = TILE / 2;
/// Most cells of a map.
const MOST_CELLS: usize = 1 << 24;

/// A map of squares on the sensor's plane, with the axis of the element in the middle of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandingGrid {
    /// Edge of a square (um).
    pub cell_um: f64,
    /// Squares an axis.
    pub cells: usize,
    /// Distance of the plane from the pillar tops (um).
    pub distance_um: f64,
}

/// The power of one element on the sensor's plane (um^2, in units of |E_inc|^2).
#[derive(Clone, Debug, PartialEq)]
pub struct Landing {
    pub grid: LandingGrid,
    /// Power in each square, shape `[cells, cells]`, row index along +y, column index along +x.
    pub power_um2: Array2<f64>,
    /// Power that travels towards the plane and lands outside of the map.
    pub beyond_um2: f64,
    /// Power in spatial frequencies that do not travel: too fine for the wavelength.
    pub evanescent_um2: f64,
}

impl Landing {
    /// Of an element in a plane wave. Frequencies of a lattice are known but for multiples of 1 / pitch: each is taken
    /// for the one nearest to `towards`, the sines of the direction that the light is meant to leave in.
    ///
    /// # Errors
    /// If the map is none or too large.
    pub fn of(aperture: &dyn Aperture, wave: &PlaneWave, towards: [f64; 2], grid: LandingGrid) -> Result<Self> {
        grid.check()?;
        let lattice = aperture.lattice();
        let (n, pitch) = (lattice.sites(), lattice.pitch_um());
        let rays = Rays::new(pitch, wave, towards, grid.distance_um);
        let fft = FftPlanner::<f32>::new().plan_fft_forward(TILE);
        let mut work = vec![Complex32::ZERO; fft.get_inplace_scratch_len()];
        let arriving = [wave.sin_x, wave.sin_y].map(|sine| {
            let turns: Vec<f64> = (0..n)
                .map(|i| lattice.coordinate_um(i) * sine / wave.wavelength_um)
                .collect();
            let mut phasors = vec![Complex32::ZERO; n];
            cis_all(&turns, &mut phasors);
            phasors
        });
        let taper: Vec<f32> = (0..TILE)
            .map(|i| (PI * (i as f64 + 0.5) / TILE as f64).sin() as f32)
            .collect();
        let mut landing = Self {
            grid,
            power_um2: Array2::zeros((grid.cells, grid.cells)),
            beyond_um2: 0.0,
            evanescent_um2: 0.0,
        };
        // Rows of the tiles of one strip; half of them serve the next strip as well.
        let mut strip = vec![Complex32::ZERO; TILE * n];
        let mut tile = vec![Complex32::ZERO; TILE * TILE];
        let mut turned = tile.clone();
        let scale = pitch * pitch / (TILE * TILE) as f64;
        // The first strip begins half a tile before the lattice, so that every site is in two of them.
        for first_row in (-(HOP as i64)..n as i64).step_by(HOP) {
            strip.copy_within(HOP * n.., 0);
            for (k, row) in strip.chunks_exact_mut(n).enumerate().skip(HOP) {
                let iy = first_row + k as i64;
                if !(0..n as i64).contains(&iy) {
                    row.fill(Complex32::ZERO);
                    continue;
                }
                aperture.fill_row(iy as usize, row);
                let wy = arriving[1][iy as usize];
                for (t, wx) in row.iter_mut().zip(&arriving[0]) {
                    *t *= wx * wy;
                }
            }
            for first in (-(HOP as i64)..n as i64).step_by(HOP) {
                if !cut(&strip, n, first, &taper, &mut tile) {
                    continue;
                }
                fft.process_with_scratch(&mut tile, &mut work);
                transpose(&tile, &mut turned);
                fft.process_with_scratch(&mut turned, &mut work);
                let middle = [first, first_row]
                    .map(|i| lattice.coordinate_um(0) + (i as f64 + 0.5 * (TILE as f64 - 1.0)) * pitch);
                landing.add(&turned, &rays, middle, scale);
            }
        }
        Ok(landing)
    }

    /// All power that travels towards the plane (um^2).
    pub fn travelling_um2(&self) -> f64 {
        self.power_um2.sum() + self.beyond_um2
    }

    fn add(&mut self, spectrum: &[Complex32], rays: &Rays, middle_um: [f64; 2], scale: f64) {
        let grid = self.grid;
        let cells = self.power_um2.as_slice_mut().expect("made in standard layout");
        let half = 0.5 * grid.cells as f64;
        for (value, shift) in spectrum.iter().zip(&rays.shift_um) {
            let power = f64::from(value.norm_sqr()) * scale;
            let Some([dx, dy]) = shift else {
                self.evanescent_um2 += power;
                continue;
            };
            let x = (middle_um[0] + dx) / grid.cell_um + half;
            let y = (middle_um[1] + dy) / grid.cell_um + half;
            let inside = x >= 0.0 && y >= 0.0 && x < grid.cells as f64 && y < grid.cells as f64;
            if inside {
                cells[y as usize * grid.cells + x as usize] += power;
            } else {
                self.beyond_um2 += power;
            }
        }
    }
}

impl LandingGrid {
    pub(super) fn check(&self) -> Result<()> {
        let sane =
            self.cell_um > 0.0 && self.distance_um > 0.0 && self.cell_um.is_finite() && self.distance_um.is_finite();
        if sane && self.cells > 0 && self.cells.saturating_mul(self.cells) <= MOST_CELLS {
            return Ok(());
        }
        Err(WaveError::Map {
            grid: *self,
            most: MOST_CELLS,
        })
    }
}

/// How far the light of each frequency of a tile lands from the tile, in the order of a transposed transform.
struct Rays {
    /// Along x and y (um); none for light that does not travel.
    shift_um: Vec<Option<[f64; 2]>>,
}

impl Rays {
    fn new(pitch_um: f64, wave: &PlaneWave, towards: [f64; 2], distance_um: f64) -> Self {
        // Sines of the bins of one axis, each moved by whole periods to the one nearest to where light should go.
        let period = wave.wavelength_um / pitch_um;
        let sines = towards.map(|sine| {
            (0..TILE)
                .map(|k| {
                    let own = k as f64 / TILE as f64 * period;
                    own + ((sine - own) / period).round() * period
                })
                .collect::<Vec<_>>()
        });
        let shift_um = (0..TILE * TILE)
            .map(|i| {
                let [sx, sy] = [sines[0][i / TILE], sines[1][i % TILE]];
                let cosine2 = 1.0 - sx * sx - sy * sy;
                (cosine2 > 0.0).then(|| [sx, sy].map(|s| distance_um * s / cosine2.sqrt()))
            })
            .collect();
        Self { shift_um }
    }
}

/// Cuts a tapered tile out of a strip of rows of `n` sites. Whether there is light in it.
pub(super) fn cut(strip: &[Complex32], n: usize, first: i64, taper: &[f32], tile: &mut [Complex32]) -> bool {
    let mut light = false;
    for ((row, out), wy) in strip.chunks_exact(n).zip(tile.chunks_exact_mut(TILE)).zip(taper) {
        for ((k, to), wx) in out.iter_mut().enumerate().zip(taper) {
            let at = first + k as i64;
            *to = match usize::try_from(at).ok().and_then(|at| row.get(at)) {
                Some(t) => t * (wx * wy),
                None => Complex32::ZERO,
            };
            light |= *to != Complex32::ZERO;
        }
    }
    light
}

pub(super) fn transpose(tile: &[Complex32], turned: &mut [Complex32]) {
    for (i, row) in tile.chunks_exact(TILE).enumerate() {
        for (j, value) in row.iter().enumerate() {
            turned[j * TILE + i] = *value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propagation::aperture::sites_inside;
    use crate::{Accuracy, Fold, PhaseFunction, Propagator, Scratch, Window};
    use metalith_core::Lattice;
    use rand::{Rng, SeedableRng};
    use std::f64::consts::TAU;

    /// Powers of a few hundred thousand single-precision amplitudes, added in double precision.
    const ROUNDING: f64 = 1e-5;

    fn grid(cell_um: f64, cells: usize, distance_um: f64) -> LandingGrid {
        LandingGrid {
            cell_um,
            cells,
            distance_um,
        }
    }

    #[test]
    fn no_power_is_lost_and_a_prism_sends_it_where_its_ray_goes() {
        /// Half a square of the map, and the mean over directions that one tile spreads to.
        const PLACE_UM: f64 = 3.0;
        let lattice = Lattice::covering(120_000, 350).unwrap();
        let sine = 0.3;
        let prism = PhaseFunction {
            lattice,
            radius_um: 60.0,
            amplitude: 0.8,
            phase_rad: |x: f64, _| TAU * sine * x / 0.53,
        };
        let grid = grid(2.0, 400, 500.0);
        let found = Landing::of(&prism, &PlaneWave::normal(0.53), [sine, 0.0], grid).unwrap();
        let all = found.travelling_um2() + found.evanescent_um2;
        let sites = (0..lattice.sites()).map(|iy| sites_inside(&lattice, prism.radius_um, iy).len());
        let power = (prism.amplitude * lattice.pitch_um()).powi(2) * sites.sum::<usize>() as f64;
        assert!((all / power - 1.0).abs() < ROUNDING);
        let mut mean = [0.0; 2];
        for ((iy, ix), p) in found.power_um2.indexed_iter() {
            for (m, i) in mean.iter_mut().zip([ix, iy]) {
                *m += p * (i as f64 + 0.5 - 200.0) * 2.0 / found.power_um2.sum();
            }
        }
        let ray = 500.0 * sine / (1.0_f64 - sine * sine).sqrt();
        assert!(
            (mean[0] - ray).abs() < PLACE_UM && mean[1].abs() < PLACE_UM,
            "{mean:?}, {ray}"
        );
    }

    /// Independent phases have a flat spectrum: the share that travels is that of the disc of radius 1 / wavelength in
    /// the square of edge 1 / pitch.
    #[test]
    fn what_is_finer_than_the_wavelength_does_not_travel() {
        /// Of 10^5 independent sites: three standard deviations.
        const CHANCE: f64 = 0.01;
        let lattice = Lattice::covering(110_000, 350).unwrap();
        let n = lattice.sites();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let phase = Array2::from_shape_fn((n, n), |_| TAU * rng.random::<f64>());
        let index = |v: f64| ((v - lattice.coordinate_um(0)) / 0.35).round() as usize;
        let rough = PhaseFunction {
            lattice,
            radius_um: 80.0,
            amplitude: 1.0,
            phase_rad: |x: f64, y: f64| phase[[index(y), index(x)]],
        };
        let found = Landing::of(&rough, &PlaneWave::normal(0.8), [0.0; 2], grid(50.0, 40, 500.0)).unwrap();
        let share = found.travelling_um2() / (found.travelling_um2() + found.evanescent_um2);
        let disc = PI * (0.35_f64 / 0.8).powi(2);
        assert!((share - disc).abs() < CHANCE, "{share} is not {disc}");
    }

    /// A lens of two levels sends its light to several orders; squares of the map hold what wave optics brings there.
    #[test]
    fn squares_hold_what_wave_optics_brings_there() {
        /// Of the power in the brightest ring of squares: rays leave out interference between tiles.
        const RAYS: f64 = 0.1;
        let lattice = Lattice::covering(140_000, 350).unwrap();
        let (z, um) = (336.0, 0.53);
        let lens = PhaseFunction {
            lattice,
            radius_um: 70.0,
            amplitude: 1.0,
            phase_rad: |x: f64, y: f64| {
                let turns = -((x * x + y * y + z * z).sqrt() - z) / um;
                if turns.rem_euclid(1.0) < 0.5 { 0.0 } else { PI }
            },
        };
        let wave = PlaneWave::normal(um);
        let cell = 42.0;
        let map = Landing::of(&lens, &wave, [0.0; 2], grid(cell, 5, z)).unwrap();
        let window = Window {
            centre_um: [0.0; 2],
            step_um: 0.35,
            samples: 600,
            distance_um: z,
        };
        let fold = Fold::plan(lattice, 70.0, um, window, Accuracy::Accurate).unwrap();
        let field = fold.field(&lens, &wave, &mut Scratch::default()).unwrap();
        let per_cell = (cell / 0.35).round() as usize;
        let exact = Array2::from_shape_fn((5, 5), |(iy, ix)| {
            let part = metalith_core::part(
                field.values.view(),
                iy * per_cell..(iy + 1) * per_cell,
                ix * per_cell..(ix + 1) * per_cell,
            );
            part.iter().map(|e| f64::from(e.norm_sqr())).sum::<f64>() * 0.35 * 0.35
        });
        let largest = exact.iter().copied().fold(0.0, f64::max);
        for (a, b) in map.power_um2.iter().zip(&exact) {
            assert!((a - b).abs() < RAYS * largest, "{}\n{exact}", map.power_um2);
        }
    }
}
