//! The cell of the shipped design on a hexagonal lattice.

use metalith_cell::{CellStack, CellTable, TableSpec};
use metalith_core::Silent;
use metalith_design::{Design, PillarRule};
use metalith_rcwa::{CellLattice, Orders};

/// The library of a hexagonal lattice is of that: rows are as far apart as they are written, and pillars may touch along them.
#[test]
fn a_hexagonal_lattice_has_a_library_of_its_own() {
    let design = Design::read(&metalith_testing::design("hexagonal_1550")).unwrap();
    let stack = design.cell_stack().unwrap();
    assert_eq!(stack.lattice, CellLattice::Staggered { row_nm: 606.0 });
    let spec = TableSpec {
        band_um: (1.549, 1.551),
        widths_nm: (300, 302),
        tolerance: 0.02,
        orders: 5,
        stack,
    };
    let table = CellTable::compute(&spec, &Silent).unwrap();
    let orders = Orders::new(spec.orders).unwrap();
    let square = CellStack {
        lattice: CellLattice::Square,
        ..spec.stack.clone()
    };
    for width in [300.0, 301.0, 450.0] {
        let got = table.transmission(width, 1.55).unwrap();
        let want = spec.stack.transmission(width, 1.55, orders).unwrap();
        assert!((got - want).norm() < spec.tolerance, "{width}: {got} {want}");
    }
    let other = square.transmission(300.0, 1.55, orders).unwrap();
    let got = table.transmission(300.0, 1.55).unwrap();
    assert!((got - other).norm() > 5.0 * spec.tolerance, "{got} {other}");
}

/// The shipped design's mapping is that of the solver.
#[test]
fn the_mapping_of_the_hexagonal_design_is_that_of_its_cell() {
    let design = Design::read(&metalith_testing::design("hexagonal_1550")).unwrap();
    let stack = design.cell_stack().unwrap();
    let orders = Orders::new(17).unwrap();
    let phase = |width: f64| stack.transmission(width, 1.55, orders).unwrap().arg() / std::f64::consts::TAU;
    let rule = PillarRule::new(&design.cell, &design.mapping);
    let errors: Vec<f64> = (0..24)
        .map(|k| f64::from(k) / 24.0)
        .map(|u| phase(f64::from(rule.width_nm(u))) - phase(150.0) - u)
        .map(|turns| std::f64::consts::TAU * (turns - turns.round()))
        .collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    // 0.008 of the fit, and widths are rounded to 2 nm: 0.02 rad where the phase rises fastest.
    const FITTED: f64 = 0.03;
    assert!(rms < FITTED, "{rms}");
}
