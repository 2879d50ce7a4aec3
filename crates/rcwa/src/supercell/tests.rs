use super::*;
use crate::solve;

/// Two ways to one number differ by the rounding of eigenvectors of a few hundred unknowns.
const ROUNDING: f64 = 1e-9;

fn stack(width_nm: f64, slices: usize) -> LayerStack {
    let layer = |slice: usize| Layer {
        height_nm: 700.0 / slices as f64,
        outline: Outline::square(width_nm - 10.0 * slice as f64),
        inside: Complex64::new(2.05, 0.0),
        outside: Complex64::ONE,
    };
    LayerStack {
        pitch_nm: 350.0,
        lattice: CellLattice::Square,
        below: Complex64::new(1.46, 0.0),
        layers: (0..slices).map(layer).collect(),
        above: Complex64::ONE,
    }
}

fn supercell(lattice: SiteLattice, widths_nm: &[f64], slices: usize) -> Supercell {
    let cells: Vec<_> = widths_nm.iter().map(|&w| stack(w, slices)).collect();
    Supercell::of_cells(lattice, &cells).unwrap()
}

fn arriving(sines: [f64; 2]) -> Incidence {
    Incidence::of_sines(0.53, Side::Below, sines)
}

#[test]
fn equal_pillars_are_the_single_cell() {
    for (turns, sites) in [([1, 0], 3), ([1, 2], 5), ([2, 2], 4)] {
        let lattice = SiteLattice::of_grating(turns, sites).unwrap();
        let widths = vec![180.0; lattice.len()];
        for sines in [[0.0, 0.0], [-0.2, 0.0], [0.1, -0.15]] {
            let one = solve(&stack(180.0, 2), &arriving(sines), Orders::new(5).unwrap()).unwrap();
            let many = solve_supercell(&supercell(lattice, &widths, 2), &arriving(sines), 2).unwrap();
            let zero = many.order([0, 0]).unwrap();
            for pol in [0, 1] {
                assert!(
                    (zero.power[pol] - one.zero_order()[pol]).abs() < ROUNDING,
                    "{turns:?} {sines:?}"
                );
            }
        }
    }
}

#[test]
fn power_is_kept() {
    let cases = [
        (SiteLattice::row(3).unwrap(), [0.1, 0.0]),
        (SiteLattice::row(3).unwrap(), [0.1, 0.2]),
        (SiteLattice::of_grating([1, 1], 3).unwrap(), [0.0, 0.0]),
        (SiteLattice::of_grating([0, 1], 3).unwrap(), [-0.1, 0.3]),
    ];
    for (lattice, sines) in cases {
        let cell = supercell(lattice, &[110.0, 160.0, 240.0], 2);
        for power in solve_supercell(&cell, &arriving(sines), 2).unwrap().total_power() {
            assert!((power - 1.0).abs() < ROUNDING, "{lattice:?}: {power}");
        }
    }
}

#[test]
fn a_shift_turns_the_phase_of_an_order() {
    let lattice = SiteLattice::of_grating([1, 2], 5).unwrap();
    let widths = [110.0, 130.0, 170.0, 200.0, 240.0];
    let mut shifted = widths;
    shifted.rotate_left(1);
    let sines = [0.07, -0.02];
    let [here, there] =
        [widths, shifted].map(|w| solve_supercell(&supercell(lattice, &w, 1), &arriving(sines), 1).unwrap());
    for (a, b) in here.orders.iter().zip(&there.orders) {
        // Site 1 has become site 0, a pitch along x.
        let turn = Complex64::cis(TAU * f64::from(a.wave[0]) / 5.0);
        for pol in [0, 1] {
            for axis in [0, 1] {
                let error = (a.transmitted[pol][axis] * turn - b.transmitted[pol][axis]).norm();
                assert!(error < ROUNDING, "{:?}: {error}", a.wave);
            }
        }
    }
}

#[test]
fn mirrors_and_a_quarter_turn_change_nothing() {
    let widths = [110.0, 170.0, 200.0, 260.0];
    let row = solve_supercell(
        &supercell(SiteLattice::row(4).unwrap(), &widths, 1),
        &arriving([-0.3, 0.0]),
        2,
    )
    .unwrap();
    let mut reversed = widths;
    reversed.reverse();
    let back = supercell(SiteLattice::row(4).unwrap(), &reversed, 1);
    let back = solve_supercell(&back, &arriving([0.3, 0.0]), 2).unwrap();
    let column = supercell(SiteLattice::of_grating([0, 1], 4).unwrap(), &widths, 1);
    let column = solve_supercell(&column, &arriving([0.0, -0.3]), 2).unwrap();
    for order in &row.orders {
        let [x, y] = order.wave;
        for pol in [0, 1] {
            let mirrored = back.order([-x, y]).unwrap().power[pol];
            let turned = column.order([y, x]).unwrap();
            assert!((order.amplitude(pol) - turned.amplitude(pol)).norm() < ROUNDING);
            let turned = turned.power[pol];
            assert!((order.power[pol] - mirrored).abs() < ROUNDING, "{:?}", order.wave);
            assert!((order.power[pol] - turned).abs() < ROUNDING, "{:?}", order.wave);
        }
    }
}

#[test]
fn the_mirror_of_a_row_loses_nothing() {
    let cell = supercell(SiteLattice::row(3).unwrap(), &[110.0, 170.0, 260.0], 1);
    let incidence = arriving([-0.2, 0.0]);
    let with = solve_supercell(&cell, &incidence, 2).unwrap();
    let problem = SupercellProblem::new(&cell, &incidence, 2).unwrap();
    let unit = [[Complex64::ONE, Complex64::ZERO], [Complex64::ZERO, Complex64::ONE]];
    let part = problem.part(Space::Full, &unit).unwrap();
    let without = SupercellResponse::new(&problem, &incidence, &[part]).unwrap();
    for (a, b) in with.orders.iter().zip(&without.orders) {
        for pol in [0, 1] {
            assert!((a.amplitude(pol) - b.amplitude(pol)).norm() < ROUNDING, "{:?}", a.wave);
        }
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let lattice = SiteLattice::row(2).unwrap();
    let of_cells = |cells: &[LayerStack]| Supercell::of_cells(lattice, cells);
    assert!(matches!(
        of_cells(&[stack(100.0, 1)]),
        Err(Error::CellCount { cells: 1, sites: 2 })
    ));
    assert!(matches!(
        of_cells(&[stack(100.0, 1), stack(100.0, 2)]),
        Err(Error::UnlikeCells { cell: 2 })
    ));
    assert!(matches!(
        of_cells(&[stack(100.0, 1), stack(400.0, 1)]),
        Err(Error::Width { width_nm: 400.0, .. })
    ));
    let cell = supercell(lattice, &[100.0, 200.0], 1);
    assert!(matches!(
        solve_supercell(&cell, &arriving([1.5, 0.0]), 1),
        Err(Error::NoIncidentWave { .. })
    ));
    assert!(matches!(
        solve_supercell(&cell, &arriving([0.0, 0.0]), usize::MAX),
        Err(Error::SupercellOrders { .. })
    ));
    assert!(matches!(
        solve_supercell(&cell, &arriving([0.0, 0.1]), 63),
        Err(Error::SupercellTooLarge {
            sites: 2,
            unknowns: 64_000..,
            ..
        })
    ));
    let mut bare = cell.clone();
    bare.layers[0].outlines.pop();
    assert!(matches!(
        solve_supercell(&bare, &arriving([0.0, 0.0]), 1),
        Err(Error::OutlineCount {
            layer: 1,
            outlines: 1,
            sites: 2
        })
    ));
}

/// The number of unknowns is known before any of them is made.
#[test]
fn unknowns_are_counted_ahead() {
    for (turns, sites, y) in [
        ([1, 0], 3, Space::Even),
        ([1, 0], 4, Space::Odd),
        ([1, 2], 5, Space::Full),
        ([2, 2], 4, Space::Full),
    ] {
        let lattice = SiteLattice::of_grating(turns, sites).unwrap();
        let placed = Placed {
            lattice,
            staggered: None,
        };
        let waves = Waves::new(&placed, 2, y, [0.1, 0.0], 1.5);
        assert_eq!(waves.rows.len(), Waves::unknowns(&placed, 2, y));
    }
}
