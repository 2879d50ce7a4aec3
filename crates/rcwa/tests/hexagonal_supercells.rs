//! Supercells of circles on a hexagonal lattice: equal pillars, power, symmetry, reciprocity, convergence.

use metalith_rcwa::{
    CellLattice, Incidence, Layer, LayerStack, Orders, Outline, Side, SiteLattice, Supercell, SupercellResponse, solve,
    solve_supercell,
};
use num_complex::Complex64;

/// Two ways to one number differ by the rounding of eigenvectors of a few hundred unknowns.
const ROUNDING: f64 = 1e-8;

const PITCH_NM: f64 = 800.0;

/// A pillar of amorphous silicon on silica, or what is near it.
fn cell(diameter_nm: f64) -> LayerStack {
    LayerStack {
        pitch_nm: PITCH_NM,
        lattice: CellLattice::hexagonal(PITCH_NM),
        below: Complex64::from(1.444),
        layers: vec![Layer {
            height_nm: 900.0,
            outline: Outline::circle(diameter_nm),
            inside: Complex64::from(3.48),
            outside: Complex64::ONE,
        }],
        above: Complex64::ONE,
    }
}

/// Pillars in the order of the phase of a grating, `turns` over both steps.
fn solved(
    turns: [i32; 2],
    diameters_nm: &[f64],
    incidence: &Incidence,
    highest: usize,
) -> (SiteLattice, SupercellResponse) {
    let sites = diameters_nm.len();
    let lattice = SiteLattice::of_grating(turns, sites).unwrap();
    assert_eq!(lattice.len(), sites);
    let cells: Vec<_> = (0..sites)
        .map(|i| {
            let [x, y] = lattice.site(i).map(|step| step as i32);
            cell(diameters_nm[(turns[0] * x + turns[1] * y).rem_euclid(sites as i32) as usize])
        })
        .collect();
    let supercell = Supercell::of_cells(lattice, &cells).unwrap();
    (lattice, solve_supercell(&supercell, incidence, highest).unwrap())
}

fn arriving(sines: [f64; 2]) -> Incidence {
    Incidence::of_sines(1.55, Side::Below, sines)
}

/// Half a pitch from one to the next along x, in two rows; along y; along the lattice; across all of these.
const GRATINGS: [([i32; 2], usize); 4] = [([2, 1], 6), ([0, 1], 4), ([1, 0], 3), ([1, 3], 7)];

/// Whatever supercell equal pillars are taken for, they are the single cell: its zero order, and no other.
#[test]
fn equal_pillars_are_the_single_cell() {
    const HIGHEST: usize = 2;
    for (turns, sites) in GRATINGS {
        for sines in [[0.0, 0.0], [-0.2, 0.0], [0.1, -0.15]] {
            let incidence = arriving(sines);
            let one = solve(&cell(430.0), &incidence, Orders::new(2 * HIGHEST + 1).unwrap()).unwrap();
            let (_, many) = solved(turns, &vec![430.0; sites], &incidence, HIGHEST);
            for order in &many.orders {
                for pol in [0, 1] {
                    let wanted = if order.wave == [0, 0] {
                        one.zero_order()[pol]
                    } else {
                        0.0
                    };
                    let off = (order.power[pol] - wanted).abs();
                    assert!(off < ROUNDING, "{turns:?} {sines:?} {:?}: {off:.1e}", order.wave);
                }
            }
            assert!(many.orders.len() > 1, "{turns:?} {sines:?}");
        }
    }
}

#[test]
fn unlike_pillars_lose_no_power() {
    for (turns, sites) in GRATINGS {
        let diameters: Vec<f64> = (0..sites).map(|i| 240.0 + 300.0 * i as f64 / sites as f64).collect();
        for sines in [[0.0, 0.0], [0.1, -0.15]] {
            let (_, found) = solved(turns, &diameters, &arriving(sines), 2);
            for power in found.total_power() {
                assert!((power - 1.0).abs() < ROUNDING, "{turns:?} {sines:?}: {power}");
            }
        }
    }
}

/// The order of a grating, mean of s and p, whatever light they are of.
fn share(turns: [i32; 2], lattice: &SiteLattice, found: &SupercellResponse, order: i32) -> f64 {
    assert!(lattice.len() > 1);
    let order = found.order(turns.map(|t| order * t)).unwrap();
    0.5 * (order.power[0] + order.power[1])
}

/// Steered along x and along the direction a sixth of a turn from it, pillars do the same.
#[test]
fn a_sixth_of_a_turn_changes_nothing() {
    let diameters = [240.0, 300.0, 350.0, 400.0, 450.0, 520.0];
    let shares = |turns: [i32; 2]| {
        let (lattice, found) = solved(turns, &diameters, &arriving([0.0; 2]), 2);
        [-1, 0, 1].map(|order| share(turns, &lattice, &found, order))
    };
    let along_x = shares([2, 1]);
    for turned in [[1, 2], [-1, 1]].map(shares) {
        for (a, b) in along_x.iter().zip(turned) {
            assert!((a - b).abs() < ROUNDING, "{along_x:?} {turned:?}");
        }
    }
    // A grating, and no lattice of equal pillars.
    assert!((along_x[0] - along_x[2]).abs() > 0.1, "{along_x:?}");
}

/// A pillar further along turns the orders, and does nothing else.
#[test]
fn a_shift_turns_the_phase_of_an_order() {
    let diameters = [240.0, 300.0, 350.0, 400.0, 450.0, 520.0];
    let mut shifted = diameters;
    shifted.rotate_left(1);
    let [here, there] = [diameters, shifted].map(|d| solved([2, 1], &d, &arriving([0.07, -0.02]), 2).1);
    for (a, b) in here.orders.iter().zip(&there.orders) {
        // The site at the second step has become that at the origin.
        let turn = Complex64::cis(std::f64::consts::TAU * f64::from(a.wave[1]) / 6.0);
        for (a, b) in a.transmitted.iter().flatten().zip(b.transmitted.iter().flatten()) {
            assert!((a * turn - b).norm() < ROUNDING);
        }
    }
}

/// More plane waves change the share of the first order of a steered row little, but for the fewest: of silicon those are for guesses.
#[test]
fn the_first_order_converges() {
    const CONVERGED: [f64; 3] = [0.2, 0.01, 0.01];
    let share = |highest: usize| {
        let (lattice, found) = solved([2, 1], &[240.0, 330.0, 400.0, 480.0], &arriving([-0.3, 0.0]), highest);
        share([2, 1], &lattice, &found, 1)
    };
    let best = share(5);
    assert!(best > 0.1, "{best}");
    let off = [2, 3, 4].map(|highest| (share(highest) - best).abs());
    for (off, bound) in off.iter().zip(CONVERGED) {
        assert!(*off < bound, "{best} {off:?}");
    }
}
