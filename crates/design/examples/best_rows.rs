//! The most light that any pillars could send into the first order of a steep blazed row: an upper bound for mappings of
//! steered elements.
//!
//! Rows of 6 pillars a turn, as in the middle of an element that is steered by 15 degrees, of 3 a turn and of 5 in two turns, as at the
//! places of one that is steered by 30 degrees, in light
//! from where it looks. Any widths that `designs/wide_5x5.toml` may write, whatever the phase that they leave: what a lens
//! asks of the phase can only take light away. Widths are climbed one by one from many random starts, so that the best
//! found is the best there is if several starts end there. Beside it the mapping of the design, mean over where its phase
//! starts. `cargo run --release -p metalith-design --example best_rows`; 5 CPU minutes.

use metalith_cell::{Blaze, CoarseCell};
use metalith_design::{Design, PillarRule};
use metalith_rcwa::SiteLattice;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Wavelengths that mappings of steered elements are judged at (um).
const LIGHT_UM: [f64; 4] = [0.455, 0.53, 0.59, 0.66];

/// Starts of the climb, and its steps (nm).
const STARTS: u64 = 12;
const STEPS_NM: (f64, f64) = (40.0, 2.0);

/// Starts of the phase for the mapping of the design.
const OFFSETS: usize = 12;

fn main() {
    let design = Design::read(&metalith_testing::design("wide_5x5")).expect("a design of the repository");
    let rule = PillarRule::new(&design.cell, &design.mapping);
    let stack = design.cell_stack().expect("a cell");
    let range = design.cell.width_range_nm;
    let (low, high) = (f64::from(range.0), f64::from(range.1));
    let cells = LIGHT_UM.map(|um| CoarseCell::new(&stack, um, (low, high)).expect("a cell"));
    for (sites, turns) in [(6, 1), (3, 1), (5, 2)] {
        let lattice = SiteLattice::row(sites).expect("a row");
        let shares = |widths: &[f64]| {
            cells.each_ref().map(|cell| {
                let sine = -f64::from(turns) / sites as f64 * cell.wavelength_over_pitch();
                let solved = cell.solve(lattice, widths, [sine, 0.0]).expect("a supercell");
                let [s, p] = solved.order([turns, 0]).expect("the first order").power;
                (s + p) / 2.0
            })
        };
        let mean = |shares: [f64; 4]| shares.iter().sum::<f64>() / shares.len() as f64;
        let mut mapped = [0.0; 4];
        for offset in 0..OFFSETS {
            let blaze = Blaze {
                turns: [turns, 0],
                sites,
                offset_turns: offset as f64 / OFFSETS as f64,
            };
            let widths = blaze.widths_nm(&lattice, |u| f64::from(rule.width_nm(u)));
            for (sum, share) in mapped.iter_mut().zip(shares(&widths)) {
                *sum += share / OFFSETS as f64;
            }
        }
        let climbed = |seed: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut widths: Vec<f64> = (0..sites).map(|_| rng.random_range(low..high)).collect();
            let (mut best, mut step) = (mean(shares(&widths)), STEPS_NM.0);
            while step > STEPS_NM.1 {
                let mut rose = false;
                for (site, by) in (0..sites).flat_map(|site| [(site, step), (site, -step)]) {
                    let mut next = widths.clone();
                    next[site] = (next[site] + by).clamp(low, high);
                    let found = mean(shares(&next));
                    if found > best {
                        (best, widths, rose) = (found, next, true);
                    }
                }
                if !rose {
                    step /= 2.0;
                }
            }
            (best, widths)
        };
        let mut all: Vec<(f64, Vec<f64>)> = (0..STARTS).into_par_iter().map(climbed).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (best, widths) = &all[0];
        println!("{sites} pillars in {turns} turns, share of the first order at {LIGHT_UM:?} um:");
        println!("  mapping of the design {mapped:.3?}, mean {:.3}", mean(mapped));
        println!(
            "  any pillars {:.3?}, mean {best:.3}, widths {widths:.0?} nm",
            shares(widths)
        );
        let ends: Vec<f64> = all.iter().map(|(end, _)| *end).collect();
        println!("  ends of the climbs {ends:.3?}");
    }
}
