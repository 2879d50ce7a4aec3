use std::path::PathBuf;

use super::*;
use crate::{BankRange, DeclaredTerm, perturbed};
use metalith_cell::{Analyser, Polarisation, PolarisedLight};
use metalith_core::Silent;
use metalith_pillars::{PillarShape, UprightRectangles};
use metalith_rcwa::{Material, Orders};

/// Error of cubics between the nodes of edges and height, for transmissions near one.
const BETWEEN: f64 = 5e-3;

const UM: f64 = 0.526;

const ROTATED: RotatedRectangles = RotatedRectangles {
    width_nm: 100,
    length_nm: 250,
    steps: 180,
};

const UPRIGHT: UprightRectangles = UprightRectangles {
    shortest_nm: 100,
    step_nm: 40,
    lengths: 3,
};

const HAND: FocusedLight = FocusedLight::Circular(Handedness::Left);

const ALONG_X: FocusedLight = FocusedLight::Linear(PolarisationAxis::X);

fn of_height(height_nm: f64) -> CellChange {
    CellChange {
        height_nm,
        ..CellChange::default()
    }
}

fn stack(pillars: Rectangles) -> CellStack {
    CellStack {
        film: Material::named("tio2_siefke_2016").unwrap(),
        shape: PillarShape::Rectangle(pillars),
        ..CellStack::paper(354.0, 600.0).unwrap()
    }
}

fn bank(pillars: Rectangles, numbers: &[u16]) -> Arc<CellBank> {
    let stated = stack(pillars);
    let range = BankRange {
        widths_nm: [-1.0, 2.0],
        numbers: numbers.to_vec(),
        changes: [of_height(-4.0), of_height(4.0)],
        colours: vec![(UM, BAND_ORDERS)],
    };
    let bank = CellBank::solve(&stated, range.clone(), &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cells.bank");
    bank.write(&path).unwrap();
    Arc::new(CellBank::read(&path, &stated, range).unwrap())
}

fn model() -> CalibratedModel {
    CalibratedModel::new(String::new(), String::new(), crate::Perturbation::default())
}

fn made(pillars: Rectangles, focused: FocusedLight) -> AsBuiltRectangles {
    AsBuiltRectangles::new(&stack(pillars), &model(), focused).unwrap()
}

fn class(number: u16, bias_nm: f64) -> RectangleClass {
    RectangleClass { number, bias_nm }
}

fn tables(of: &AsBuiltRectangles, classes: &[RectangleClass]) -> Result<PolarisedTables> {
    of.tables(&of_height(1.3), classes, (UM, Spectral::InBand), &Silent)
}

/// Five biases, the first of no pillar: more than are solved themselves.
const CLASSES: [(u16, f64); 6] = [(3, 0.4), (0, 0.0), (2, 1.3), (7, 0.4), (9, -0.7), (8, 1.9)];

#[test]
fn rotated_rectangles_between_the_nodes_are_those_solved_exactly_in_the_light_they_are_in() {
    let solved = made(ROTATED.into(), HAND);
    let banked = made(ROTATED.into(), HAND).of_bank(&bank(ROTATED.into(), &[]));
    let classes = CLASSES.map(|(number, bias)| class(20 * number, bias));
    let orders = Orders::new(BAND_ORDERS).unwrap();
    for chip in [&banked, &solved] {
        let PolarisedTables::Hands(found) = tables(chip, &classes).unwrap() else {
            panic!("rotated rectangles convert hands")
        };
        for (k, RectangleClass { number, bias_nm }) in classes.into_iter().enumerate().filter(|(_, c)| c.number > 0) {
            let etched = perturbed(&stack(ROTATED.into()), &of_height(1.3));
            let exact = RotationSamples::solve(&etched, [100.0, 250.0].map(|e| e + bias_nm), UM, orders).unwrap();
            let exact = exact.hands(ROTATED, &[number], Handedness::Left);
            for hand in 0..2 {
                assert!((found.converted[hand][k] - exact.converted[hand][0]).norm() < BETWEEN);
                assert!((found.unconverted[hand][k] - exact.unconverted[hand][0]).norm() < BETWEEN);
            }
        }
        // Without a pillar nothing is converted, and all that passes is in the other table; so is light that sees none.
        let found = PolarisedTables::Hands(found);
        let all = AsBuiltRectangles::solved(found.passed(PolarisedLight::default()));
        assert_eq!(all.pillars.len(), 2);
        assert_eq!([all.bare[0], all.unseen[0]], [Complex64::ZERO; 2]);
        assert_eq!([all.pillars[1][1], all.unseen[1]], [all.bare[1], Complex64::ONE]);
        assert!(all.bare[1].norm() > 1.0);
        let behind = PolarisedLight {
            arriving: Some(Polarisation::Circular(Handedness::Left)),
            analyser: Some(Analyser::Circular),
        };
        assert_eq!(
            AsBuiltRectangles::solved(found.passed(behind)).pillars,
            all.pillars[..1]
        );
    }
    assert!(tables(&banked, &[class(1, 20.0)]).is_err());
}

#[test]
fn upright_rectangles_between_the_nodes_are_those_solved_exactly_along_both_axes() {
    let solved = made(UPRIGHT.into(), ALONG_X);
    let banked = made(UPRIGHT.into(), ALONG_X).of_bank(&bank(UPRIGHT.into(), &[2, 3, 7, 8, 9]));
    let classes = CLASSES.map(|(number, bias)| class(number, bias));
    let orders = Orders::new(BAND_ORDERS).unwrap();
    let etched = perturbed(&stack(UPRIGHT.into()), &of_height(1.3));
    for chip in [&banked, &solved] {
        let PolarisedTables::Axes(found) = tables(chip, &classes).unwrap() else {
            panic!("upright rectangles keep both axes apart")
        };
        for (k, RectangleClass { number, bias_nm }) in classes.into_iter().enumerate().filter(|(_, c)| c.number > 0) {
            let edges = UPRIGHT.edges_nm(number).map(|edge| f64::from(edge) + bias_nm);
            let exact = etched.birefringent(edges, UM, orders).unwrap();
            for (along, exact) in found.along.iter().zip(exact) {
                let off = (along[k] - exact).norm();
                assert!(off < BETWEEN, "{number} {bias_nm}: {off}");
            }
        }
        // Light that sees no pillar keeps its polarisation.
        let both = PolarisedLight {
            arriving: Some(Polarisation::Unpolarised),
            analyser: None,
        };
        let all = AsBuiltRectangles::solved(PolarisedTables::Axes(found).passed(both));
        assert_eq!((all.pillars.len(), all.bare.len()), (2, 2));
        assert_eq!(all.pillars[0][1], all.bare[0]);
        assert_eq!(
            all.unseen[0].norm_sqr() + all.unseen[1].norm_sqr(),
            all.unseen[0].norm_sqr() * 2.0
        );
    }
    // A bias by itself is solved itself.
    let PolarisedTables::Axes(found) = tables(&solved, &classes[..3]).unwrap() else {
        panic!("upright rectangles keep both axes apart")
    };
    let exact = etched.birefringent([180.4, 100.4], UM, orders).unwrap();
    assert_eq!(found.along.map(|along| along[0]), exact);
    // Of a size that was not drawn when the bank was made.
    let refused = tables(&banked, &[class(1, 0.0)]).unwrap_err();
    assert_eq!(refused.id(), "study/tables-too-narrow");
    insta::assert_snapshot!(refused, @"
    the tables of cells hold no pillar of 100 x 100 nm whose edges are off by 0 nm
      help: plan the study again; shards make no tables
    ");
}

/// Cached rows are taken in place of what would be solved, to the last bit; what is damaged is made anew, and other
/// pillars, biases and stacks have their own files.
#[test]
fn rows_that_are_kept_are_those_that_were_solved() {
    let folder = tempfile::tempdir().unwrap();
    let files = || -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    };
    let mut expected = 0;
    for (pillars, light, number) in [(UPRIGHT.into(), ALONG_X, 3), (ROTATED.into(), HAND, 20)] {
        let kept = || made(pillars, light).cached_in(Some(folder.path()));
        let classes = [class(number, 0.3)];
        let first = tables(&kept(), &classes).unwrap();
        assert_eq!(first, tables(&made(pillars, light), &classes).unwrap());
        expected += 1;
        assert_eq!(files().len(), expected);
        assert_eq!(tables(&kept(), &classes).unwrap(), first);
        // The number of a rotated one is its rotation, and one solution is for all of them.
        tables(&kept(), &[class(number, 0.4)]).unwrap();
        kept()
            .tables(&of_height(1.4), &classes, (UM, Spectral::InBand), &Silent)
            .unwrap();
        expected += 2;
        assert_eq!(files().len(), expected);
        for file in files() {
            let bytes = std::fs::read(&file).unwrap();
            std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
        }
        assert_eq!(tables(&kept(), &classes).unwrap(), first);
        assert_eq!(files().len(), expected);
    }
    // A row that is there is not solved: other numbers under the same inputs are believed.
    let etched = perturbed(&stack(UPRIGHT.into()), &of_height(1.3));
    let orders = RowOrders::Given(BAND_ORDERS);
    let table = cache::table(Some(folder.path()), &etched, UPRIGHT.into(), &[2], 0.0, (UM, orders));
    let told = [Complex64::new(0.25, 0.5), Complex64::ONE];
    table.write(&metalith_cell::cache_file::bytes_of(told), &Silent);
    let chip = made(UPRIGHT.into(), ALONG_X).cached_in(Some(folder.path()));
    let PolarisedTables::Axes(found) = tables(&chip, &[class(2, 0.0)]).unwrap() else {
        panic!("upright rectangles keep both axes apart")
    };
    assert_eq!(found.along.map(|along| along[0]), told);
}

#[test]
fn what_rectangles_have_no_meaning_for_is_refused_with_a_reason() {
    let refused = |pillars: Rectangles, focused: FocusedLight, change: &dyn Fn(&mut crate::Perturbation)| {
        let mut model = model();
        change(&mut model.perturbation);
        let made = AsBuiltRectangles::new(&stack(pillars), &model, focused);
        made.err().expect("it is refused")
    };
    let by_width = |of: &mut crate::Perturbation| {
        of.declare(DeclaredTerm {
            name: "own".into(),
            quantity: DeclaredQuantity::WidthNm,
            expression: "0.01 * w".into(),
            values: std::collections::BTreeMap::new(),
        });
    };
    let nothing = |_: &mut crate::Perturbation| {};
    for (pillars, light) in [(ROTATED.into(), HAND), (UPRIGHT.into(), ALONG_X)] {
        let id = |change: &dyn Fn(&mut crate::Perturbation)| refused(pillars, light, change).id();
        assert_eq!(id(&|of| of.cell.corner_rounding_nm = 5.0), "model/rounded-rectangles");
        let transmission = id(&|of| of.geometry.transmission = vec![0.1]);
        assert_eq!(transmission, "model/transmission-with-rectangles");
        assert_eq!(id(&by_width), "model/declared-width-with-rectangles");
    }
    assert_eq!(refused(UPRIGHT.into(), HAND, &nothing).id(), "light/not-focused");
    let other = refused(ROTATED.into(), ALONG_X, &nothing);
    assert_eq!(other.id(), "light/not-focused");
    // Which light each of them focuses.
    insta::assert_snapshot!(other, @"
    the light has a polarisation that these pillars do not focus
      help: give circular polarisation for rotated rectangles, linear polarisation for upright ones, and none for other pillars
    ");
}
