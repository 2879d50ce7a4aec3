//! Which part of an element sends how much light into which direction, once for all directions that light comes from.
//!
//! Light that arrives obliquely leaves a tile of the aperture in directions that are all shifted by the same sines. So
//! the power spectra of the tiles are formed once; where the light lands for a direction of arrival follows from them
//! alone. [`Landing::of`] does the same for one direction, tile by tile; here tiles are gathered into blocks.

use metalith_core::Lattice;
use num_complex::Complex32;

use super::tiles::{Leaving, Tiling, for_tiles, power_scale};
use super::{Aperture, Landing, LandingGrid};
use crate::error::Result;

/// Power of the blocks of an element by direction.
#[derive(Clone, Debug)]
pub struct Departure {
    blocks: Vec<Block>,
    tiling: Tiling,
    lattice: Lattice,
    wavelength_um: f64,
    /// All power that the aperture passes (um^2).
    power_um2: f64,
}

/// Neighbouring tiles.
#[derive(Clone, Debug)]
struct Block {
    /// Directions that most of the light leaves in.
    strong: Vec<Bin>,
    /// The others, [`GROUP`] x [`GROUP`] of them gathered into one.
    weak: Vec<Bin>,
    /// What was left out (um^2): it is taken to be spread as the rest.
    rest_um2: f64,
}

/// The light of a block that leaves in one direction.
#[derive(Clone, Copy, Debug)]
struct Bin {
    /// Bin of frequency along x times the bins an axis, and along y (cycles a tile).
    direction: u16,
    /// Mean place that it comes from (um): a lens sends the light of each place of a block elsewhere.
    place_um: [f32; 2],
    /// Edges of the rectangle about it whose moments are those of the places it comes from (um).
    edges_um: [f32; 2],
    power_um2: f32,
}

/// Share of the power of a block that its weak directions have.
const WEAK: f64 = 0.06;
/// Directions along an axis that are gathered where they are weak.
const GROUP: usize = 4;
/// Share of the power of a block that may be left out with its weakest groups.
const LEFT_OUT: f64 = 2e-3;

impl Departure {
    /// Of an element at one wavelength (um), its tiles gathered into `blocks` x `blocks` squares over its lattice, for a plane at
    /// about this distance from the pillar tops (um).
    pub fn of(aperture: &dyn Aperture, wavelength_um: f64, distance_um: f64, blocks: usize) -> Self {
        let lattice = aperture.lattice();
        let tiling = Tiling::at(&lattice, wavelength_um, distance_um);
        let (side, hop) = (tiling.side, tiling.hop());
        let (reach, blocks) = (lattice.reach(), blocks.max(1));
        let mut spectra: Vec<Vec<Moments>> = vec![Vec::new(); blocks * blocks];
        let steps = lattice.steps_um();
        // Middle of a block along an axis, from which its places are counted.
        let middle_um = |axis: usize, block: usize| {
            let sites = (block as f64 + 0.5) * (reach[axis].len() + hop) as f64 / blocks as f64;
            lattice.place_um(axis, 0)
                + (reach[axis].start as f64 - hop as f64 + sites + 0.5 * side as f64) * steps[axis]
        };
        let scale = power_scale(&lattice, tiling);
        let block_of = |axis: usize, first: i64| {
            let (start, places) = (reach[axis].start as i64, reach[axis].len());
            let from = (first + hop as i64 - start).max(0) as usize;
            (from * blocks / (places + hop)).min(blocks - 1)
        };
        let fill_row = |iy: usize, row: &mut [Complex32]| aperture.fill_row(iy, row);
        for_tiles(&lattice, tiling, fill_row, |tile| {
            let [column, row] = [0, 1].map(|axis| block_of(axis, tile.first[axis]));
            let sums = &mut spectra[row * blocks + column];
            sums.resize(tiling.directions(), Moments::default());
            let middle = [middle_um(0, column), middle_um(1, row)];
            let place = [0, 1].map(|a| (tile.middle_um[a] - middle[a]) as f32);
            for (to, value) in sums.iter_mut().zip(tile.spectrum) {
                to.add(value.norm_sqr() * scale as f32, place);
            }
        });
        let blocks: Vec<Block> = spectra
            .iter()
            .enumerate()
            .filter_map(|(k, sums)| {
                let middle = [middle_um(0, k % blocks), middle_um(1, k / blocks)];
                Block::of(sums, tiling, middle, steps.map(|step| hop as f64 * step))
            })
            .collect();
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

    /// Where the light of a plane wave lands; `towards` as for [`Landing::of`].
    ///
    /// # Errors
    /// If the map is none or too large.
    pub fn landing(&self, sines: [f64; 2], towards: [f64; 2], grid: LandingGrid) -> Result<Landing> {
        grid.check()?;
        let leaves = Leaving::new(&self.lattice, self.tiling, self.wavelength_um, sines, towards);
        let side = self.tiling.side;
        let mut spread = SpreadLight::new(grid);
        // How far light of each direction lands from where it leaves, the same for all blocks; not a number if it does not travel.
        let shift = |i: usize| {
            let [sx, sy] = leaves.sines(i / side, i % side);
            let cosine2 = 1.0 - sx * sx - sy * sy;
            let travels = if cosine2 > 0.0 {
                grid.distance_um / cosine2.sqrt()
            } else {
                f64::NAN
            };
            [sx, sy].map(|s| (travels * s) as f32)
        };
        let shifts: Vec<[f32; 2]> = (0..self.tiling.directions()).map(shift).collect();
        // How far the directions of a group land apart, squared.
        let group = self.lattice.steps_um().map(|step| {
            let sines = GROUP as f64 * self.wavelength_um / (side as f64 * step);
            (grid.distance_um * sines).powi(2) as f32
        });
        let mut evanescent_um2 = 0.0;
        for block in &self.blocks {
            let fill = block.power_um2() / (block.power_um2() - block.rest_um2).max(f64::MIN_POSITIVE);
            for (bins, wider) in [(&block.strong, [0.0; 2]), (&block.weak, group)] {
                for bin in bins {
                    let (power, shift) = (f64::from(bin.power_um2) * fill, shifts[usize::from(bin.direction)]);
                    if shift[0].is_nan() {
                        evanescent_um2 += power;
                        continue;
                    }
                    let edges_um = [0, 1].map(|a| (bin.edges_um[a] * bin.edges_um[a] + wider[a]).sqrt());
                    spread.add([0, 1].map(|a| bin.place_um[a] + shift[a]), edges_um, power);
                }
            }
        }
        Ok(spread.landing(evanescent_um2))
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

    fn landing(self, evanescent_um2: f64) -> Landing {
        let mut landing = Landing::empty(self.grid);
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

/// Power of a direction, and where it comes from.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    power_um2: f32,
    /// Power times place along x and y, from the middle of the block (um).
    first: [f32; 2],
    /// Power times the square of the place.
    second: [f32; 2],
}

impl Moments {
    #[inline]
    fn add(&mut self, power_um2: f32, place_um: [f32; 2]) {
        self.power_um2 += power_um2;
        for (a, place) in place_um.into_iter().enumerate() {
            self.first[a] += power_um2 * place;
            self.second[a] += power_um2 * place * place;
        }
    }

    fn gather(&mut self, other: &Self) {
        self.power_um2 += other.power_um2;
        for a in 0..2 {
            self.first[a] += other.first[a];
            self.second[a] += other.second[a];
        }
    }

    /// Mean place, and the edges of a rectangle with the same second moments, of tiles that are `hop_um` wide.
    fn places(&self, middle_um: [f64; 2], hop_um: [f64; 2]) -> [[f32; 2]; 2] {
        let mean = self.first.map(|v| v / self.power_um2);
        let edge = |a: usize| {
            let variance = (self.second[a] / self.power_um2 - mean[a] * mean[a]).max(0.0);
            (12.0 * f64::from(variance) + hop_um[a] * hop_um[a]).sqrt() as f32
        };
        [
            [0, 1].map(|a| (middle_um[a] + f64::from(mean[a])) as f32),
            [edge(0), edge(1)],
        ]
    }
}

impl Block {
    /// From the power of each direction, columns first; none of a block without light.
    fn of(sums: &[Moments], tiling: Tiling, middle_um: [f64; 2], hop_um: [f64; 2]) -> Option<Self> {
        let power = |i: usize| sums[i].power_um2;
        let total: f64 = (0..sums.len()).map(|i| f64::from(power(i))).sum();
        if total <= 0.0 {
            return None;
        }
        let bin = |direction: usize, sums: &Moments| {
            let [place_um, edges_um] = sums.places(middle_um, hop_um);
            Bin {
                direction: direction as u16,
                place_um,
                edges_um,
                power_um2: sums.power_um2,
            }
        };
        let (kept, others) = strongest(total, 1.0 - WEAK, power, sums.len());
        let strong = kept.into_iter().map(|i| bin(i, &sums[i])).collect();
        let across = tiling.side / GROUP;
        let mut groups = vec![Group::default(); across * across];
        for i in others {
            let [column, row] = [i / tiling.side, i % tiling.side].map(|k| k / GROUP);
            groups[column * across + row].add(i, tiling, &sums[i]);
        }
        let all: f64 = groups.iter().map(|g| f64::from(g.sums.power_um2)).sum();
        let share = 1.0 - LEFT_OUT * total / all.max(f64::MIN_POSITIVE);
        let (kept, left_out) = strongest(all, share, |i| groups[i].sums.power_um2, groups.len());
        Some(Self {
            strong,
            weak: kept
                .into_iter()
                .map(|i| bin(groups[i].direction(tiling), &groups[i].sums))
                .collect(),
            rest_um2: left_out.into_iter().map(|i| f64::from(groups[i].sums.power_um2)).sum(),
        })
    }

    fn power_um2(&self) -> f64 {
        let bins = self.strong.iter().chain(&self.weak);
        bins.map(|b| f64::from(b.power_um2)).sum::<f64>() + self.rest_um2
    }
}

/// Weak directions beside one another.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    sums: Moments,
    /// Power times the index of the direction along x and along y.
    directions: [f32; 2],
}

impl Group {
    fn add(&mut self, direction: usize, tiling: Tiling, one: &Moments) {
        self.sums.gather(one);
        for (sum, k) in self
            .directions
            .iter_mut()
            .zip([direction / tiling.side, direction % tiling.side])
        {
            *sum += one.power_um2 * k as f32;
        }
    }

    /// The direction that is nearest to the mean.
    fn direction(&self, tiling: Tiling) -> usize {
        let [x, y] = self.directions.map(|sum| (sum / self.sums.power_um2).round() as usize);
        let last = tiling.side - 1;
        x.min(last) * tiling.side + y.min(last)
    }
}

/// The fewest of `n` that have a share of a power, and the others that have any, each in their own order.
fn strongest(total: f64, share: f64, power: impl Fn(usize) -> f32, n: usize) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..n).filter(|i| power(*i) > 0.0).collect();
    order.sort_by(|a, b| power(*b).total_cmp(&power(*a)).then(a.cmp(b)));
    let mut sum = 0.0;
    let enough = order.iter().position(|i| {
        let before = sum;
        sum += f64::from(power(*i));
        before >= share * total
    });
    let mut others = order.split_off(enough.unwrap_or(order.len()));
    // Directions beside one another land beside one another.
    order.sort_unstable();
    others.sort_unstable();
    (order, others)
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
        let departure = Departure::of(&lens, um, z, 8);
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
