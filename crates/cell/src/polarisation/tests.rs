//! Light of any polarisation against its Jones vectors.

use std::f64::consts::TAU;

use super::*;
use metalith_rcwa::circular;

/// A few products of numbers of size one.
const ROUNDING: f64 = 1e-14;

/// Jones matrices along x and y of four pillars that have no symmetry.
fn pillars() -> Vec<[[Complex64; 2]; 2]> {
    let entry = |k: usize, j: usize| Complex64::new((1.3 * (4 * k + j) as f64).sin(), (0.7 * (4 * k + j) as f64).cos());
    (0..4)
        .map(|k| [[entry(k, 0), entry(k, 1)], [entry(k, 2), entry(k, 3)]])
        .collect()
}

fn hands(focused: Handedness) -> CircularTables {
    let of = |out: usize, input: usize| pillars().iter().map(|j| circular(*j)[out][input]).collect::<Vec<_>>();
    let [own, other] = match focused {
        Handedness::Left => [0, 1],
        Handedness::Right => [1, 0],
    };
    CircularTables {
        focused,
        converted: [of(other, own), of(own, other)],
        unconverted: [of(own, own), of(other, other)],
        rotation: None,
    }
}

fn tables(focused: Handedness) -> PolarisedTables {
    PolarisedTables::Hands(hands(focused))
}

/// Tables of the same pillars as if they turned no polarisation.
fn axes(focused: PolarisationAxis) -> PolarisedTables {
    let along = [0, 1].map(|axis| pillars().iter().map(|j| j[axis][axis]).collect::<Vec<_>>());
    PolarisedTables::Axes(LinearTables { focused, along })
}

/// Energy of the sum over all pillars with these weights, as at a place of the sensor.
fn energy(passed: &[PassedTable], weights: [Complex64; 4]) -> f64 {
    let field = |p: &PassedTable| p.table.iter().zip(weights).map(|(t, w)| t * w).sum::<Complex64>();
    passed.iter().map(|p| field(p).norm_sqr()).sum()
}

const WEIGHTS: [Complex64; 4] = [
    Complex64::new(0.3, 0.1),
    Complex64::new(-0.7, 0.4),
    Complex64::new(0.2, -0.9),
    Complex64::new(0.5, 0.5),
];

fn of(arriving: Polarisation, analyser: Option<Analyser>, focused: Handedness) -> f64 {
    let light = PolarisedLight {
        arriving: Some(arriving),
        analyser,
    };
    energy(&tables(focused).passed(light), WEIGHTS)
}

fn jones_vector(arriving: Polarisation) -> [Complex64; 2] {
    match arriving {
        Polarisation::Circular(Handedness::Left) => [Complex64::ONE, Complex64::I].map(|c| c * FRAC_1_SQRT_2),
        Polarisation::Circular(Handedness::Right) => [Complex64::ONE, -Complex64::I].map(|c| c * FRAC_1_SQRT_2),
        Polarisation::Linear(deg) => [deg.to_radians().cos(), deg.to_radians().sin()].map(Complex64::from),
        Polarisation::Unpolarised => unreachable!("it has none"),
    }
}

/// Against the Jones matrices along x and y themselves, analysers as projections on a circular and on linear polarisations.
#[test]
fn light_of_any_polarisation_is_that_of_its_jones_vector() {
    let right = jones_vector(Polarisation::Circular(Handedness::Right));
    let angles = [30.0, -75.0, 180.0].map(Polarisation::Linear);
    let named = Polarisation::CHOICES.map(|(_, one)| one);
    for arriving in named.into_iter().take(4).chain(angles) {
        let e = jones_vector(arriving);
        let field = [0, 1].map(|out| {
            let one = |(j, w): (&[[Complex64; 2]; 2], Complex64)| w * (j[out][0] * e[0] + j[out][1] * e[1]);
            pillars().iter().zip(WEIGHTS).map(one).sum::<Complex64>()
        });
        let all = field[0].norm_sqr() + field[1].norm_sqr();
        // Of light that is left and focused, what leaves as right.
        let seen = (right[0].conj() * field[0] + right[1].conj() * field[1]).norm_sqr();
        for focused in [Handedness::Left, Handedness::Right] {
            assert!((of(arriving, None, focused) - all).abs() < ROUNDING * all, "{arriving}");
            for deg in [0.0, 90.0, 37.0, -110.0_f64] {
                let (sin, cos) = deg.to_radians().sin_cos();
                let wanted = (field[0] * cos + field[1] * sin).norm_sqr();
                let found = of(arriving, Some(Analyser::Linear(deg)), focused);
                assert!(
                    (found - wanted).abs() < ROUNDING * all,
                    "{arriving} {deg}: {found} {wanted}"
                );
            }
        }
        let circular = Some(Analyser::Circular);
        let found = [Handedness::Left, Handedness::Right].map(|focused| of(arriving, circular, focused));
        assert!((found[0] - seen).abs() < ROUNDING * all, "{arriving}: {found:?} {seen}");
        assert!(
            (found[1] - (all - seen)).abs() < ROUNDING * all,
            "{arriving}: {found:?} {seen}"
        );
    }
}

#[test]
fn unpolarised_light_is_the_mean_of_any_two_that_are_orthogonal() {
    let pairs = [
        Polarisation::CHOICES.map(|(_, one)| one)[0..2].to_vec(),
        Polarisation::CHOICES.map(|(_, one)| one)[2..4].to_vec(),
        [25.0, -65.0].map(Polarisation::Linear).to_vec(),
    ];
    // Some light is far from the mean, or nothing would be shown.
    let mut apart: f64 = 0.0;
    for analyser in [None, Some(Analyser::Circular), Some(Analyser::Linear(20.0))] {
        let wanted = of(Polarisation::Unpolarised, analyser, Handedness::Left);
        for pair in &pairs {
            let each: Vec<f64> = pair.iter().map(|one| of(*one, analyser, Handedness::Left)).collect();
            let mean = (each[0] + each[1]) / 2.0;
            assert!((mean - wanted).abs() < ROUNDING * wanted, "{pair:?}: {mean} {wanted}");
            apart = apart.max((each[0] - each[1]).abs() / wanted);
        }
    }
    assert!(apart > 0.1, "{apart}");
}

/// Where nothing is said it is the light that is focused, bit by bit.
#[test]
fn the_light_that_is_focused_arrives_if_no_other_is_named() {
    let plain = hands(Handedness::Right);
    let passed = tables(Handedness::Right).passed(PolarisedLight::default());
    let found: Vec<_> = passed.iter().map(|p| (&p.table, p.order)).collect();
    assert_eq!(found, [(&plain.converted[0], 1), (&plain.unconverted[0], 0)]);
}

/// Over whole turns of the phase of an element, the energies of focused, unconverted and diverging light are all of it.
#[test]
fn what_has_unlike_phases_adds_up_over_whole_turns() {
    const TURNS: usize = 12;
    for focused in [Handedness::Left, Handedness::Right] {
        let plain = hands(focused);
        let pillar = |of: &[Vec<Complex64>; 2], orders: [f64; 2]| {
            let turned = |k: usize| {
                let each = (0..TURNS).map(|n| of[k][1] * Complex64::cis(TAU * orders[k] * n as f64 / TURNS as f64));
                each.collect::<Vec<_>>()
            };
            [turned(0), turned(1)]
        };
        let hands = PolarisedTables::Hands(CircularTables {
            focused,
            converted: pillar(&plain.converted, [1.0, -1.0]),
            unconverted: pillar(&plain.unconverted, [0.0, 0.0]),
            rotation: None,
        });
        let power = |tables: &[Vec<Complex64>]| tables.iter().flatten().map(Complex64::norm_sqr).sum::<f64>();
        for (_, arriving) in Polarisation::CHOICES {
            for analyser in [None, Some(Analyser::Circular), Some(Analyser::Linear(33.0))] {
                let light = PolarisedLight {
                    arriving: Some(arriving),
                    analyser,
                };
                let all: Vec<_> = hands.passed(light).into_iter().map(|p| p.table).collect();
                let parts: f64 = [1, 0, -1]
                    .map(|order| power(&hands.passed_in(order, light)))
                    .iter()
                    .sum();
                let wanted = power(&all);
                assert!(
                    (parts - wanted).abs() < ROUNDING * TURNS as f64 * (1.0 + wanted),
                    "{arriving} {analyser:?}"
                );
            }
        }
    }
}

#[test]
fn names_and_angles_are_read() {
    for (name, wanted) in Polarisation::CHOICES {
        assert_eq!(name.parse::<Polarisation>().unwrap(), wanted);
    }
    assert_eq!("-30.5".parse::<Polarisation>().unwrap(), Polarisation::Linear(-30.5));
    for wrong in ["z", "", "NaN", "inf", "181"] {
        let errors = [
            wrong.parse::<Polarisation>().unwrap_err(),
            wrong.parse::<Analyser>().unwrap_err(),
        ];
        assert_eq!(
            errors.map(|error| error.id()),
            ["light/unknown-polarisation", "light/unknown-analyser"]
        );
    }
    insta::assert_snapshot!("z".parse::<Polarisation>().unwrap_err(), @"
        there is no light of polarisation `z`
          help: use left, right, x, y, unpolarised, or the angle of linear polarisation from x towards y, from -180 to 180 degrees
        ");
    insta::assert_snapshot!("z".parse::<Analyser>().unwrap_err(), @"
        there is no analyser `z`
          help: use circular, x, y, or the angle of linear polarisation from x towards y, from -180 to 180 degrees
        ");
    for (name, wanted) in Analyser::CHOICES {
        assert_eq!(name.parse::<Analyser>().unwrap(), wanted);
    }
    assert_eq!("15".parse::<Analyser>().unwrap(), Analyser::Linear(15.0));
}

/// Upright pillars against their Jones matrices: without an analyser all energy, behind one its projection, whichever axis has the
/// phase of the design.
#[test]
fn light_through_upright_pillars_is_that_of_its_jones_vector() {
    let field_of = |arriving: Polarisation| {
        let e = jones_vector(arriving);
        [0, 1].map(|axis| {
            let one = |(j, w): (&[[Complex64; 2]; 2], Complex64)| w * j[axis][axis] * e[axis];
            pillars().iter().zip(WEIGHTS).map(one).sum::<Complex64>()
        })
    };
    let angles = [30.0, -75.0, 180.0].map(Polarisation::Linear);
    let named = Polarisation::CHOICES.map(|(_, one)| one);
    for arriving in named.into_iter().take(4).chain(angles) {
        let field = field_of(arriving);
        let all = field[0].norm_sqr() + field[1].norm_sqr();
        for focused in PolarisationAxis::ALL {
            let found = |analyser| {
                let light = PolarisedLight {
                    arriving: Some(arriving),
                    analyser,
                };
                energy(&axes(focused).passed(light), WEIGHTS)
            };
            assert!((found(None) - all).abs() < ROUNDING * all, "{arriving}");
            for deg in [0.0, 90.0, 37.0, -110.0_f64] {
                let (sin, cos) = deg.to_radians().sin_cos();
                let wanted = (field[0] * cos + field[1] * sin).norm_sqr();
                let found = found(Some(Analyser::Linear(deg)));
                // What a sine of half a turn is off by.
                assert!((found - wanted).abs() < ROUNDING, "{arriving} {deg}: {found} {wanted}");
            }
        }
    }
    for focused in PolarisationAxis::ALL {
        let passed = axes(focused).passed(PolarisedLight::default());
        let PolarisedTables::Axes(tables) = axes(focused) else {
            unreachable!("they are upright")
        };
        assert_eq!(passed.len(), 1);
        assert_eq!((&passed[0].table, passed[0].order), (&tables.along[focused.index()], 1));
        let unpolarised = PolarisedLight {
            arriving: Some(Polarisation::Unpolarised),
            analyser: None,
        };
        assert_eq!(axes(focused).passed(unpolarised).len(), 2);
        assert_eq!(unpolarised.focused_share(FocusedLight::Linear(focused)), 0.5);
    }
}

#[test]
fn light_is_nearest_to_the_axis_that_it_has_most_of() {
    use PolarisationAxis::{X, Y};
    for (deg, wanted) in [
        (0.0, X),
        (44.0, X),
        (45.0, X),
        (46.0, Y),
        (90.0, Y),
        (-90.0, Y),
        (135.0, X),
        (180.0, X),
    ] {
        assert_eq!(PolarisationAxis::nearest(Polarisation::Linear(deg)), wanted, "{deg}");
    }
    assert_eq!(PolarisationAxis::nearest(Polarisation::Unpolarised), X);
    assert_eq!(PolarisationAxis::nearest(Polarisation::Circular(Handedness::Left)), X);
}
