//! A figure of the light in the first order of blazed rows of pillars: supercells, equal neighbours, `neighbours`.
//!
//! The mapping is that of `designs/prototype_3x3.toml`. Run it with
//! `cargo run --release -p metalith-design --example first_order -- FILE.svg [NM]`; 530 nm if left out, and one of the wavelengths
//! whose tables are shipped for light along the normal.

#[allow(dead_code, reason = "tests compare by the rest")]
#[path = "../tests/blazed_orders/mod.rs"]
mod blazed_orders;
#[allow(dead_code, reason = "tests compare by it")]
#[path = "../tests/prototype_rows/mod.rs"]
mod prototype_rows;

use std::path::Path;

use blazed_orders::BlazeOrders;
use metalith_cell::{Blaze, CellModel, CoarseCell, PointwiseCell};
use metalith_rcwa::SiteLattice;
use metalith_report::{Axis, Chart};
use num_complex::Complex64;
use prototype_rows::{Prototype, order};

/// Pillars a turn of the rows, and how many places within a pillar their phase starts at.
const ROWS: [usize; 10] = [3, 4, 5, 6, 7, 8, 9, 12, 15, 18];
const STARTS: usize = 4;
const ALONG_NORMAL: [f64; 2] = [0.0; 2];

fn main() {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().expect("give the file of the figure");
    let nm: f64 = arguments
        .next()
        .map_or(530.0, |nm| nm.parse().expect("a wavelength in nm"));
    let prototype = Prototype::new();
    let stack = prototype.design.cell_stack().unwrap();
    let um = nm * 1e-3;
    let coarse = CoarseCell::new(&stack, um, prototype.mapping.range_nm()).unwrap();
    let full = coarse.full_transmission().unwrap();
    let equal = PointwiseCell::new(stack.clone(), prototype.design.cell.widths_nm());
    let equal = equal
        .transmissions(um, prototype.design.cell.pitch_nm.nm() as u16)
        .unwrap();
    let table = prototype.neighbours(um, ALONG_NORMAL);

    let mut shares: Vec<(f64, [f64; 3])> = Vec::new();
    for pillars in ROWS {
        let lattice = SiteLattice::row(pillars).unwrap();
        let mut sums = [0.0; 3];
        for start in 0..STARTS {
            let blaze = Blaze {
                turns: [1, 0],
                sites: pillars,
                offset_turns: start as f64 / (STARTS * pillars) as f64,
            };
            let width = |u: f64| prototype.mapping.width_nm(u);
            let widths = blaze.widths_nm(&lattice, width);
            let first = |sites: &[Complex64], full: f64| (order(&blaze, sites, 1.0) / full).norm_sqr();
            let solved = BlazeOrders::solve(&blaze, &coarse, width, ALONG_NORMAL).order(1).share;
            let alone: Vec<Complex64> = widths.iter().map(|w| equal[w.round() as usize]).collect();
            let pairs = table.sites(&lattice, &widths, 1.0);
            let found = [
                (solved[0] + solved[1]) / 2.0,
                first(&alone, full),
                (first(&pairs[0], 1.0) + first(&pairs[1], 1.0)) / 2.0,
            ];
            sums.iter_mut()
                .zip(found)
                .for_each(|(sum, f)| *sum += f / STARTS as f64);
        }
        println!(
            "{pillars} pillars a turn: supercells {:.3}, equal neighbours {:.3}, `neighbours` {:.3}",
            sums[0], sums[1], sums[2]
        );
        shares.push((pillars as f64, sums));
    }
    let line = |k: usize| shares.iter().map(move |(x, s)| (*x, s[k]));
    let mut chart = Chart::new(
        format!("Light in the first order of blazed rows at {nm} nm, along the normal"),
        Axis::linear("pillars a turn of phase", "").range(2.5, 18.5),
        Axis::linear("share of the arriving light", "").range(0.5, 0.95),
    );
    chart
        .line("equal neighbours", line(1))
        .line("neighbours", line(2))
        .points("supercells", line(0));
    let figure = chart.size(640.0, 340.0).caption(String::new());
    figure.write_svg(Path::new(&file)).expect("the figure is written");
}
