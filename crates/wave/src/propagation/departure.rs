//! Which part of an element sends how much light into which direction, once for all directions that light comes from.
//!
//! Light that arrives obliquely leaves a tile of the aperture in directions that are all shifted by the same sines. So
//! the power spectra of the tiles are formed once; where the light lands for a direction of arrival follows from them
//! alone. [`Landing::of`] does the same for one direction, tile by tile; here tiles are gathered into blocks.

use metalith_core::Lattice;
use num_complex::Complex32;

use super::tiles::{HOP, Leaving, TILE, for_tiles, power_scale};
use super::{Aperture, Landing, LandingGrid};
use crate::error::Result;

/// Power of the blocks of an element by direction.
#[derive(Clone, Debug)]
pub struct Departure {
    blocks: Vec<Block>,
    /// Edge of a block (um).
    edge_um: f64,
    lattice: Lattice,
    wavelength_um: f64,
    /// All power that the aperture passes (um^2).
    power_um2: f64,
}

/// Neighbouring tiles.
#[derive(Clone, Debug)]
struct Block {
    /// Directions; those with next to no power are left out.
    bins: Vec<Bin>,
    /// What was left out (um^2): it is taken to be spread as the rest.
    rest_um2: f64,
}

/// The light of a block that leaves in one direction.
#[derive(Clone, Copy, Debug)]
struct Bin {
    /// Bin of frequency along x times [`TILE`], and along y (cycles a tile).
    direction: u16,
    /// Mean place that it comes from (um): a lens sends the light of each place of a block elsewhere.
    place_um: [f32; 2],
    power_um2: f32,
}

/// Share of the power of a block that may be left out with its weakest bins.
const LEFT_OUT: f64 = 2e-3;

impl Departure {
    /// Of an element at one wavelength (um), its tiles gathered into `blocks` x `blocks` squares over its lattice.
    pub fn of(aperture: &dyn Aperture, wavelength_um: f64, blocks: usize) -> Self {
        let lattice = aperture.lattice();
        let (reach, blocks) = (lattice.reach(), blocks.max(1));
        // Power, and power times place along x and y, of each direction.
        let mut spectra: Vec<Vec<[f32; 3]>> = vec![Vec::new(); blocks * blocks];
        let scale = power_scale(&lattice);
        let block_of = |axis: usize, first: i64| {
            let (start, places) = (reach[axis].start as i64, reach[axis].len());
            let from = (first + HOP as i64 - start).max(0) as usize;
            (from * blocks / (places + HOP)).min(blocks - 1)
        };
        let fill_row = |iy: usize, row: &mut [Complex32]| aperture.fill_row(iy, row);
        for_tiles(&lattice, fill_row, |tile| {
            let [column, row] = [0, 1].map(|axis| block_of(axis, tile.first[axis]));
            let sums = &mut spectra[row * blocks + column];
            sums.resize(TILE * TILE, [0.0; 3]);
            let [x, y] = tile.middle_um.map(|v| v as f32);
            for (to, value) in sums.iter_mut().zip(tile.spectrum) {
                let power = value.norm_sqr() * scale as f32;
                to[0] += power;
                to[1] += power * x;
                to[2] += power * y;
            }
        });
        let steps = lattice.steps_um();
        let edge = |axis: usize| (reach[axis].len() + HOP) as f64 * steps[axis] / blocks as f64;
        let edge_um = edge(0).max(edge(1));
        let blocks: Vec<Block> = spectra.iter().filter_map(|sums| Block::of(sums)).collect();
        Self {
            power_um2: blocks.iter().map(Block::power_um2).sum(),
            blocks,
            edge_um,
            lattice,
            wavelength_um,
        }
    }

    /// All power that the aperture passes, whether it travels or not (um^2).
    pub fn power_um2(&self) -> f64 {
        self.power_um2
    }

    /// Where the light of a plane wave lands; `towards` as for [`Landing::of`].
    ///
    /// # Errors
    /// If the map is none or too large.
    pub fn landing(&self, sines: [f64; 2], towards: [f64; 2], grid: LandingGrid) -> Result<Landing> {
        grid.check()?;
        let leaves = Leaving::new(&self.lattice, self.wavelength_um, sines, towards);
        let mut landing = Landing::empty(grid);
        // How far light of each direction lands from where it leaves, the same for all blocks.
        let shift = |i: usize| {
            let [sx, sy] = leaves.sines(i / TILE, i % TILE);
            let cosine2 = 1.0 - sx * sx - sy * sy;
            (cosine2 > 0.0).then(|| [sx, sy].map(|s| grid.distance_um / cosine2.sqrt() * s))
        };
        let shifts: Vec<Option<[f64; 2]>> = (0..TILE * TILE).map(shift).collect();
        for block in &self.blocks {
            let kept = block.power_um2() - block.rest_um2;
            let fill = 1.0 + block.rest_um2 / kept.max(f64::MIN_POSITIVE);
            for bin in &block.bins {
                let power = f64::from(bin.power_um2) * fill;
                landing.add_spread(
                    bin.place_um.map(f64::from),
                    shifts[usize::from(bin.direction)],
                    self.edge_um,
                    power,
                );
            }
        }
        Ok(landing)
    }
}

impl Block {
    /// From the power of each direction, columns first, and its moments along x and y; none of a block without light.
    fn of(sums: &[[f32; 3]]) -> Option<Self> {
        let power = |i: usize| sums[i][0];
        let total: f64 = (0..sums.len()).map(|i| f64::from(power(i))).sum();
        if total <= 0.0 {
            return None;
        }
        let mut order: Vec<usize> = (0..sums.len()).collect();
        order.sort_by(|a, b| power(*b).total_cmp(&power(*a)).then(a.cmp(b)));
        let mut kept = 0.0;
        let mut bins = Vec::new();
        for i in order {
            if kept >= (1.0 - LEFT_OUT) * total {
                break;
            }
            kept += f64::from(power(i));
            let [power_um2, x, y] = sums[i];
            bins.push(Bin {
                direction: i as u16,
                place_um: [x / power_um2, y / power_um2],
                power_um2,
            });
        }
        // In the order of directions, which is that of places on the plane.
        bins.sort_by_key(|b| b.direction);
        Some(Self {
            rest_um2: total - kept,
            bins,
        })
    }

    fn power_um2(&self) -> f64 {
        self.bins.iter().map(|b| f64::from(b.power_um2)).sum::<f64>() + self.rest_um2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PhaseFunction, PlaneWave};
    use std::f64::consts::TAU;

    #[test]
    fn lands_where_the_map_of_one_direction_has_it() {
        /// Of all power, what lands in a neighbouring square: blocks of 18 um move a ray by up to 9 um, squares have 40 um.
        const BLOCKS: f64 = 0.2;
        /// Powers of a few hundred thousand single-precision amplitudes.
        const ROUNDING: f64 = 1e-4;
        let (z, um) = (336.0, 0.53);
        let lens = PhaseFunction {
            lattice: Lattice::covering(140_000, 350).unwrap(),
            radius_um: 70.0,
            amplitude: 0.9,
            phase_rad: |x: f64, y: f64| -TAU * ((x * x + y * y + z * z).sqrt() - z) / um,
        };
        let departure = Departure::of(&lens, um, 8);
        for sines in [[0.0, 0.0], [0.3, -0.1]] {
            let wave = PlaneWave {
                wavelength_um: um,
                sin_x: sines[0],
                sin_y: sines[1],
            };
            let grid = LandingGrid {
                cell_um: 40.0,
                cells: 13,
                distance_um: z,
            };
            let fast = departure.landing(sines, sines, grid).unwrap();
            let slow = Landing::of(&lens, &wave, sines, grid).unwrap();
            let all = slow.travelling_um2();
            assert!((fast.travelling_um2() / all - 1.0).abs() < ROUNDING);
            let moved: f64 = fast
                .power_um2
                .iter()
                .zip(&slow.power_um2)
                .map(|(a, b)| (a - b).abs())
                .sum();
            assert!(moved < BLOCKS * all, "{sines:?}: {}", moved / all);
        }
    }
}
