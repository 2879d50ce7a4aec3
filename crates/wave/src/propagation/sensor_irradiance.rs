//! Irradiance of all the light of an element on the sensor's plane, coarsely: its stray light as well as its image.
//!
//! The aperture is cut into overlapping tiles whose squared windows add up to one everywhere, so that no power is
//! lost or counted twice. A tile is bent towards the plane before it is transformed: its spectrum then says how much power
//! it sends where, as rays from its middle. Phases between tiles are left out: what light is blurred by is wavelength * distance
//! over the edge of a tile, 7 um for a lens of 2.4 mm focal length, and more where light leaves obliquely. For what is finer
//! there is [`FoldedPropagator`](crate::FoldedPropagator).

use metalith_pillars::Lattice;
use ndarray::Array2;
use num_complex::Complex32;

use super::tiles::{DepartureDirections, Tiling, for_tiles, power_scale};
use super::{Aperture, PlaneWave};
use crate::error::{Result, WaveError};
use crate::kernels::cis_all;

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
pub struct SensorIrradiance {
    pub grid: LandingGrid,
    /// Power in each square, shape `[cells, cells]`, row index along +y, column index along +x.
    pub power_um2: Array2<f64>,
    /// Power that travels towards the plane and lands outside of the map.
    pub beyond_um2: f64,
    /// Power in spatial frequencies that do not travel: too fine for the wavelength.
    pub evanescent_um2: f64,
}

impl SensorIrradiance {
    /// Irradiance of an element in a plane wave. Frequencies of a lattice are known but for its orders, on a square one
    /// multiples of 1 / pitch: each is taken for the one nearest to `towards`, the sines of the direction that the
    /// light is meant to leave in.
    ///
    /// # Errors
    /// If the map is none or too large.
    pub fn of(aperture: &dyn Aperture, wave: &PlaneWave, towards: [f64; 2], grid: LandingGrid) -> Result<Self> {
        grid.check()?;
        let lattice = aperture.lattice();
        let n = lattice.sites();
        let tiling = Tiling::at(&lattice, wave.wavelength_um, grid.distance_um);
        let rays = Rays::new(&lattice, tiling, wave, towards, grid.distance_um);
        let arriving = [(0, wave.sin_x), (1, wave.sin_y)].map(|(axis, sine)| {
            let turns: Vec<f64> = (0..n)
                .map(|i| lattice.place_um(axis, i) * sine / wave.wavelength_um)
                .collect();
            let mut phasors = vec![Complex32::ZERO; n];
            cis_all(&turns, &mut phasors);
            phasors
        });
        let fill_row = |iy: usize, row: &mut [Complex32]| {
            aperture.fill_row(iy, row);
            let wy = arriving[1][iy];
            for (t, wx) in row.iter_mut().zip(&arriving[0]) {
                *t *= wx * wy;
            }
        };
        let mut landing = Self::empty(grid);
        let scale = power_scale(&lattice, tiling);
        for_tiles(&lattice, tiling, fill_row, |tile| {
            for (value, shift) in tile.spectrum.iter().zip(&rays.shift_um) {
                let power = f64::from(value.norm_sqr()) * scale;
                landing.add(tile.middle_um, *shift, power);
            }
        });
        Ok(landing)
    }

    /// All power that travels towards the plane (um^2).
    pub fn travelling_um2(&self) -> f64 {
        self.power_um2.sum() + self.beyond_um2
    }

    /// A map without light.
    pub(super) fn empty(grid: LandingGrid) -> Self {
        Self {
            grid,
            power_um2: Array2::zeros((grid.cells, grid.cells)),
            beyond_um2: 0.0,
            evanescent_um2: 0.0,
        }
    }

    /// Adds the power of a ray from a place of the element, by how far it lands from there (um); evanescent without.
    #[inline]
    pub(super) fn add(&mut self, from_um: [f64; 2], shift_um: Option<[f64; 2]>, power: f64) {
        let Some(shift) = shift_um else {
            self.evanescent_um2 += power;
            return;
        };
        let cells = self.grid.cells as f64;
        let [x, y] = [0, 1].map(|a| (from_um[a] + shift[a]) / self.grid.cell_um + 0.5 * cells);
        if x >= 0.0 && y >= 0.0 && x < cells && y < cells {
            self.power_um2[[y as usize, x as usize]] += power;
        } else {
            self.beyond_um2 += power;
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

/// Displacement of the light of each frequency of a tile, from the tile to the plane, in the order of a transposed
/// transform.
struct Rays {
    /// Along x and y (um); none for light that does not travel.
    shift_um: Vec<Option<[f64; 2]>>,
}

impl Rays {
    fn new(lattice: &Lattice, tiling: Tiling, wave: &PlaneWave, towards: [f64; 2], distance_um: f64) -> Self {
        let leaving = DepartureDirections::new(lattice, tiling, wave.wavelength_um, [0.0; 2], towards);
        let shift_um = (0..tiling.directions())
            .map(|i| {
                let [sx, sy] = leaving.sines(i / tiling.side, i % tiling.side);
                let cosine2 = 1.0 - sx * sx - sy * sy;
                (cosine2 > 0.0).then(|| [sx, sy].map(|s| distance_um * s / cosine2.sqrt()))
            })
            .collect();
        Self { shift_um }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propagation::aperture::sites_inside;
    use crate::{Accuracy, FoldedPropagator, PhaseFunction, Propagator, Scratch, Window};
    use rand::{RngExt, SeedableRng};
    use std::f64::consts::{PI, TAU};

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
        let found = SensorIrradiance::of(&prism, &PlaneWave::normal(0.53), [sine, 0.0], grid).unwrap();
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
        /// Tolerance for 10^5 independent sites: three standard deviations.
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
        let found = SensorIrradiance::of(&rough, &PlaneWave::normal(0.8), [0.0; 2], grid(50.0, 40, 500.0)).unwrap();
        let share = found.travelling_um2() / (found.travelling_um2() + found.evanescent_um2);
        let disc = PI * (0.35_f64 / 0.8).powi(2);
        assert!((share - disc).abs() < CHANCE, "{share} is not {disc}");
    }

    /// A lens of two levels sends its light to several orders; squares of the map hold what wave optics brings there.
    #[test]
    fn squares_hold_what_wave_optics_brings_there() {
        /// Tolerance as a share of the power in the brightest ring of squares: rays leave out interference between
        /// tiles.
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
        let map = SensorIrradiance::of(&lens, &wave, [0.0; 2], grid(cell, 5, z)).unwrap();
        let window = Window {
            centre_um: [0.0; 2],
            step_um: 0.35,
            samples: 600,
            distance_um: z,
        };
        let fold = FoldedPropagator::plan(lattice, 70.0, um, window, Accuracy::Accurate).unwrap();
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
