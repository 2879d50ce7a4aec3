//! Neighbourhoods that responses are fitted to: supercells whose widths are drawn by chance.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use metalith_core::Result;
use metalith_rcwa::SiteLattice;

use crate::Mapping;

/// Sites of oblique supercells and of rows along x. The time grows with the third power, and a cell of few sites is
/// its own neighbour.
const OBLIQUE_SITES: [usize; 4] = [5, 6, 7, 6];
const ROW_SITES: [usize; 4] = [12, 8, 10, 9];

/// One supercell in so many is a row, whose neighbours across are equals: a lens is one along its axes.
const ROW_EVERY: usize = 4;

/// Largest amount by which the phase of a site is off that of a grating (turns), one supercell each in turn: from a lens
/// of smooth phase over one whose rings jump to pillars that have nothing in common.
const JUMPS_TURNS: [f64; 4] = [0.0, 0.1, 0.25, 0.5];

/// Turns of the phase over those of the lattice: small ones, as a lens has gentle slopes for the most part.
const MULTIPLES: [f64; 6] = [1.0, 2.0, 3.0, -1.0, -2.0, -3.0];

const SEED: u64 = 0x6d65_7461;

/// Lattices of equal pillars, of this many widths: where the phase is slow, neighbours are nearly equal. They are a tenth of
/// all sites, so that resonances of equal pillars weigh little.
const EQUAL: usize = 96;

/// Different pillars side by side.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RandomSupercell {
    pub lattice: SiteLattice,
    /// Width of each site (nm), in the order of the lattice.
    pub widths_nm: Vec<f64>,
}

/// Some supercells: each a grating of any vector, whose phases are off by chance, drawn by the mappings in turn. The first
/// of a longer list are those of a shorter one.
///
/// # Errors
/// None, as all are within what lattices allow.
pub(crate) fn ensemble(mappings: &[Mapping], count: usize) -> Result<Vec<RandomSupercell>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut all = Vec::with_capacity(count);
    while all.len() < count {
        let number = all.len();
        let is_row = number % ROW_EVERY == ROW_EVERY - 1;
        let sizes = if is_row { ROW_SITES } else { OBLIQUE_SITES };
        let sites = sizes[rng.random_range(0..sizes.len())];
        let most = sites as i32;
        let turns = if is_row {
            [1, 0]
        } else {
            [rng.random_range(0..most), rng.random_range(0..most)]
        };
        let lattice = SiteLattice::of_grating(turns, sites)?;
        if lattice.len() != sites {
            continue;
        }
        let multiple = MULTIPLES[rng.random_range(0..MULTIPLES.len())];
        // Not the same jumps for all rows.
        let jump = JUMPS_TURNS[number / JUMPS_TURNS.len() % JUMPS_TURNS.len()];
        let start: f64 = rng.random();
        // Not the same mapping for all rows, nor for all jumps.
        let mapping = &mappings[number / (ROW_EVERY * JUMPS_TURNS.len()) % mappings.len()];
        let widths_nm = (0..sites)
            .map(|i| {
                let place = lattice.site(i).map(|v| v as f64);
                let along = f64::from(turns[0]) * place[0] + f64::from(turns[1]) * place[1];
                let off = jump * (2.0 * rng.random::<f64>() - 1.0);
                mapping.width_nm((start + multiple * along / sites as f64 + off).rem_euclid(1.0))
            })
            .collect();
        all.push(RandomSupercell { lattice, widths_nm });
    }
    Ok(all)
}

/// Supercells of one site: pillars whose neighbours are all equal.
///
/// # Errors
/// None, as for [`ensemble`].
pub(crate) fn equal_pillars(mappings: &[Mapping]) -> Result<Vec<RandomSupercell>> {
    (0..EQUAL)
        .map(|i| {
            Ok(RandomSupercell {
                lattice: SiteLattice::row(1)?,
                widths_nm: vec![mappings[i % mappings.len()].width_nm((i as f64 + 0.5) / EQUAL as f64)],
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn supercells_are_many_sided_and_the_same_each_time() {
        let mapping = Mapping::new(|u| 100 + (u * 200.0) as u16);
        let all = ensemble(std::slice::from_ref(&mapping), 64).unwrap();
        assert_eq!(all, ensemble(std::slice::from_ref(&mapping), 64).unwrap());
        assert_eq!(all[..10], ensemble(std::slice::from_ref(&mapping), 10).unwrap());
        let mut widths: Vec<u16> = all.iter().flat_map(|c| &c.widths_nm).map(|w| *w as u16).collect();
        assert!(all.iter().all(|c| c.widths_nm.len() == c.lattice.len()));
        widths.sort_unstable();
        widths.dedup();
        // Some 460 sites over 200 widths: nine in ten are met, but for chance.
        assert!(widths.len() > 150, "{}", widths.len());
        let rows = all
            .iter()
            .filter(|c| c.lattice == SiteLattice::row(c.lattice.len()).unwrap());
        assert!(rows.count() >= 16);
    }
}
