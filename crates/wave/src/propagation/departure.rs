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
    lattice: Lattice,
    wavelength_um: f64,
    /// All power that the aperture passes (um^2).
    power_um2: f64,
}

/// Neighbouring tiles.
#[derive(Clone, Debug)]
struct Block {
    /// Mean place of its light (um).
    place_um: [f64; 2],
    /// Bin of frequency along x and y (cycles a tile), and power (um^2); bins with next to no power are left out.
    bins: Vec<([u16; 2], f32)>,
    /// What was left out (um^2): it is taken to be spread as the rest.
    rest_um2: f64,
}

/// Share of the power of a block that may be left out with its weakest bins.
const LEFT_OUT: f64 = 2e-3;

impl Departure {
    /// Of an element at one wavelength (um), its tiles gathered into `blocks` x `blocks` squares over its lattice.
    pub fn of(aperture: &dyn Aperture, wavelength_um: f64, blocks: usize) -> Self {
        let lattice = aperture.lattice();
        let (reach, blocks) = (lattice.reach(), blocks.max(1));
        let mut spectra = vec![vec![0.0f64; 0]; blocks * blocks];
        let mut moments = vec![[0.0f64; 3]; blocks * blocks];
        let scale = power_scale(&lattice);
        let block_of = |axis: usize, first: i64| {
            let (start, places) = (reach[axis].start as i64, reach[axis].len());
            let from = (first + HOP as i64 - start).max(0) as usize;
            (from * blocks / (places + HOP)).min(blocks - 1)
        };
        let fill_row = |iy: usize, row: &mut [Complex32]| aperture.fill_row(iy, row);
        for_tiles(&lattice, fill_row, |tile| {
            let [column, row] = [0, 1].map(|axis| block_of(axis, tile.first[axis]));
            let block = row * blocks + column;
            let sums = &mut spectra[block];
            sums.resize(TILE * TILE, 0.0);
            let mut power = 0.0;
            for (to, value) in sums.iter_mut().zip(tile.spectrum) {
                let own = f64::from(value.norm_sqr()) * scale;
                *to += own;
                power += own;
            }
            for (to, value) in moments[block]
                .iter_mut()
                .zip([tile.middle_um[0], tile.middle_um[1], 1.0])
            {
                *to += value * power;
            }
        });
        let blocks = spectra.iter().zip(&moments).filter(|(_, m)| m[2] > 0.0);
        let blocks: Vec<Block> = blocks.map(|(s, m)| Block::of(s, *m)).collect();
        Self {
            power_um2: moments.iter().map(|m| m[2]).sum(),
            blocks,
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
        for block in &self.blocks {
            let kept: f64 = block.bins.iter().map(|b| f64::from(b.1)).sum();
            let fill = 1.0 + block.rest_um2 / kept.max(f64::MIN_POSITIVE);
            for ([kx, ky], power) in &block.bins {
                let power = f64::from(*power) * fill;
                let [sx, sy] = leaves.sines(usize::from(*kx), usize::from(*ky));
                let cosine2 = 1.0 - sx * sx - sy * sy;
                let shift = (cosine2 > 0.0).then(|| [sx, sy].map(|s| grid.distance_um / cosine2.sqrt() * s));
                landing.add(block.place_um, shift, power);
            }
        }
        Ok(landing)
    }
}

impl Block {
    /// From the summed power spectra of its tiles, columns first, and the moments of their places.
    fn of(spectrum: &[f64], moments: [f64; 3]) -> Self {
        let mut order: Vec<usize> = (0..spectrum.len()).collect();
        order.sort_by(|a, b| spectrum[*b].total_cmp(&spectrum[*a]).then(a.cmp(b)));
        let total: f64 = spectrum.iter().sum();
        let mut kept = 0.0;
        let mut bins = Vec::new();
        for i in order {
            if kept >= (1.0 - LEFT_OUT) * total {
                break;
            }
            kept += spectrum[i];
            bins.push(([(i / TILE) as u16, (i % TILE) as u16], spectrum[i] as f32));
        }
        Self {
            place_um: [moments[0] / moments[2], moments[1] / moments[2]],
            rest_um2: total - kept,
            bins,
        }
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
