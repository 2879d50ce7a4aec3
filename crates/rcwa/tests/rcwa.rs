//! The solver against closed forms, reciprocity, itself without symmetry, and tabulated truth.

use metalith_rcwa::{
    CellLattice, Incidence, Layer, LayerStack, Orders, Outline, Side, converge, solve, solve_without_symmetry, transmit,
};
use num_complex::Complex64;

/// Closed forms against small dense solves in double precision.
const ROUNDING: f64 = 1e-11;
/// Rounding of the eigenvectors of a few hundred unknowns, whose condition is about 10^4.
const ENERGY: f64 = 1e-10;
/// A pillar 450 wavelengths tall turns the rounding of a propagation constant into 3000 times as much.
const TALL: f64 = 1e-8;
/// Without symmetry the normal is turned by 10^-6, which single side orders feel to first order.
const OFF_NORMAL: f64 = 1e-5;
/// The oblique truth is known well enough to judge by where its own bound is below this.
const BOUND_OF_USE: f64 = 0.005;

/// Error that the solver may add to the bound of the reference, in |t| and in rad, with so many orders, and the least
/// share of the points that must keep to it: resonances of high quality shift by more.
struct Agreement {
    orders: usize,
    amplitude: f64,
    phase_rad: f64,
    share: f64,
    /// Largest |t - truth| beyond the bound over all points, resonances included: an upper limit for the worst.
    worst: f64,
}

/// 13 orders resolve the cell to about 0.005 rad rms. The worst point is on a resonance that is narrower than the
/// shift that 13 orders leave it.
const COARSE: Agreement = Agreement {
    orders: 13,
    amplitude: 0.01,
    phase_rad: 0.015,
    share: 0.93,
    worst: 0.3,
};

/// 17 orders, two and a half times as near.
const FINE: Agreement = Agreement {
    orders: 17,
    amplitude: 0.004,
    phase_rad: 0.006,
    share: 0.90,
    worst: 0.3,
};

/// Difference between a rounded pillar and a square of its area, over what the rounding changes: to first order
/// they act alike.
const STAIRCASE: f64 = 0.35;

/// Tolerance of a convergence loop, and what its answer may differ by from one with far more orders: steps shrink
/// more slowly than by half.
const CONVERGED: f64 = 0.01;
const REMAINDER: f64 = 2.0 * CONVERGED;

/// Power that is left of light in pillars of k = 0.05, at most.
const ABSORBED: f64 = 0.95;

fn index(n: f64) -> Complex64 {
    Complex64::new(n, 0.0)
}

/// Index of silicon nitride after Luke (2015) and of fused silica after Malitson (1965), as in the truth data.
fn indices(wavelength_um: f64) -> (Complex64, Complex64) {
    let l2 = wavelength_um * wavelength_um;
    let term = |b: f64, c: f64| b * l2 / (l2 - c * c);
    let film = 1.0 + term(3.0249, 0.1353406) + term(40314.0, 1239.842);
    let silica = 1.0 + term(0.6961663, 0.0684043) + term(0.4079426, 0.1162414) + term(0.8974794, 9.896161);
    (index(film.sqrt()), index(silica.sqrt()))
}

fn pillar(width_nm: f64, wavelength_um: f64) -> LayerStack {
    let (film, silica) = indices(wavelength_um);
    LayerStack {
        pitch_nm: 350.0,
        lattice: CellLattice::Square,
        below: silica,
        layers: vec![Layer {
            height_nm: 700.0,
            outline: Outline::square(width_nm),
            inside: film,
            outside: index(1.0),
        }],
        above: index(1.0),
    }
}

fn orders(n: usize) -> Orders {
    Orders::new(n).unwrap()
}

/// Rows of numbers of a truth file.
fn truth(name: &str) -> Vec<Vec<f64>> {
    let path = metalith_testing::root().join("golden/truth").join(name);
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| line.split(',').map(|v| v.parse().unwrap()).collect())
        .collect()
}

/// Points got, wanted, and the bound of the truth.
type Points = [(Complex64, Complex64, f64)];

/// Hold points to the truth: the share of them within the tolerances, and the worst of all.
fn hold(points: &Points, to: &Agreement) {
    let good = points.iter().filter(|(got, want, bound)| {
        (got.norm() - want.norm()).abs() <= bound + to.amplitude
            && (got / want).arg().abs() <= bound / want.norm() + to.phase_rad
    });
    let share = good.count() as f64 / points.len() as f64;
    let beyond = points.iter().map(|(got, want, bound)| (got - want).norm() - bound);
    let worst = beyond.fold(f64::MIN, f64::max);
    println!(
        "{0} x {0}: {share:.3} of {1} points, worst {worst:.4}",
        to.orders,
        points.len()
    );
    assert!(share >= to.share, "{0} x {0}: {share}", to.orders);
    assert!(worst <= to.worst, "{0} x {0}: worst {worst}", to.orders);
}

fn normal_points(n: usize) -> Vec<(Complex64, Complex64, f64)> {
    let rows = truth("rcwa_normal.csv");
    assert_eq!(rows.len(), 294);
    rows.iter()
        .map(|row| {
            let wavelength_um = row[1] * 1e-3;
            let got = transmit(&pillar(row[0], wavelength_um), wavelength_um, Side::Below, orders(n)).unwrap();
            (got, Complex64::new(row[2], row[3]), row[4])
        })
        .collect()
}

#[test]
fn truth_at_normal_incidence() {
    for agreement in [COARSE, FINE] {
        hold(&normal_points(agreement.orders), &agreement);
    }
}

/// Slabs of one material in closed form: the field at the far end over the incident (Airy), s or p as
/// amplitudes along the unit vectors.
fn film(n: [Complex64; 3], depth_um: f64, sine: f64, wavelength_um: f64, p: bool) -> Complex64 {
    let cosine = n.map(|n| (1.0 - (sine / n) * (sine / n)).sqrt());
    let interface = |a: usize, b: usize| {
        let (x, y) = if p {
            (n[b] * cosine[a], n[a] * cosine[b])
        } else {
            (n[a] * cosine[a], n[b] * cosine[b])
        };
        (2.0 * n[a] * cosine[a] / (x + y), (x - y) / (x + y))
    };
    let ((t1, r1), (t2, r2)) = (interface(0, 1), interface(1, 2));
    let phase = (Complex64::I * n[1] * cosine[1] * depth_um * std::f64::consts::TAU / wavelength_um).exp();
    // With this sign of r for p, as for s, r(1, 0) = -r(0, 1).
    t1 * t2 * phase / (1.0 + r1 * r2 * phase * phase)
}

#[test]
fn truth_at_oblique_incidence() {
    let mut points = Vec::new();
    for row in truth("rcwa_oblique.csv") {
        let wavelength_um = row[2] * 1e-3;
        let incidence = Incidence::in_air(wavelength_um, Side::Below, row[0].to_radians(), 0.0);
        let response = solve(&pillar(row[1], wavelength_um), &incidence, orders(FINE.orders)).unwrap();
        for (polarisation, at) in [(0, 3), (1, 6)] {
            if row[at + 2] < BOUND_OF_USE {
                let want = Complex64::new(row[at], row[at + 1]);
                points.push((response.transmission[polarisation][polarisation], want, row[at + 2]));
            }
        }
        assert!(response.transmission[0][1].norm() < ROUNDING && response.transmission[1][0].norm() < ROUNDING);
    }
    assert!(points.len() > 50, "{} points", points.len());
    hold(&points, &FINE);
}

#[test]
fn bare_interface_is_fresnel() {
    for (side, from, to) in [(Side::Below, 1.46, 1.0), (Side::Above, 1.0, 1.46)] {
        for theta in [0.0, 0.3, 1.1] {
            let stack = LayerStack {
                pitch_nm: 350.0,
                lattice: CellLattice::Square,
                below: index(1.46),
                layers: vec![],
                above: index(1.0),
            };
            let got = solve(&stack, &Incidence::in_air(0.55, side, theta, 0.4), orders(3)).unwrap();
            let n = [index(from), index(to), index(to)];
            for (polarisation, p) in [(0, false), (1, true)] {
                let want = film(n, 0.0, theta.sin(), 0.55, p);
                assert!((got.transmission[polarisation][polarisation] - want).norm() < ROUNDING);
                assert!((got.total_power()[polarisation] - 1.0).abs() < ROUNDING);
            }
        }
    }
}

#[test]
fn uniform_films_are_airy() {
    for film_index in [index(2.05), Complex64::new(2.4, 0.3)] {
        for (outline, outside) in [(Outline::square(350.0), index(1.0)), (Outline::empty(), film_index)] {
            for theta in [0.0, 0.5] {
                let stack = LayerStack {
                    pitch_nm: 350.0,
                    lattice: CellLattice::Square,
                    below: index(1.46),
                    layers: vec![Layer {
                        height_nm: 700.0,
                        outline: outline.clone(),
                        inside: film_index,
                        outside,
                    }],
                    above: index(1.0),
                };
                let got = solve(&stack, &Incidence::in_air(0.633, Side::Below, theta, 0.0), orders(5)).unwrap();
                for (polarisation, p) in [(0, false), (1, true)] {
                    let n = [index(1.46), film_index, index(1.0)];
                    let want = film(n, 0.7, theta.sin(), 0.633, p);
                    let error = (got.transmission[polarisation][polarisation] - want).norm();
                    assert!(error < ROUNDING, "{film_index} {theta} {p}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn power_is_conserved_without_loss_and_lost_with_it() {
    for (width, wavelength, n) in [(100.0, 0.40, 13), (220.0, 0.452, 17), (300.0, 0.65, 13)] {
        let stack = pillar(width, wavelength);
        for side in [Side::Below, Side::Above] {
            let got = solve(&stack, &Incidence::normal(wavelength, side), orders(n)).unwrap();
            let error = got.total_power().map(|p| (p - 1.0).abs());
            assert!(error[0].max(error[1]) < ENERGY, "{width} {wavelength}: {error:?}");
        }
    }
    let stack = pillar(180.0, 0.5);
    let oblique = Incidence::in_air(0.5, Side::Below, 0.3, 0.35);
    let got = solve(&stack, &oblique, orders(7)).unwrap();
    assert!(got.total_power().iter().all(|p| (p - 1.0).abs() < ENERGY));

    let mut lossy = stack;
    lossy.layers[0].inside += Complex64::new(0.0, 0.05);
    let power = solve(&lossy, &oblique, orders(7)).unwrap().total_power();
    assert!(power.iter().all(|p| *p > 0.0 && *p < ABSORBED), "{power:?}");
}

#[test]
fn light_takes_the_same_way_back() {
    let stack = pillar(210.0, 0.56);
    let (theta, azimuth) = (0.35_f64, 0.5);
    let to = |side| solve(&stack, &Incidence::in_air(0.56, side, theta, azimuth), orders(7)).unwrap();
    let (up, down) = (to(Side::Below), to(Side::Above));
    let silica = stack.below.re;
    let cosines = [(1.0 - (theta.sin() / silica).powi(2)).sqrt() * silica, theta.cos()];
    // Of a cell that half a turn leaves alike: t_ab / (n cos) of the side it comes from is that of t_ba.
    for a in [0, 1] {
        for b in [0, 1] {
            let there = up.transmission[a][b] / cosines[0];
            let back = down.transmission[b][a] / cosines[1];
            let error = (there - back).norm();
            assert!(error < ENERGY, "{a}{b}: {there} {back}");
        }
    }
    let normal = |side| transmit(&stack, 0.56, side, orders(13)).unwrap();
    assert!((normal(Side::Above) - normal(Side::Below) / silica).norm() < ENERGY);
}

#[test]
fn symmetry_changes_nothing() {
    let stack = pillar(190.0, 0.48);
    let mut lossy = stack.clone();
    lossy.layers[0].inside += Complex64::new(0.0, 0.02);
    let mut oblong = stack.clone();
    oblong.layers[0].outline = Outline::rectangle(240.0, 120.0);
    let mut rounded = stack.clone();
    rounded.layers[0].outline = Outline::rounded(200.0, 40.0);
    for (name, stack) in [
        ("square", &stack),
        ("lossy", &lossy),
        ("oblong", &oblong),
        ("rounded", &rounded),
    ] {
        for (theta, azimuth) in [(0.0, 0.0), (0.0, 0.3), (0.4, 0.0), (0.4, std::f64::consts::FRAC_PI_2)] {
            let incidence = Incidence::in_air(0.48, Side::Below, theta, azimuth);
            let fast = solve(stack, &incidence, orders(7)).unwrap();
            let slow = solve_without_symmetry(stack, &incidence, orders(7)).unwrap();
            for (a, b) in fast
                .transmission
                .iter()
                .flatten()
                .zip(slow.transmission.iter().flatten())
            {
                assert!((a - b).norm() < ENERGY, "{name} {theta} {azimuth}: {a} {b}");
            }
            for (a, b) in fast.reflection.iter().flatten().zip(slow.reflection.iter().flatten()) {
                assert!((a - b).norm() < ENERGY, "{name} {theta} {azimuth}: {a} {b}");
            }
            let tolerance = if theta == 0.0 { OFF_NORMAL } else { ENERGY };
            assert_eq!(fast.orders.len(), slow.orders.len());
            for (a, b) in fast.orders.iter().zip(&slow.orders) {
                let same = |x: [f64; 2], y: [f64; 2]| (x[0] - y[0]).abs().max((x[1] - y[1]).abs()) < tolerance;
                assert!(
                    same(a.transmitted, b.transmitted) && same(a.reflected, b.reflected),
                    "{a:?} {b:?}"
                );
            }
        }
    }
}

#[test]
fn a_layer_may_be_cut_and_a_pillar_may_be_tall() {
    let whole = pillar(200.0, 0.452);
    let mut cut = whole.clone();
    let mut part = cut.layers[0].clone();
    cut.layers[0].height_nm = 450.0;
    part.height_nm = 250.0;
    cut.layers.push(part);
    let of = |stack: &LayerStack| transmit(stack, 0.452, Side::Below, orders(9)).unwrap();
    assert!((of(&whole) - of(&cut)).norm() < ENERGY);

    let mut tall = whole.clone();
    tall.layers[0].height_nm = 2.0e5;
    let got = solve(&tall, &Incidence::normal(0.452, Side::Below), orders(9)).unwrap();
    assert!((got.total_power()[0] - 1.0).abs() < TALL, "{:?}", got.total_power());
}

#[test]
fn a_staircase_of_four_steps_is_round_enough() {
    // Radius 0 to 40 nm moves |t| by up to 0.2; four steps against a rectangle of the corner's area.
    let of = |outline: Outline| {
        let mut stack = pillar(200.0, 0.53);
        stack.layers[0].outline = outline;
        transmit(&stack, 0.53, Side::Below, orders(13)).unwrap()
    };
    let (square, rounded) = (of(Outline::square(200.0)), of(Outline::rounded(200.0, 40.0)));
    // Rounding takes away area as a narrower square does, and to first order acts like it.
    let area = 200.0 * 200.0 - (4.0 - std::f64::consts::PI) * 40.0 * 40.0;
    let narrower = of(Outline::square(area.sqrt()));
    assert!(
        (rounded - narrower).norm() < STAIRCASE * (rounded - square).norm(),
        "{square} {rounded} {narrower}"
    );
    assert_eq!(of(Outline::rounded(200.0, 0.0)), square);
}

/// A change that 25 orders do not come below.
const NEVER: f64 = 1e-9;

#[test]
fn orders_double_until_the_answer_holds() {
    let incidence = Incidence::normal(0.6, Side::Below);
    let stack = pillar(150.0, 0.6);
    let found = converge(&stack, &incidence, CONVERGED, orders(49)).unwrap();
    assert!(found.converged && found.change <= CONVERGED && found.orders > orders(7));
    let truth = converge(&stack, &incidence, NEVER, orders(25)).unwrap();
    assert!(!truth.converged && truth.orders == orders(25));
    assert!((truth.response.transmission[0][0] - found.response.transmission[0][0]).norm() < REMAINDER);
}

#[test]
fn what_cannot_be_is_refused_with_its_reason() {
    let good = pillar(200.0, 0.5);
    let refused = |change: &dyn Fn(&mut LayerStack), wavelength_um: f64, id: &str| {
        let mut stack = good.clone();
        change(&mut stack);
        let error = transmit(&stack, wavelength_um, Side::Below, orders(3)).unwrap_err();
        assert_eq!(error.id(), id, "{error}");
    };
    refused(
        &|s| s.layers[0].outline = Outline::square(351.0),
        0.5,
        "rcwa/width-out-of-range",
    );
    refused(&|s| s.layers[0].height_nm = 0.0, 0.5, "rcwa/height-out-of-range");
    refused(&|s| s.layers[0].height_nm = f64::NAN, 0.5, "rcwa/height-out-of-range");
    refused(
        &|s| s.layers[0].inside = index(f64::NAN),
        0.5,
        "rcwa/index-out-of-range",
    );
    refused(
        &|s| s.layers[0].outline = Outline::square(f64::NAN),
        0.5,
        "rcwa/width-out-of-range",
    );
    refused(&|s| s.pitch_nm = 0.0, 0.5, "rcwa/pitch-out-of-range");
    refused(&|_| (), -0.5, "rcwa/wavelength-out-of-range");
    refused(&|s| s.below = Complex64::new(1.5, 0.1), 0.5, "rcwa/no-incident-wave");
    for n in [0, 4, 129] {
        assert_eq!(Orders::new(n).unwrap_err().id(), "rcwa/orders-out-of-range");
    }
}

/// Where an order of the substrate or of the ambient grazes, the answer is the limit of those beside it.
#[test]
fn a_grazing_order_gives_the_limit() {
    // The answer goes with the root of the distance, 1e-9 of the wavelength.
    const ROOT: f64 = 2e-4;
    let mut good = pillar(200.0, 0.5);
    good.below = Complex64::from(1.5);
    for grazing in [0.35 * 1.5, 0.35] {
        let t = |share: f64| transmit(&good, grazing * (1.0 + share), Side::Below, orders(5)).unwrap();
        let at = t(0.0);
        let beside = 0.5 * (t(1e-9) + t(-1e-9));
        assert!((at - beside).norm() < ROOT, "{at} {beside}");
    }
}
