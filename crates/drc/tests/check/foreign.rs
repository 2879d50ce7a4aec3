//! Layouts without a design: their pillars are recognised as simulations recognise them.

use metalith_core::{LayerNumber, Silent};
use metalith_drc::{Deck, DrcReport, Severity, check_generic};
use metalith_gds::extract::{ExtractionPlan, LeftOut, extract};
use metalith_gds::{Layout, ReadLimits};
use metalith_pillars::PillarShape;
use metalith_testing::gds::Gds;

use super::input;

/// Squares and octagons of a lens in turn, crosses in the place of the first so many.
fn lens(gds: &mut Gds, crosses: usize) -> u64 {
    let places = (-16..=16).flat_map(|j| (-16..=16).map(move |i| (400 * i, 400 * j)));
    let places = places.filter(|(x, y): &(i32, i32)| x.pow(2) + y.pow(2) <= 6_400i32.pow(2));
    let outline = |gds: &mut Gds, corners: &[(i32, i32)], (x, y)| {
        let mut points: Vec<_> = corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect();
        points.push(points[0]);
        gds.polygon(1, &points);
    };
    let octagon = [
        (80, 33),
        (33, 80),
        (-33, 80),
        (-80, 33),
        (-80, -33),
        (-33, -80),
        (33, -80),
        (80, -33),
    ];
    let arm = [(-20, -60), (20, -60), (20, -20), (60, -20), (60, 20), (20, 20)];
    let cross: Vec<_> = arm.into_iter().chain(arm.map(|(x, y)| (-x, -y))).collect();
    let mut count = 0;
    for (k, (x, y)) in places.enumerate() {
        match k {
            _ if k < crosses => outline(gds, &cross, (x, y)),
            _ if k % 2 == 0 => outline(gds, &octagon, (x, y)),
            _ => {
                gds.square(1, x, y, 140);
            }
        }
        count += 1;
    }
    count
}

fn checked(crosses: usize, degrees: f64) -> (DrcReport, u64, u64) {
    let mut gds = Gds::library();
    gds.cell("LENS");
    let count = lens(&mut gds, crosses);
    gds.end_cell();
    gds.cell("TOP")
        .placed("LENS", 30_000, 0, false, 1.0, degrees)
        .end_cell();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.gds");
    std::fs::write(&path, gds.end()).unwrap();
    let layout = Layout::open_counted(&path, ReadLimits::default(), &Silent).unwrap();
    let layer = LayerNumber::new(1, 0);
    let report = check_generic(&layout, None, &input(), &Silent).unwrap();
    let read = extract(&layout, &ExtractionPlan::discover(layer), &Silent).unwrap();
    let found = layout.inventory(&Silent).unwrap();
    let of_inventory = &found.lattices[0];
    assert_eq!(of_inventory.pillar_count, Some(read.pillars));
    assert_eq!(of_inventory.left_out, LeftOut::of(&read, layer));
    assert_eq!(
        (report.pillars_on_lattices, report.turned_deg),
        (read.pillars, read.turned_deg)
    );
    assert_eq!(
        report.not_understood,
        of_inventory.left_out.as_ref().map(|left_out| left_out.words.clone())
    );
    (report, read.pillars, count)
}

/// Squares and circles in one lens, upright and at an angle: checks, inventories and extractions have the same numbers.
#[test]
fn pillars_are_recognised_as_simulations_recognise_them() {
    for degrees in [0.0, 12.0] {
        let (report, pillars, count) = checked(0, degrees);
        assert_eq!((pillars, report.elements), (count, 1));
        assert!(report.rules.iter().all(|rule| rule.id != "element.recognised"));
        let (report, pillars, count) = checked(5, degrees);
        assert_eq!(pillars, count - 5);
        let rule = &report.rules[0];
        assert_eq!(
            (rule.id.as_str(), rule.violations, rule.severity),
            ("element.recognised", 5, Severity::Error)
        );
        let words = report.not_understood.as_ref().unwrap();
        assert!(words.contains("5 of 797 shapes"), "{words}");
        // The first is where it is drawn, whatever the angle.
        let [x, y] = [-0.0, -6_400.0];
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        let want = [30_000.0 + cos * x - sin * y, sin * x + cos * y];
        let corners = &rule.markers[0].outline_nm;
        let middle = [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / corners.len() as f64);
        assert!((0..2).all(|k| (middle[k] - want[k]).abs() < 2.0), "{middle:?} {want:?}");
        assert_ne!(report.exit_code(), 0);
    }
}

/// Squares that rounding made a step or two unequal are pillars of a lens and squares of the rule; farther off they are neither.
#[test]
fn squares_have_one_tolerance() {
    for (longer, is_square) in [(0, true), (1, true), (2, true), (3, false)] {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for (x, y) in (-8..8).flat_map(|j| (-8..8).map(move |i| (400 * i, 400 * j))) {
            let (low, high) = (longer / 2, longer - longer / 2);
            gds.rect(1, x - 106, y - 106 - low, x + 106, y + 106 + high);
        }
        gds.end_cell();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("squares.gds");
        std::fs::write(&path, gds.end()).unwrap();
        let layout = Layout::open_counted(&path, ReadLimits::default(), &Silent).unwrap();
        let plan = ExtractionPlan::discover(LayerNumber::new(1, 0)).of_shape(PillarShape::Square);
        let read = extract(&layout, &plan, &Silent);
        let deck = Deck::read(&metalith_testing::root().join("rules/squares.toml")).unwrap();
        let report = metalith_drc::check(&layout, &deck, &input(), &Silent).unwrap();
        let rule = report.rules.iter().find(|rule| rule.id == "pillar.square").unwrap();
        assert_eq!(rule.violations == 0, is_square, "{longer}");
        assert_eq!(read.is_ok_and(|read| read.pillars == 256), is_square, "{longer}");
    }
}
