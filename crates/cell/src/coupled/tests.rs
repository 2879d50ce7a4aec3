//! Tests of the transmission of the sites of a supercell.

use metalith_rcwa::SiteLattice;
use num_complex::Complex64;

use super::{CoarseCell, RealRow};
use crate::CellStack;

/// Two ways to one number differ by the rounding of eigenvectors of a few hundred unknowns.
const ROUNDING: f64 = 1e-9;

const WAVELENGTH_UM: f64 = 0.53;
const WIDTHS_NM: (f64, f64) = (100.0, 300.0);

/// A single cell takes neighbours of the row of jumps below for equals. Its misfit was measured as 0.027 of the light, all pillars
/// of the ring counted.
const JUMPS: std::ops::Range<f64> = 0.02..0.035;

fn stack() -> CellStack {
    CellStack::paper(350.0, 700.0).unwrap()
}

#[test]
fn sites_hold_the_power_of_the_orders_that_they_can_tell_apart() {
    let stack = stack();
    let cell = CoarseCell::new(&stack, WAVELENGTH_UM, WIDTHS_NM).unwrap();
    let row = SiteLattice::row(4).unwrap();
    // In the x-z plane a row does not couple s and p, so that all power is polarised as the incident wave.
    let response = cell.solve(row, &[110.0, 150.0, 200.0, 260.0], [-0.1, 0.0]).unwrap();
    let (step, full) = (cell.wavelength_over_pitch(), cell.full_transmission().unwrap());
    let sites = cell.transmissions(&row, &response, full);
    for pol in [0, 1] {
        let mean = sites[pol].iter().map(Complex64::norm_sqr).sum::<f64>() / 4.0;
        let within = response.orders.iter().filter(|o| o.sines[0].abs() < 0.5 * step);
        let power: f64 = within.map(|o| o.power[pol]).sum();
        assert!((mean - power * full * full).abs() < ROUNDING, "{mean} {power}");
    }
}

#[test]
fn single_cells_are_right_for_equal_pillars_and_not_for_jumps() {
    let stack = stack();
    let cell = CoarseCell::new(&stack, WAVELENGTH_UM, WIDTHS_NM).unwrap();
    let full = cell.full_transmission().unwrap();
    let one = SiteLattice::row(1).unwrap();
    let local = |widths: &[f64]| {
        let mut t = [Vec::new(), Vec::new()];
        for &width in widths {
            let response = cell.solve(one, &[width], [0.0, 0.0]).unwrap();
            let single = cell.transmissions(&one, &response, full);
            t.iter_mut().zip(single).for_each(|(all, s)| all.extend(s));
        }
        t
    };
    let misfit = |direction: [i32; 2], widths_nm: Vec<f64>| {
        let row = RealRow {
            direction,
            widths_nm,
            repeats: true,
        };
        let solved = row.solve(&cell, [0.0, 0.0])?;
        Ok::<_, metalith_core::Error>(solved.misfit(&local(&solved.widths_nm)))
    };
    for direction in [[1, 0], [0, 1], [1, 1]] {
        assert!(misfit(direction, vec![180.0; 3]).unwrap() < ROUNDING);
    }
    // Twelve rings near r = 140 um of the prototype, whose optimised phase jumps from ring to ring (nm).
    let jumps = vec![
        122.0, 122.0, 298.0, 264.0, 262.0, 262.0, 242.0, 228.0, 228.0, 228.0, 204.0, 202.0,
    ];
    let along_x = misfit([1, 0], jumps.clone()).unwrap();
    assert!(JUMPS.contains(&along_x), "{along_x}");
    let along_y = misfit([0, 1], jumps).unwrap();
    assert!((along_x - along_y).abs() < ROUNDING, "{along_x} {along_y}");
    assert!(misfit([2, 0], vec![180.0; 4]).is_err());
}
