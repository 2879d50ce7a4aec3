//! Rows of pillars on a hexagonal lattice.

use metalith_cell::{CoarseCell, RealRow};
use metalith_design::Design;
use metalith_rcwa::Orders;

/// A row of equal pillars is the single cell, with as many orders, at each of its sites, whichever way it goes.
#[test]
fn equal_pillars_transmit_as_one() {
    /// Rounding of the eigenvectors of a few hundred unknowns.
    const ROUNDING: f64 = 1e-8;
    const DIAMETER_NM: f64 = 320.0;
    let design = Design::read(&metalith_testing::design("hexagonal_1550")).unwrap();
    let stack = design.cell_stack().unwrap();
    let cell = CoarseCell::new(&stack, 1.55, (150.0, 516.0)).unwrap();
    let orders = Orders::new(7).unwrap();
    let one = stack.transmission(DIAMETER_NM + cell.shift_nm(), 1.55, orders).unwrap();
    for direction in RealRow::axes([-0.2, -0.1]) {
        let row = RealRow {
            direction,
            widths_nm: vec![DIAMETER_NM; 12],
            repeats: true,
        };
        let solved = row.solve(&cell, [0.0; 2]).unwrap();
        let [s, p] = solved.transmitted();
        // Rows are whole nanometres apart: the single cell is the mean of both.
        for (s, p) in s.iter().zip(p) {
            let off = (0.5 * (s + p) - one).norm();
            assert!(off < ROUNDING, "{direction:?}: {off:.1e}");
        }
    }
}

/// The element's phase is that of its pillars: neighbours in a row along x are half a pitch apart.
#[test]
fn rows_of_an_element_are_half_a_pitch_or_a_row_apart() {
    use metalith_core::Wedge;
    use metalith_design::phase::{ElementPhase, LensPhase, RadialPhase};
    let design = Design::read(&metalith_testing::design("hexagonal_1550")).unwrap();
    let lattice = design.lattice();
    let lens = LensPhase::new(lattice, design.lens.diameter_nm, &RadialPhase::Flat);
    let sines = [-0.2, -0.1];
    let wedge = Wedge {
        wavelength_um: 1.55,
        sin_x: sines[0],
        sin_y: sines[1],
    };
    let phase = ElementPhase::new(&lens, &wedge);
    let steps_um = lattice.steps_um();
    for direction in RealRow::axes(sines) {
        let turns = phase.row(20.0, direction, 8).unwrap();
        let axis = usize::from(direction[0] == 0);
        // From a site to the second after it, which stands as it does: two places of the grid along the axis.
        let moved = 2.0 * f64::from(direction[axis]) * steps_um[axis] * sines[axis] / 1.55;
        for pair in turns.windows(3) {
            let off = (pair[2] - pair[0] - moved + 0.5).rem_euclid(1.0) - 0.5;
            // The wedge turns the phase by as much, to either sign.
            let other = (pair[2] - pair[0] + moved + 0.5).rem_euclid(1.0) - 0.5;
            assert!(off.abs().min(other.abs()) < 1e-6, "{direction:?}: {off} {other}");
        }
    }
}
