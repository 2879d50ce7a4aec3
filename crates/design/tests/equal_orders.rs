//! The solver of supercells against the truth, with as many diffraction orders as that was solved with.

#[allow(dead_code, reason = "the other tests compare by the rest")]
mod truth_rows;

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use metalith_cell::Blaze;
use metalith_design::{Design, PillarRule};
use metalith_rcwa::{Incidence, Side, SiteLattice, Supercell, SupercellResponse, solve_supercell};
use num_complex::Complex64;
use truth_rows::blazed_orders::first_order_sines;
use truth_rows::{Row, read};

/// Share of the zero and the first order, and amplitude of the first. Both solvers have the same unknowns, and the table
/// six digits: of all 192 rows the largest difference is 7e-7.
const SAME: f64 = 1e-5;

/// Rows of this many pillars need the fewest plane waves. All others take half an hour of CPU; this variable, set to anything, asks
/// for them too.
const CHEAP: usize = 5;
const ALL: &str = "METALITH_ALL_ROWS";

#[test]
#[ignore = "second tier: supercells with hundreds of plane waves take some CPU minutes"]
fn with_as_many_orders_it_is_the_truth() {
    let design = Design::read(&metalith_testing::design("prototype_3x3")).unwrap();
    let all = std::env::var_os(ALL).is_some();
    // Both polarisations come from one solution.
    let mut solved: BTreeMap<String, SupercellResponse> = BTreeMap::new();
    let mut largest = 0.0_f64;
    let mut compared = 0;
    for row in read().iter().filter(|row| all || row.cells == CHEAP) {
        let blaze = blaze(row);
        let key = format!("{blaze:?} {} {}", row.wavelength_nm, row.looks);
        let response = solved.entry(key).or_insert_with(|| solve(row, &blaze, &design));
        let [zero, first] = [0, row.turns].map(|order| response.order([order, 0]).unwrap());
        let off_the_wedge = Complex64::cis(-TAU * blaze.offset_turns);
        let off = [
            zero.power[row.polarisation] - row.share_zero,
            first.power[row.polarisation] - row.share_first,
            (first.amplitude(row.polarisation) * off_the_wedge - row.first).norm(),
        ];
        largest = off.iter().fold(largest, |largest, off| largest.max(off.abs()));
        compared += 1;
    }
    println!("{compared} rows: {largest:.1e}");
    assert!(compared >= 48 && largest < SAME, "{compared} rows: {largest}");
}

fn blaze(row: &Row) -> Blaze {
    Blaze {
        turns: [row.turns, 0],
        sites: row.cells,
        offset_turns: f64::from(row.turns) * row.offset / row.cells as f64,
    }
}

fn solve(row: &Row, blaze: &Blaze, design: &Design) -> SupercellResponse {
    let rule = PillarRule::new(&design.cell, &design.mapping);
    let stack = design.cell_stack().unwrap();
    let wavelength_um = f64::from(row.wavelength_nm) * 1e-3;
    let lattice = SiteLattice::of_grating(blaze.turns, blaze.sites).unwrap();
    let widths_nm = blaze.widths_nm(&lattice, |u| f64::from(rule.width_nm(u)));
    let cells = widths_nm.iter().map(|w| stack.layers(*w, wavelength_um));
    let cells = cells.collect::<Result<Vec<_>, _>>().unwrap();
    let supercell = Supercell::of_cells(lattice, &cells).unwrap();
    let wedge = first_order_sines(blaze, wavelength_um * 1e3 / stack.pitch_nm);
    let sines = if row.looks { wedge.map(|s| -s) } else { [0.0; 2] };
    let incidence = Incidence::of_sines(wavelength_um, Side::Below, sines);
    solve_supercell(&supercell, &incidence, row.highest_order).unwrap()
}
