//! Local angular spectrum: the light that each part of an element sends into each direction, computed once for all
//! directions of arrival.
//!
//! Light that arrives obliquely leaves a tile of the aperture in directions that are all shifted by the same sines. So
//! the power spectra of the tiles are formed once; where the light lands for a direction of arrival follows from them
//! alone. [`SensorIrradiance::of`] does the same for one direction, tile by tile; here tiles are gathered into blocks.

mod block;

use metalith_pillars::Lattice;
use num_complex::Complex32;

use self::block::{Block, Moments, Pairs};
use super::tiles::{DepartureDirections, Tile, Tiling, for_tiles, power_scale};
use super::{Aperture, LandingGrid, SensorIrradiance};
use crate::error::Result;

/// Power of the blocks of an element by direction.
#[derive(Clone, Debug)]
pub struct LocalAngularSpectrum {
    blocks: Vec<Block>,
    tiling: Tiling,
    lattice: Lattice,
    wavelength_um: f64,
    /// All power that the aperture passes (um^2).
    power_um2: f64,
}

impl LocalAngularSpectrum {
    /// Spectrum of an element at one wavelength (um), its tiles gathered into `blocks` x `blocks` squares over its
    /// lattice, for a plane at about this distance from the pillar tops (um).
    pub fn of(aperture: &dyn Aperture, wavelength_um: f64, distance_um: f64, blocks: usize) -> Self {
        let lattice = aperture.lattice();
        let tiling = Tiling::at(&lattice, wavelength_um, distance_um);
        let grid = BlockGrid {
            lattice,
            tiling,
            across: blocks.max(1),
        };
        // Strips of tiles come in rising rows, and blocks of rows that rise with them: sums of one row of blocks are held at a time.
        // Those of all are a hundred megabytes.
        let mut sums: Vec<Vec<Moments>> = vec![Vec::new(); grid.across];
        let mut blocks = Vec::new();
        let mut at = 0;
        let mut finish = |row: usize, sums: &mut [Vec<Moments>]| {
            for (column, sums) in sums.iter_mut().enumerate() {
                blocks.extend(grid.block([column, row], sums));
                sums.clear();
            }
        };
        let scale = power_scale(&lattice, tiling);
        let fill_row = |iy: usize, row: &mut [Complex32]| aperture.fill_row(iy, row);
        for_tiles(&lattice, tiling, fill_row, |tile| {
            let [column, row] = grid.block_of(tile);
            if row != at {
                finish(at, &mut sums);
                at = row;
            }
            grid.add(tile, scale, [column, row], &mut sums[column]);
        });
        finish(at, &mut sums);
        Self {
            power_um2: blocks.iter().map(Block::power_um2).sum(),
            blocks,
            tiling,
            lattice,
            wavelength_um,
        }
    }

    /// All power that the aperture passes, whether it travels or not (um^2).
    pub fn power_um2(&self) -> f64 {
        self.power_um2
    }

    /// Irradiance on the sensor's plane in a plane wave; `towards` as for [`SensorIrradiance::of`].
    ///
    /// # Errors
    /// If the map is none or too large.
    pub fn landing(&self, sines: [f64; 2], towards: [f64; 2], grid: LandingGrid) -> Result<SensorIrradiance> {
        grid.check()?;
        let leaves = DepartureDirections::new(&self.lattice, self.tiling, self.wavelength_um, sines, towards);
        let pairs = Pairs::new(self.tiling, &self.lattice);
        let mut spread = SpreadLight::new(grid);
        // How far light of each pair of directions lands from where it leaves, the same for all blocks; not a number if it does not travel.
        let shift = |i: usize| {
            let [sx, sy] = leaves.sines(Pairs::middle(i / pairs.across), Pairs::middle(i % pairs.across));
            let cosine2 = 1.0 - sx * sx - sy * sy;
            let travels = if cosine2 > 0.0 {
                grid.distance_um / cosine2.sqrt()
            } else {
                f64::NAN
            };
            [sx, sy].map(|s| (travels * s) as f32)
        };
        let shifts: Vec<[f32; 2]> = (0..pairs.count()).map(shift).collect();
        let mut evanescent_um2 = 0.0;
        for block in &self.blocks {
            let fill = block.power_um2() / (block.power_um2() - block.rest_um2).max(f64::MIN_POSITIVE);
            for bin in block.bins() {
                let (power, shift) = (f64::from(bin.power_um2) * fill, shifts[usize::from(bin.pair)]);
                if shift[0].is_nan() {
                    evanescent_um2 += power;
                } else {
                    spread.add([0, 1].map(|a| bin.place_um[a] + shift[a]), bin.edges_um, power);
                }
            }
        }
        Ok(spread.landing(evanescent_um2))
    }
}

/// Grid that divides tiles into blocks.
struct BlockGrid {
    lattice: Lattice,
    tiling: Tiling,
    /// Blocks an axis.
    across: usize,
}

impl BlockGrid {
    /// Middle of a block along an axis (um), from which its places are counted.
    fn middle_um(&self, axis: usize, block: usize) -> f64 {
        let (hop, reach) = (self.tiling.hop(), &self.lattice.reach()[axis]);
        let sites = (block as f64 + 0.5) * (reach.len() + hop) as f64 / self.across as f64;
        self.lattice.place_um(axis, 0)
            + (reach.start as f64 - hop as f64 + sites + 0.5 * self.tiling.side as f64) * self.lattice.steps_um()[axis]
    }

    /// Column and row of the block that a tile is in.
    fn block_of(&self, tile: &Tile<'_>) -> [usize; 2] {
        let hop = self.tiling.hop();
        [0, 1].map(|axis| {
            let reach = &self.lattice.reach()[axis];
            let from = (tile.first[axis] + hop as i64 - reach.start as i64).max(0) as usize;
            (from * self.across / (reach.len() + hop)).min(self.across - 1)
        })
    }

    /// Add the light of a tile to the sums of its block, by column and row.
    fn add(&self, tile: &Tile<'_>, scale: f64, [column, row]: [usize; 2], sums: &mut Vec<Moments>) {
        let pairs = Pairs::new(self.tiling, &self.lattice);
        sums.resize(pairs.count(), Moments::default());
        let middle = [self.middle_um(0, column), self.middle_um(1, row)];
        let place = [0, 1].map(|a| (tile.middle_um[a] - middle[a]) as f32);
        let powers = tile.spectrum.iter().map(|value| value.norm_sqr() * scale as f32);
        pairs.add(powers, place, sums);
    }

    /// The block of these sums, by column and row; none of one without light.
    fn block(&self, [column, row]: [usize; 2], sums: &[Moments]) -> Option<Block> {
        let middle = [self.middle_um(0, column), self.middle_um(1, row)];
        Block::of(sums, Pairs::new(self.tiling, &self.lattice), middle)
    }
}

/// A map that rectangles of light are added to, with a border for all that lands beyond it.
struct SpreadLight {
    grid: LandingGrid,
    /// Squares an axis with the border: one before the map, and two after it for what begins in the first.
    across: usize,
    power_um2: Vec<f64>,
}

impl SpreadLight {
    fn new(grid: LandingGrid) -> Self {
        let across = grid.cells + 3;
        Self {
            grid,
            across,
            power_um2: vec![0.0; across * across],
        }
    }

    /// Light all over a rectangle about a place (um), whose edges (um) are at most those of the map's squares.
    #[inline]
    fn add(&mut self, middle_um: [f32; 2], edges_um: [f32; 2], power: f64) {
        let half = 0.5 * self.grid.cells as f32 + 1.0;
        let last = (self.grid.cells + 1) as f32;
        let cell = self.grid.cell_um as f32;
        // Along each axis the square in which it begins, and the share of the light in that one.
        let [(x, wx), (y, wy)] = [0, 1].map(|a| {
            let edge = (edges_um[a] / cell).clamp(f32::MIN_POSITIVE, 1.0);
            let low = (middle_um[a] / cell + half - 0.5 * edge).clamp(0.0, last);
            let first = low as usize;
            (first, f64::from(((first as f32 + 1.0 - low) / edge).min(1.0)))
        });
        let at = y * self.across + x;
        let (near, far) = (power * wy, power * (1.0 - wy));
        self.power_um2[at] += near * wx;
        self.power_um2[at + 1] += near * (1.0 - wx);
        self.power_um2[at + self.across] += far * wx;
        self.power_um2[at + self.across + 1] += far * (1.0 - wx);
    }

    fn landing(self, evanescent_um2: f64) -> SensorIrradiance {
        let mut landing = SensorIrradiance::empty(self.grid);
        for (y, row) in self.power_um2.chunks_exact(self.across).enumerate() {
            for (x, power) in row.iter().enumerate() {
                let place = y.checked_sub(1).zip(x.checked_sub(1));
                match place.and_then(|(y, x)| landing.power_um2.get_mut([y, x])) {
                    Some(to) => *to += power,
                    None => landing.beyond_um2 += power,
                }
            }
        }
        landing.evanescent_um2 = evanescent_um2;
        landing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PhaseFunction, PlaneWave};
    use std::f64::consts::TAU;

    const DISTANCE_UM: f64 = 336.0;
    const WAVELENGTH_UM: f64 = 0.53;

    /// A hyperbola; round, so that blocks in the corners are dark.
    fn lens() -> PhaseFunction<impl Fn(f64, f64) -> f64 + Sync> {
        const Z: f64 = DISTANCE_UM;
        PhaseFunction {
            lattice: Lattice::covering(140_000, 350).unwrap(),
            radius_um: 70.0,
            amplitude: 0.9,
            phase_rad: |x: f64, y: f64| -TAU * ((x * x + y * y + Z * Z).sqrt() - Z) / WAVELENGTH_UM,
        }
    }

    #[test]
    fn lands_where_the_map_of_one_direction_has_it() {
        /// Share of all power that lands in a neighbouring square: blocks of 18 um move a ray by up to 9 um, squares
        /// have 40 um.
        const BLOCKS: f64 = 0.2;
        /// Share of all power in directions that just travel and whose pair does not, and the other way round. 1.2e-4
        /// is found.
        const PAIRS: f64 = 5e-4;
        let (z, um, lens) = (DISTANCE_UM, WAVELENGTH_UM, lens());
        let departure = LocalAngularSpectrum::of(&lens, um, z, 8);
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
            let slow = SensorIrradiance::of(&lens, &wave, sines, grid).unwrap();
            let all = slow.travelling_um2();
            assert!((fast.travelling_um2() / all - 1.0).abs() < PAIRS);
            let moved: f64 = fast
                .power_um2
                .iter()
                .zip(&slow.power_um2)
                .map(|(a, b)| (a - b).abs())
                .sum();
            assert!(moved < BLOCKS * all, "{sines:?}: {}", moved / all);
        }
    }

    #[test]
    fn rows_of_blocks_are_those_of_all_blocks_at_once() {
        let (z, um, lens) = (DISTANCE_UM, WAVELENGTH_UM, lens());
        for across in [1, 3, 8, 200] {
            let departure = LocalAngularSpectrum::of(&lens, um, z, across);
            let (lattice, tiling) = (departure.lattice, departure.tiling);
            let grid = BlockGrid {
                lattice,
                tiling,
                across,
            };
            let mut sums = vec![Vec::new(); across * across];
            let scale = power_scale(&lattice, tiling);
            let fill_row = |iy: usize, row: &mut [Complex32]| lens.fill_row(iy, row);
            for_tiles(&lattice, tiling, fill_row, |tile| {
                let [column, row] = grid.block_of(tile);
                grid.add(tile, scale, [column, row], &mut sums[row * across + column]);
            });
            let blocks = sums.iter().enumerate();
            let wanted: Vec<Block> = blocks
                .filter_map(|(k, sums)| grid.block([k % across, k / across], sums))
                .collect();
            // Bit for bit: sums are the same, in the same order.
            assert!(!wanted.is_empty() && departure.blocks == wanted, "{across}");
        }
    }
}
