//! The grating vector of every place of an element.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_pillars::Lattice;

/// Edge of the blocks of sites that share a grating vector. The vector of a 1 mm lens of F/2.4 changes by 0.003 turns
/// a site over them; where the phase of rings jumps, the mean over so many is needed.
pub const BLOCK: usize = 32;

/// Grating vectors over an element (turns a site along x and y), one for each block of 32 by 32 sites.
#[derive(Clone, Debug)]
pub struct SlopeMap {
    blocks: usize,
    slopes: Vec<[f64; 2]>,
}

impl SlopeMap {
    /// Of a phase (turns) that is asked for at each site; none where there is no pillar. The vector is the argument of
    /// the mean of exp(i 2 pi step) over the steps of the phase from site to site in the block: jumps of single rings
    /// and whole turns do not count.
    pub fn new(lattice: Lattice, turns: impl Fn(usize, usize) -> Option<f64> + Sync) -> Self {
        let n = lattice.sites();
        let blocks = n.div_ceil(BLOCK);
        let row = |by: usize| -> Vec<[f64; 2]> {
            let mut sums = vec![[Complex64::ZERO; 2]; blocks];
            for iy in by * BLOCK..((by + 1) * BLOCK).min(n) {
                for ix in 0..n {
                    let Some(own) = turns(ix, iy) else { continue };
                    let next = [(ix + 1, iy), (ix, iy + 1)];
                    for (sum, (x, y)) in sums[ix / BLOCK].iter_mut().zip(next) {
                        if x < n
                            && y < n
                            && let Some(next) = turns(x, y)
                        {
                            *sum += Complex64::cis(TAU * (next - own));
                        }
                    }
                }
            }
            sums.iter().map(|sum| sum.map(|s| s.arg() / TAU)).collect()
        };
        Self {
            blocks,
            slopes: (0..blocks).into_par_iter().flat_map_iter(row).collect(),
        }
    }

    /// The vector at a site.
    pub fn at(&self, ix: usize, iy: usize) -> [f64; 2] {
        self.slopes[iy / BLOCK * self.blocks + ix / BLOCK]
    }

    /// The vectors of the blocks of a row of sites, along +x.
    pub fn row(&self, iy: usize) -> &[[f64; 2]] {
        let first = iy / BLOCK * self.blocks;
        &self.slopes[first..first + self.blocks]
    }

    /// All vectors.
    pub fn all(&self) -> &[[f64; 2]] {
        &self.slopes
    }

    /// Radius of the disc about `middle` that holds this share of the blocks with pillars (turns a site).
    pub fn radius(&self, middle: [f64; 2], share: f64) -> f64 {
        let mut all: Vec<f64> = self
            .slopes
            .iter()
            .filter(|k| **k != [0.0; 2])
            .map(|k| (k[0] - middle[0]).hypot(k[1] - middle[1]))
            .collect();
        all.sort_by(f64::total_cmp);
        let last = (share * all.len() as f64).ceil() as usize;
        last.checked_sub(1).and_then(|i| all.get(i)).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wedge_with_jumps_has_its_slope() {
        let lattice = Lattice::new(350, 100).unwrap();
        // Every ninth column is off by a third of a turn, as rings of an optimised phase are.
        let turns = |ix: usize, iy: usize| {
            let jump = if ix.is_multiple_of(9) { 0.3 } else { 0.0 };
            (ix < 90).then_some(0.17 * ix as f64 - 0.08 * iy as f64 + jump)
        };
        let map = SlopeMap::new(lattice, turns);
        // Of the steps along x two in nine are off, by as much up as down; a block does not hold whole nines.
        const JUMPS: f64 = 0.01;
        let [x, y] = map.at(40, 70);
        assert!((x - 0.17).abs() < JUMPS && (y + 0.08).abs() < 1e-9, "{x} {y}");
        assert_eq!(map.row(70)[1], map.at(40, 70));
        assert!(map.radius([0.17, -0.08], 1.0) < JUMPS);
    }

    #[test]
    fn nothing_has_no_slope() {
        let map = SlopeMap::new(Lattice::new(350, 40).unwrap(), |_, _| None);
        assert!(map.all().iter().all(|k| *k == [0.0; 2]));
        assert_eq!(map.radius([0.0; 2], 1.0), 0.0);
    }
}
