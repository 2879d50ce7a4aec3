use std::sync::atomic::{AtomicUsize, Ordering};

use super::grid::change_of;
use super::*;
use crate::RealisedCells;
use metalith_cell::{BAND_ORDERS, Illumination};
use metalith_core::Silent;
use metalith_pillars::{PillarShape, UprightRectangles};
use metalith_rcwa::Material;

/// Rms error over widths and pillars: what cubics leave of the resonances, of transmissions of modulus one.
const RMS: f64 = 0.01;

fn bank() -> CellBank {
    let stated = CellStack::paper(350.0, 700.0).unwrap();
    let least = change_of([-6.0, 0.0, 0.0, 0.0, 0.0]);
    let most = change_of([6.0, 0.0, 0.0, 0.0, 0.0]);
    let range = BankRange {
        widths_nm: [150.0, 200.0],
        numbers: Vec::new(),
        changes: [least, most],
        colours: vec![(0.53, BAND_ORDERS)],
    };
    CellBank::solve(&stated, range, &Silent).unwrap()
}

#[test]
fn pillars_between_the_nodes_are_those_solved_exactly_and_none_beyond_them_is_there() {
    let bank = bank();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cells.bank");
    bank.write(&path).unwrap();
    let back = CellBank::read(&path, bank.stated(), bank.range.clone()).unwrap();
    let tables = |bank: &CellBank| match &bank.tables {
        Tables::Widths(colours) => colours.iter().flat_map(Colour::numbers).collect::<Vec<_>>(),
        Tables::Sizes(..) => panic!("squares are told by one width"),
    };
    assert_eq!(tables(&back), tables(&bank));
    let change = change_of([1.3, 0.0, 0.0, 0.0, 0.0]);
    let widths: Vec<f64> = (0..24).map(|k| 150.4 + 2.0 * f64::from(k)).collect();
    let table = bank.transmissions(&change, BAND_ORDERS, &widths, 0.53).unwrap();
    let exact = RealisedCells::new(perturbed(bank.stated(), &change), 0.4);
    let exact = exact
        .solve(&widths, &Illumination::normal(0.53).in_band(), &Silent)
        .unwrap();
    let pairs = table.pillars[0].iter().zip(&exact.pillars[0]);
    let rms = (pairs.map(|(a, b)| (a - b).norm_sqr()).sum::<f64>() / widths.len() as f64).sqrt();
    assert!(rms < RMS, "rms {rms}");
    let higher = change_of([7.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(bank.transmissions(&higher, BAND_ORDERS, &widths, 0.53).is_err());
    assert!(bank.transmissions(&change, BAND_ORDERS, &[260.0], 0.53).is_err());
    assert!(bank.transmissions(&change, BAND_ORDERS, &widths, 0.6).is_err());
}

const UPRIGHT: UprightRectangles = UprightRectangles {
    shortest_nm: 90,
    step_nm: 10,
    lengths: 8,
};

/// Transmission of a made-up pillar along x and along y: for each axis a phase that grows with its edge, and a
/// resonance 1.5 nm wide (FWHM).
fn made_up([x, y]: [f64; 2], stack: usize) -> [Complex64; 2] {
    [(x, y), (y, x)].map(|(along, across)| {
        let resonance = Complex64::new(0.0, 0.75) / Complex64::new(along + 0.5 * across - 190.0 - stack as f64, 0.75);
        Complex64::cis(0.03 * along + 0.01 * across) * (Complex64::ONE - 0.9 * resonance)
    })
}

/// Tables of sizes, and how many pillars were solved for them.
fn tables_of(sizes: &Sizes) -> (SizeTables, usize) {
    let solved = AtomicUsize::new(0);
    let solve = |edges: [f64; 2]| {
        assert!(edges[0] >= edges[1], "one of a pillar and its mirror image is solved");
        solved.fetch_add(1, Ordering::Relaxed);
        Ok((0..2).map(|stack| made_up(edges, stack)).collect())
    };
    let tables = sizes.solve(&solve, &Silent).unwrap();
    (tables, solved.into_inner())
}

/// Sizes that a bias turns into one another are solved once, and resonances are met between the nodes in all stacks.
#[test]
fn sizes_between_the_nodes_are_those_solved_and_few_are_solved() {
    /// Tolerance of transmissions of modulus one, beside a resonance.
    const WORST: f64 = 0.01;
    let numbers: Vec<u16> = (1..=UPRIGHT.count()).collect();
    let sizes = Sizes::new(UPRIGHT, &numbers, [-3.0, 4.0]);
    let (tables, solved) = tables_of(&sizes);
    // 36 of 64 sizes differ by more than a mirror: three nodes for each, where a table over the bias of each takes eight or more.
    assert!(sizes.first() <= solved && solved < 3 * 36, "{} {solved}", sizes.first());
    let numbers_kept: Vec<f64> = tables.numbers().collect();
    let mut rest = numbers_kept.as_slice();
    assert_eq!(SizeTables::take(&mut rest, &sizes, 2).as_ref(), Some(&tables));
    assert!(rest.is_empty());
    let cut_short = &numbers_kept[..numbers_kept.len() - 1];
    assert_eq!(SizeTables::take(&mut &cut_short[..], &sizes, 2), None);
    for number in numbers {
        for bias in [-3.0, -1.7, 0.0, 0.6, 4.0] {
            let edges = UPRIGHT.edges_nm(number).map(|edge| f64::from(edge) + bias);
            let found = sizes.of_stacks(&tables, number, bias).unwrap();
            for (axis, of_stacks) in found.into_iter().enumerate() {
                for (stack, t) in of_stacks.enumerate() {
                    let exact = made_up(edges, stack)[axis];
                    assert!((t - exact).norm() < WORST, "{edges:?} {axis} {stack}: {t} {exact}");
                    // Pillars as drawn are nodes.
                    assert!(bias != 0.0 || t == exact, "{edges:?} {axis} {stack}");
                }
            }
        }
        assert!(sizes.of_stacks(&tables, number, 4.1).is_none() || number != UPRIGHT.count());
    }
}

/// Sizes are each solved once where no bias varies, and where little does, sizes far apart have their own nodes.
#[test]
fn sizes_that_no_bias_joins_are_solved_by_themselves() {
    let numbers: Vec<u16> = (1..=UPRIGHT.count()).collect();
    let sizes = Sizes::new(UPRIGHT, &numbers, [1.5, 1.5]);
    let (tables, solved) = tables_of(&sizes);
    assert_eq!((sizes.first(), solved), (36, 36));
    let [x, y] = UPRIGHT.edges_nm(3).map(|edge| f64::from(edge) + 1.5);
    let [mut along_x, _] = sizes.of_stacks(&tables, 3, 1.5).unwrap();
    assert_eq!(along_x.next(), Some(made_up([x, y], 0)[0]));
    let apart = UprightRectangles { step_nm: 40, ..UPRIGHT };
    // From 90 to 91 nm and from 130 to 131 nm, nothing between.
    assert_eq!(Sizes::new(apart, &[1, 10], [0.0, 1.0]).first(), 4);
}

/// Pillars of titanium dioxide beside their resonances, on one line of sizes: 90 x 110 nm to 260 x 280 nm.
#[test]
#[ignore = "second tier: ten seconds of CPU time, in scripts/slow_tests.sh"]
fn real_pillars_between_the_nodes_are_those_solved_exactly() {
    /// Over all pillars, of transmissions of modulus one: 4e-4. Cubics through nodes a nanometre apart leave 0.05.
    const RMS_OF_SIZES: f64 = 2e-3;
    /// Tolerance of one of them, beside a resonance: 0.003.
    const WORST: f64 = 0.015;
    let pillars = UprightRectangles { lengths: 20, ..UPRIGHT };
    let numbers: Vec<u16> = (0..18)
        .map(|k| pillars.number([90 + 10 * k, 110 + 10 * k]).unwrap())
        .collect();
    let stack = CellStack {
        film: Material::named("tio2_siefke_2016").unwrap(),
        shape: PillarShape::Rectangle(pillars.into()),
        ..CellStack::paper(350.0, 600.0).unwrap()
    };
    let range = BankRange {
        widths_nm: [-4.0, 4.0],
        numbers: numbers.clone(),
        changes: [CellChange::default(); 2],
        colours: vec![(0.532, UPRIGHT_ORDERS)],
    };
    let bank = CellBank::solve(&stack, range, &Silent).unwrap();
    let (mut sum, mut worst, mut count) = (0.0, 0.0_f64, 0);
    for bias in [-2.3, 1.4, 3.1] {
        let (rows, _) = bank
            .rectangles(&CellChange::default(), (0.532, UPRIGHT_ORDERS), &[bias], &numbers)
            .unwrap();
        let exact: Vec<[Complex64; 2]> = numbers
            .par_iter()
            .map(|number| {
                let edges = pillars.edges_nm(*number).map(|edge| f64::from(edge) + bias);
                stack
                    .birefringent(edges, 0.532, Orders::new(UPRIGHT_ORDERS).unwrap())
                    .unwrap()
            })
            .collect();
        for (t, exact) in rows[0].iter().zip(exact.iter().flatten()) {
            let off = (t - exact).norm();
            (sum, worst, count) = (sum + off * off, worst.max(off), count + 1);
        }
    }
    let rms = (sum / f64::from(count)).sqrt();
    println!("{rms} rms, {worst} at most");
    assert!(rms < RMS_OF_SIZES && worst < WORST, "{rms} {worst}");
}

/// Tables that would take hours are refused before anything is solved, with the hours.
#[test]
fn tables_that_take_too_long_are_refused() {
    let stack = CellStack {
        shape: PillarShape::Rectangle(UPRIGHT.into()),
        ..CellStack::paper(350.0, 600.0).unwrap()
    };
    let range = |taper_deg: f64| BankRange {
        widths_nm: [-4.0, 4.0],
        numbers: (1..=UPRIGHT.count()).collect(),
        changes: [[-10.0, 0.0, 0.0], [10.0, 0.04, taper_deg]]
            .map(|[height, index, taper]| change_of([height, index, taper, 0.0, 0.0])),
        colours: vec![(0.532, UPRIGHT_ORDERS)],
    };
    assert!(CellBank::empty(&stack, range(0.0)).is_ok());
    let refused = CellBank::empty(&stack, range(5.0)).err().unwrap();
    assert_eq!(refused.id(), "study/tables-too-slow");
}

/// Index, taper and mask of upright rectangles count as their height does.
#[test]
fn what_varies_of_a_pillar_beside_its_edges_is_met_between_the_nodes() {
    const BETWEEN: f64 = 5e-3;
    let stack = CellStack {
        film: Material::named("tio2_siefke_2016").unwrap(),
        shape: PillarShape::Rectangle(UPRIGHT.into()),
        ..CellStack::paper(354.0, 600.0).unwrap()
    };
    let number = UPRIGHT.number([100, 130]).unwrap();
    let colour = (0.526, BAND_ORDERS);
    for most in [
        [0.0, 0.02, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0],
        [6.0, 0.0, 0.0, 0.0, 8.0],
    ] {
        let range = BankRange {
            widths_nm: [-1.0, 1.0],
            numbers: vec![number],
            changes: [CellChange::default(), change_of(most)],
            colours: vec![colour],
        };
        let bank = CellBank::solve(&stack, range, &Silent).unwrap();
        let change = change_of(most.map(|most| 0.4 * most));
        let (rows, bare) = bank.rectangles(&change, colour, &[0.6], &[number]).unwrap();
        let etched = perturbed(&stack, &change);
        let orders = Orders::new(BAND_ORDERS).unwrap();
        let exact = etched.birefringent([100.6, 130.6], colour.0, orders).unwrap();
        for (t, exact) in rows[0].iter().zip(exact) {
            assert!((t - exact).norm() < BETWEEN, "{most:?}: {t} {exact}");
        }
        assert_eq!(bare.len(), 2);
    }
}
