//! Neighbourhoods that responses are fitted to: supercells whose widths are drawn by chance, blazed gratings such as a lens
//! is made of, and lattices of equal pillars.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use metalith_core::Result;
use metalith_rcwa::SiteLattice;

use super::{Blaze, Mapping, SiteGrid};

/// Supercells drawn by chance along the normal, where each of their sites counts for eight by symmetry, and for other
/// directions. With half as many, the residual grows by a tenth.
const RANDOM: [usize; 2] = [120, 280];

/// Sites of oblique supercells, and of rows along x where those have a mirror plane, which halves the unknowns. The time
/// grows with the third power, and a cell of few sites is its own neighbour.
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

/// Blazed gratings for oblique light: an element that is lit so turns it to the normal, so that its places are gratings
/// about one vector. Those within this distance of it (turns a pitch) are as steep as a lens of sine 0.2 on top of the wedge.
const BLAZED: usize = 160;
const ABOUT: f64 = 0.16;
const BLAZED_SITES: std::ops::RangeInclusive<usize> = 3..=9;

/// Along the normal: rows of all numbers of pillars, this many of each of the shorter ones, up to these turns a pitch.
const NORMAL_SITES: std::ops::RangeInclusive<usize> = 3..=12;
const STARTS: usize = 12;
const STEEPEST: f64 = 0.45;

/// Weight of a site of a blazed grating, as so many sites. Without them, steered elements have too little light in the
/// first order, rows of the truth at 530 nm by 0.045 rms instead of 0.020; and no row of real pillars gets worse.
const BLAZED_WEIGHT: f64 = 3.0;

/// Different pillars side by side.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TrainingCell {
    pub lattice: SiteLattice,
    /// Width of each site (nm), in the order of the lattice.
    pub widths_nm: Vec<f64>,
    /// Weight of each, as so many sites.
    pub weight: f64,
}

/// All supercells of a table for light that a grating of the vector `straight` (turns a pitch) turns to the normal.
///
/// # Errors
/// None, as all are within what lattices allow.
pub(crate) fn cells(grid: SiteGrid, mappings: &[Mapping], straight: [f64; 2]) -> Result<Vec<TrainingCell>> {
    let oblique = straight != [0.0; 2];
    let mirror = grid.is_square() && straight[1] == 0.0;
    let mut all = random(mappings, RANDOM[usize::from(oblique)], mirror)?;
    all.extend(equal_pillars(mappings)?);
    all.extend(blazed(grid, mappings, straight)?);
    Ok(all)
}

/// Some supercells: each a grating of any vector, whose phases are off by chance, drawn by the mappings in turn. The first
/// of a longer list are those of a shorter one. Rows are short where there is no mirror plane.
pub(crate) fn random(mappings: &[Mapping], count: usize, mirror: bool) -> Result<Vec<TrainingCell>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut all = Vec::with_capacity(count);
    while all.len() < count {
        let number = all.len();
        let is_row = number % ROW_EVERY == ROW_EVERY - 1;
        let sizes = if is_row && mirror { ROW_SITES } else { OBLIQUE_SITES };
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
        all.push(TrainingCell {
            lattice,
            widths_nm,
            weight: 1.0,
        });
    }
    Ok(all)
}

/// Supercells of one site: pillars whose neighbours are all equal.
fn equal_pillars(mappings: &[Mapping]) -> Result<Vec<TrainingCell>> {
    (0..EQUAL)
        .map(|i| {
            Ok(TrainingCell {
                lattice: SiteLattice::row(1)?,
                widths_nm: vec![mappings[i % mappings.len()].width_nm((i as f64 + 0.5) / EQUAL as f64)],
                weight: 1.0,
            })
        })
        .collect()
}

/// Blazed gratings that repeat exactly, drawn by the mappings in turn; where the phase starts is drawn by chance.
fn blazed(grid: SiteGrid, mappings: &[Mapping], straight: [f64; 2]) -> Result<Vec<TrainingCell>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    gratings(grid, straight)?
        .into_iter()
        .enumerate()
        .map(|(number, (turns, sites))| {
            let lattice = SiteLattice::of_grating(turns, sites)?;
            let blaze = Blaze {
                turns,
                sites,
                offset_turns: rng.random(),
            };
            let mapping = &mappings[number % mappings.len()];
            Ok(TrainingCell {
                lattice,
                widths_nm: blaze.widths_nm(&lattice, |u| mapping.width_nm(u)),
                weight: BLAZED_WEIGHT,
            })
        })
        .collect()
}

/// Turns and sites of blazed gratings whose supercell has no fewer sites.
fn gratings(grid: SiteGrid, straight: [f64; 2]) -> Result<Vec<([i32; 2], usize)>> {
    let all = |sites: usize| {
        let most = sites as i32;
        (-most..=most).flat_map(move |p| (-most..=most).map(move |q| [p, q]))
    };
    let whole =
        |turns: [i32; 2], sites: usize| -> Result<bool> { Ok(SiteLattice::of_grating(turns, sites)?.len() == sites) };
    let mut found = Vec::new();
    if straight == [0.0; 2] {
        for sites in NORMAL_SITES {
            for turns in 1..=(STEEPEST * sites as f64) as i32 {
                if whole([turns, 0], sites)? {
                    let starts = (4 * STARTS / sites).clamp(STARTS / 4, STARTS);
                    found.extend(std::iter::repeat_n(([turns, 0], sites), starts));
                }
            }
        }
        return Ok(found);
    }
    for sites in BLAZED_SITES {
        for turns in all(sites) {
            let vector = grid.vector(turns.map(|turns| f64::from(turns) / sites as f64));
            let off = [0, 1].map(|axis| vector[axis] - straight[axis]);
            if off[0].hypot(off[1]) <= ABOUT && whole(turns, sites)? {
                found.push((turns, sites));
            }
        }
    }
    Ok(found.iter().copied().cycle().take(BLAZED).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapping() -> Mapping {
        Mapping::new(|u| 100 + (u * 200.0) as u16)
    }

    #[test]
    fn supercells_are_many_sided_and_the_same_each_time() {
        let mapping = mapping();
        let drawn = |count: usize| random(std::slice::from_ref(&mapping), count, true).unwrap();
        let all = drawn(64);
        assert_eq!(all, drawn(64));
        assert_eq!(all[..10], drawn(10));
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

    #[test]
    fn blazed_gratings_are_about_the_vector_that_straightens_the_light() {
        for straight in [[0.17, 0.0], [0.3, -0.3], [-0.43, 0.2]] {
            let found = gratings(SiteGrid::SQUARE, straight).unwrap();
            assert_eq!(found.len(), BLAZED);
            for ([p, q], sites) in found {
                let off = [p, q].map(|t| f64::from(t) / sites as f64);
                assert!((off[0] - straight[0]).hypot(off[1] - straight[1]) <= ABOUT);
            }
        }
        let rows = gratings(SiteGrid::SQUARE, [0.0; 2]).unwrap();
        assert!(rows.contains(&([1, 0], 3)) && rows.contains(&([2, 0], 5)));
        assert!(rows.iter().all(|(turns, _)| turns[1] == 0));
        // Light that no grating straightens has none.
        assert!(gratings(SiteGrid::SQUARE, [3.0, 0.0]).unwrap().is_empty());
        let all = cells(SiteGrid::SQUARE, &[mapping()], [0.17, 0.0]).unwrap();
        assert_eq!(all.len(), RANDOM[1] + EQUAL + BLAZED);
    }
}
