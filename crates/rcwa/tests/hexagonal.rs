//! Circles on staggered rows: closed forms, symmetry, power, convergence, and the square lattice that is one of them.

use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

use metalith_rcwa::{
    CellLattice, Error, Incidence, Layer, LayerStack, Orders, Outline, Side, SiteLattice, Supercell, solve,
    solve_without_symmetry, transmit,
};
use num_complex::Complex64;

/// Rounding of the eigenvectors of a few hundred unknowns, whose condition is about 10^4.
const ROUNDING: f64 = 1e-9;

/// Amorphous silicon on silica at 1550 nm, or what is near it.
fn stack(lattice: CellLattice, pitch_nm: f64, outline: Outline) -> LayerStack {
    LayerStack {
        pitch_nm,
        lattice,
        below: Complex64::from(1.444),
        layers: vec![Layer {
            height_nm: 900.0,
            outline,
            inside: Complex64::from(3.48),
            outside: Complex64::ONE,
        }],
        above: Complex64::ONE,
    }
}

fn hexagonal(pitch_nm: f64, diameter_nm: f64) -> LayerStack {
    stack(CellLattice::hexagonal(pitch_nm), pitch_nm, Outline::circle(diameter_nm))
}

fn orders(n: usize) -> Orders {
    Orders::new(n).unwrap()
}

/// A film between two half-spaces, after Airy: transmission of the field along the normal.
fn film(stack: &LayerStack, index: Complex64, wavelength_um: f64) -> Complex64 {
    let (a, b) = (stack.below, stack.above);
    let turn = Complex64::cis(2.0 * PI * stack.layers[0].height_nm * 1e-3 / wavelength_um * index.re);
    let into = 2.0 * a / (a + index);
    let out = 2.0 * index / (index + b);
    let returned = (index - a) / (index + a) * (index - b) / (index + b);
    into * out * turn / (1.0 - returned * turn * turn)
}

#[test]
fn a_film_is_airys() {
    let empty = stack(CellLattice::hexagonal(800.0), 800.0, Outline::empty());
    let t = transmit(&empty, 1.55, Side::Below, orders(5)).unwrap();
    assert!((t - film(&empty, Complex64::ONE, 1.55)).norm() < ROUNDING);
    // A pillar of air alike.
    let mut air = hexagonal(800.0, 500.0);
    air.layers[0].inside = Complex64::ONE;
    let same = transmit(&air, 1.55, Side::Below, orders(5)).unwrap();
    assert!((t - same).norm() < ROUNDING);
}

/// Far below the wavelength a lattice of cylinders is a film of the permittivity of Lord Rayleigh; on a hexagonal one the
/// formula of Maxwell Garnett in two dimensions errs by about the sixth power of the filling only.
#[test]
fn fine_circles_are_a_film() {
    // Ends of series (0.005 at filling 0.4), the filling's sixth power (0.001), the square of pitch over wavelength (0.0004).
    const HOMOGENISED: f64 = 0.006;
    let (pitch, wavelength) = (30.0, 1.55);
    for diameter in [8.0, 14.0, 20.0] {
        let mut fine = hexagonal(pitch, diameter);
        fine.layers[0].inside = Complex64::from(2.0);
        let filling = PI * diameter * diameter / (2.0 * 3f64.sqrt() * pitch * pitch);
        let polarised = filling * (4.0 - 1.0) / (4.0 + 1.0);
        let index = Complex64::from((1.0 + polarised) / (1.0 - polarised)).sqrt();
        let t = transmit(&fine, wavelength, Side::Below, orders(17)).unwrap();
        let want = film(&fine, index, wavelength);
        assert!((t - want).norm() < HOMOGENISED, "{diameter}: {t} {want}");
        // A square lattice of as many circles is the same film only to lower powers: the test tells them apart from none.
        assert!((want - film(&fine, Complex64::ONE, wavelength)).norm() > 10.0 * HOMOGENISED);
    }
}

/// Rows half a pitch apart are a square lattice on its corner.
#[test]
fn a_square_lattice_on_its_corner_is_the_square_lattice() {
    // Either series ends elsewhere; 17 orders of the square lattice differ from 29 by as much.
    const TRUNCATED: f64 = 0.004;
    for diameter in [240.0, 360.0, 440.0] {
        let square = stack(CellLattice::Square, 600.0, Outline::circle(diameter));
        let row_nm = 600.0 * FRAC_1_SQRT_2;
        let corner = stack(
            CellLattice::Staggered { row_nm },
            600.0 * SQRT_2,
            Outline::circle(diameter),
        );
        let a = transmit(&square, 1.55, Side::Below, orders(17)).unwrap();
        let b = transmit(&corner, 1.55, Side::Below, orders(25)).unwrap();
        assert!((a - b).norm() < TRUNCATED, "{diameter}: {a} {b}");
        // So are all orders, each a turn of an eighth away.
        let incidence = Incidence::in_air(1.1, Side::Below, 0.3, 0.2);
        let aside = Incidence::in_air(1.1, Side::Below, 0.3, 0.2 + PI / 4.0);
        // Silicon nitride, where no resonance asks for more orders.
        let [square, corner] = [(square, incidence, 9), (corner, aside, 13)].map(|(mut stack, incidence, n)| {
            stack.layers[0].inside = Complex64::from(2.0);
            solve(&stack, &incidence, orders(n)).unwrap()
        });
        for order in &square.orders {
            let [m, n] = order.order;
            let same = corner.orders.iter().find(|o| o.order == [m - n, m + n]).unwrap();
            for pol in [0, 1] {
                let apart = (order.transmitted[pol] - same.transmitted[pol]).abs();
                const FEW: f64 = 0.005;
                assert!(apart < FEW, "{m} {n}: {order:?} {same:?}");
            }
        }
        assert_eq!(square.orders.len(), corner.orders.len());
    }
}

#[test]
fn both_polarisations_see_the_same() {
    for diameter in [300.0, 480.0, 600.0] {
        let cell = hexagonal(750.0, diameter);
        let t = solve(&cell, &Incidence::normal(1.55, Side::Below), orders(11)).unwrap();
        assert!((t.jones[0][0] - t.jones[1][1]).norm() < ROUNDING, "{:?}", t.jones);
        assert!(t.jones[0][1].norm() + t.jones[1][0].norm() < ROUNDING);
        let one = transmit(&cell, 1.55, Side::Below, orders(11)).unwrap();
        assert!((one - t.jones[0][0]).norm() < ROUNDING);
        // Rows a little closer tell them apart, and then the mean is given.
        let row_nm = 600.0;
        let near = stack(CellLattice::Staggered { row_nm }, 750.0, Outline::circle(diameter));
        let apart = solve(&near, &Incidence::normal(1.55, Side::Below), orders(11)).unwrap();
        let [[x, _], [_, y]] = apart.jones;
        assert!((x - y).norm() > 1e-3, "{x} {y}");
        let mean = transmit(&near, 1.55, Side::Below, orders(11)).unwrap();
        assert!((mean - 0.5 * (x + y)).norm() < ROUNDING);
    }
}

/// A sixth of a turn of the light, and a mirror, change nothing; what is used of symmetry neither.
#[test]
fn a_sixth_of_a_turn_and_mirrors_change_nothing() {
    // Off the mirrors nothing is used of symmetry; along them the bases differ.
    const OFF_NORMAL: f64 = 1e-5;
    let cell = hexagonal(800.0, 420.0);
    let at = |azimuth: f64| solve(&cell, &Incidence::in_air(1.31, Side::Below, 0.25, azimuth), orders(7)).unwrap();
    let here = at(0.2);
    for azimuth in [0.2 + PI / 3.0, 0.2 + 2.0 * PI / 3.0, -0.2, PI / 3.0 - 0.2] {
        let there = at(azimuth);
        for pol in [0, 1] {
            let apart = (here.transmission[pol][pol] - there.transmission[pol][pol]).norm();
            assert!(apart < ROUNDING, "{azimuth}: {apart}");
        }
    }
    for sines in [[0.0, 0.0], [0.3, 0.0], [0.0, -0.2]] {
        let incidence = Incidence::of_sines(1.31, Side::Below, sines);
        let [fast, slow] = [solve, solve_without_symmetry].map(|f| f(&cell, &incidence, orders(7)).unwrap());
        let pairs = fast.jones.iter().flatten().zip(slow.jones.iter().flatten());
        assert!(pairs.clone().all(|(a, b)| (a - b).norm() < OFF_NORMAL), "{sines:?}");
        for power in fast.total_power().into_iter().chain(slow.total_power()) {
            assert!((power - 1.0).abs() < ROUNDING, "{sines:?}: {power}");
        }
    }
}

/// First orders, where they propagate: six of them carry equal power of unpolarised light.
#[test]
fn power_is_kept_in_all_orders() {
    let cell = hexagonal(1400.0, 700.0);
    let answer = solve(&cell, &Incidence::normal(1.2, Side::Below), orders(11)).unwrap();
    for power in answer.total_power() {
        assert!((power - 1.0).abs() < ROUNDING, "{power}");
    }
    let first: Vec<f64> = [[1, 1], [1, -1], [-1, 1], [-1, -1], [0, 2], [0, -2]]
        .iter()
        .map(|order| answer.orders.iter().find(|o| o.order == *order).unwrap())
        .map(|o| o.transmitted[0] + o.transmitted[1])
        .collect();
    assert!(first[0] > 1e-3);
    assert!(first.iter().all(|p| (p - first[0]).abs() < ROUNDING), "{first:?}");
    // Orders whose sum is odd are none of the lattice.
    assert!(answer.orders.iter().all(|o| (o.order[0] + o.order[1]) % 2 == 0));
    // With loss, some is gone.
    let mut lossy = cell.clone();
    lossy.layers[0].inside = Complex64::new(3.48, 0.05);
    let answer = solve(&lossy, &Incidence::normal(1.2, Side::Below), orders(11)).unwrap();
    assert!(answer.total_power().iter().all(|power| *power < 0.95 && *power > 0.1));
}

#[test]
fn orders_settle() {
    // What 13 orders leave of the complex transmission, and 21: 0.012 and 0.003 at worst; of a square lattice 0.009 and 0.003.
    const FEW: f64 = 0.015;
    const MORE: f64 = 0.005;
    for diameter in [200.0, 340.0, 480.0] {
        let cell = hexagonal(750.0, diameter);
        let t = |n| transmit(&cell, 1.55, Side::Below, orders(n)).unwrap();
        let best = t(33);
        let apart = [13, 21].map(|n| (t(n) - best).norm());
        assert!(apart[0] < FEW && apart[1] < MORE, "{diameter}: {apart:?}");
    }
}

#[test]
fn what_staggered_rows_cannot_is_refused() {
    let lattice = CellLattice::hexagonal(800.0);
    let fails = |stack: LayerStack| transmit(&stack, 1.55, Side::Below, orders(5)).unwrap_err();
    assert!(matches!(
        fails(stack(lattice, 800.0, Outline::square(300.0))),
        Error::StaggeredOutline { layer: 1 }
    ));
    assert!(matches!(
        fails(stack(lattice, 800.0, Outline::rotated_rectangle(200.0, 300.0, 0.3))),
        Error::StaggeredOutline { layer: 1 }
    ));
    let row_nm = 300.0;
    // The nearest neighbour is half a pitch and a row away.
    let close = stack(CellLattice::Staggered { row_nm }, 800.0, Outline::circle(510.0));
    assert!(matches!(fails(close), Error::Width { pitch_nm: 500.0, .. }));
    for row_nm in [0.0, f64::NAN, -1.0] {
        let bad = stack(CellLattice::Staggered { row_nm }, 800.0, Outline::circle(100.0));
        assert!(matches!(fails(bad), Error::Row { .. }));
    }
    let unlike = [
        hexagonal(800.0, 300.0),
        stack(CellLattice::Square, 800.0, Outline::circle(300.0)),
    ];
    assert!(matches!(
        Supercell::of_cells(SiteLattice::row(2).unwrap(), &unlike),
        Err(Error::UnlikeCells { cell: 2 })
    ));
}
