//! Circles and rotated rectangles: symmetry, power, convergence, and what an independent code says.

use metalith_rcwa::{
    CellLattice, Error, Incidence, Layer, LayerStack, Orders, Outline, Response, Side, SiteLattice, Supercell,
    circular, solve, solve_each, solve_without_symmetry, transmit,
};
use num_complex::Complex64;

/// Rounding of the eigenvectors of a few hundred unknowns, whose condition is about 10^4.
const ROUNDING: f64 = 1e-9;
/// Tolerance where x and y are distinguished by 1e-9, so that modes do not come in pairs; a resonance feels that more.
const TOLD_APART: f64 = 1e-7;

/// A pillar of titanium dioxide, or what is near it.
fn stack(outline: Outline) -> LayerStack {
    LayerStack {
        pitch_nm: 330.0,
        lattice: CellLattice::Square,
        below: Complex64::from(1.46),
        layers: vec![Layer {
            height_nm: 600.0,
            outline,
            inside: Complex64::from(2.45),
            outside: Complex64::from(1.0),
        }],
        above: Complex64::from(1.0),
    }
}

fn orders(n: usize) -> Orders {
    Orders::new(n).unwrap()
}

fn along_normal(outline: Outline, n: usize) -> Response {
    solve(&stack(outline), &Incidence::normal(0.532, Side::Below), orders(n)).unwrap()
}

fn largest(a: &[[Complex64; 2]; 2], b: &[[Complex64; 2]; 2]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn symmetry_changes_nothing_and_power_is_kept() {
    for (name, outline) in [
        ("circle", Outline::circle(210.0)),
        ("rectangle", Outline::rotated_rectangle(100.0, 240.0, 0.4)),
    ] {
        for sines in [[0.0, 0.0], [0.3, 0.0], [0.0, -0.2], [0.2, 0.1]] {
            let incidence = Incidence::of_sines(0.532, Side::Below, sines);
            let fast = solve(&stack(outline.clone()), &incidence, orders(7)).unwrap();
            let slow = solve_without_symmetry(&stack(outline.clone()), &incidence, orders(7)).unwrap();
            // The slow one is a millionth off the normal.
            const OFF_NORMAL: f64 = 1e-5;
            assert!(largest(&fast.jones, &slow.jones) < OFF_NORMAL, "{name} {sines:?}");
            for power in fast.total_power().into_iter().chain(slow.total_power()) {
                assert!((power - 1.0).abs() < ROUNDING, "{name} {sines:?}: {power}");
            }
        }
    }
}

/// Rotated together, lattice and light and pillar look the same: by a quarter of a turn the lattice is.
#[test]
fn a_quarter_of_a_turn_exchanges_the_axes() {
    let at = |rotation: f64| along_normal(Outline::rotated_rectangle(90.0, 220.0, rotation), 9).jones;
    let (here, there) = (at(0.3), at(0.3 + std::f64::consts::FRAC_PI_2));
    // x of the second is y of the first, y of the second -x.
    let turned = [[here[1][1], -here[1][0]], [-here[0][1], here[0][0]]];
    assert!(largest(&there, &turned) < TOLD_APART, "{there:?} {turned:?}");
    // A mirror in the x axis turns the other way.
    let mirrored = at(-0.3);
    let expected = [[here[0][0], -here[0][1]], [-here[1][0], here[1][1]]];
    assert!(largest(&mirrored, &expected) < TOLD_APART, "{mirrored:?} {expected:?}");
}

/// Rectangle with upright sides: at its corners the normal jumps, and neither rule is better: both come to one answer,
/// slowly.
#[test]
fn an_upright_rectangle_by_either_rule() {
    // 0.0144 with 25 orders each, in a square and in a circle: the pillar is at a resonance.
    const APART: f64 = 0.016;
    let upright = along_normal(Outline::rectangle(120.0, 230.0), 25).jones;
    let turned = along_normal(Outline::rotated_rectangle(120.0, 230.0, 0.0), 25).jones;
    assert!(largest(&upright, &turned) < APART, "{upright:?} {turned:?}");
    assert!(turned[0][1].norm() < ROUNDING && turned[1][0].norm() < ROUNDING);
}

/// Stacks that are solved together, of which some differ in heights alone, have the answers that each has individually,
/// bit by bit.
#[test]
fn stacks_that_are_solved_together_are_those_solved_one_by_one() {
    let of = |width_nm: f64, height_nm: f64, mask_nm: f64| {
        let mut stack = stack(Outline::rectangle(width_nm, 230.0));
        stack.layers[0].height_nm = height_nm;
        let mask = Layer {
            height_nm: mask_nm,
            inside: Complex64::new(1.8, 0.01),
            ..stack.layers[0].clone()
        };
        stack.layers.extend((mask_nm > 0.0).then_some(mask));
        stack
    };
    let stacks = [
        of(120.0, 600.0, 0.0),
        of(120.0, 610.0, 0.0),
        of(120.0, 610.0, 20.0),
        of(120.0, 590.0, 30.0),
        of(121.0, 590.0, 30.0),
    ];
    for sines in [[0.0, 0.0], [0.2, 0.1]] {
        let incidence = Incidence::of_sines(0.532, Side::Below, sines);
        let together = solve_each(&stacks, &incidence, orders(7)).unwrap();
        assert_eq!(together.len(), stacks.len());
        for (found, stack) in together.iter().zip(&stacks) {
            assert_eq!(found.jones, solve(stack, &incidence, orders(7)).unwrap().jones);
        }
    }
}

#[test]
fn a_rotated_square_and_a_circle_tell_no_polarisation() {
    for outline in [Outline::circle(200.0), Outline::rotated_rectangle(180.0, 180.0, 0.35)] {
        let t = along_normal(outline, 9).jones;
        assert!((t[0][0] - t[1][1]).norm() < TOLD_APART, "{t:?}");
        // A square turned on its lattice has no mirror: it may turn the polarisation of all light alike.
        assert!((t[0][1] + t[1][0]).norm() < TOLD_APART, "{t:?}");
    }
    let t = circular(along_normal(Outline::circle(200.0), 9).jones);
    assert!(t[1][0].norm() < ROUNDING && t[0][1].norm() < ROUNDING);
    let one = transmit(&stack(Outline::circle(200.0)), 0.532, Side::Below, orders(9)).unwrap();
    assert!((one - t[0][0]).norm() < ROUNDING);
}

/// Light that comes back the same way: reciprocity between both sides, for any direction, of a cell that half a turn leaves
/// alike.
#[test]
fn light_takes_the_same_way_back() {
    for outline in [Outline::circle(210.0), Outline::rotated_rectangle(100.0, 240.0, 0.4)] {
        let to = |side| {
            solve(
                &stack(outline.clone()),
                &Incidence::of_sines(0.532, side, [0.2, 0.1]),
                orders(7),
            )
            .unwrap()
        };
        let (up, down) = (to(Side::Below), to(Side::Above));
        let square = 0.2_f64.powi(2) + 0.1_f64.powi(2);
        let cosines = [(1.46_f64.powi(2) - square).sqrt(), (1.0 - square).sqrt()];
        for a in [0, 1] {
            for b in [0, 1] {
                let (there, back) = (up.transmission[a][b] / cosines[0], down.transmission[b][a] / cosines[1]);
                assert!((there - back).norm() < ROUNDING, "{there} {back}");
            }
        }
    }
}

#[test]
fn a_supercell_refuses_rotated_rectangles() {
    let cell = stack(Outline::rotated_rectangle(100.0, 200.0, 0.2));
    let lattice = SiteLattice::row(1).unwrap();
    assert!(matches!(
        Supercell::of_cells(lattice, &[cell]),
        Err(Error::RotatedSite { site: 1 })
    ));
}
