//! Round pillars on a hexagonal lattice: rules find what they are for along all three directions, by the design and without it.

use std::f64::consts::PI;

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_drc::diff::{DiffPlan, diff};
use metalith_drc::{CheckInput, DrcReport};
use metalith_gds::Layout;
use metalith_layout::write_pillars;
use metalith_pillars::circle_corners;
use metalith_testing::gds::Gds;

use crate::{broken, deck_from, input, layout};

/// Pitch, distance of the rows, and the common diameter (nm).
const PITCH: i32 = 350;
const ROW: i32 = 303;
const DIAMETER: u32 = 200;
/// Rows, and pillars in each.
const SIDE: i32 = 13;

fn place(column: i32, row: i32) -> (i32, i32) {
    let middle = SIDE / 2;
    let shift = (row - middle).rem_euclid(2) * PITCH / 2;
    ((column - middle) * PITCH + shift, (row - middle) * ROW)
}

fn chip(diameter: impl Fn(i32, i32) -> u32) -> Vec<u8> {
    let mut gds = Gds::library();
    gds.cell("TOP");
    for (column, row) in (0..SIDE * SIDE).map(|k| (k % SIDE, k / SIDE)) {
        let corners = circle_corners(diameter(column, row), 0.5);
        let (x, y) = place(column, row);
        let closed = corners.iter().chain(corners.first());
        let points: Vec<(i32, i32)> = closed.map(|&(dx, dy)| (x + dx as i32, y + dy as i32)).collect();
        gds.polygon(1, &points);
    }
    gds.end_cell();
    gds.end()
}

fn judge(bytes: Vec<u8>, changes: &[(&str, &str)]) -> DrcReport {
    metalith_drc::check(
        &layout(bytes),
        &deck_from("rules/circles.toml", changes),
        &input(),
        &Silent,
    )
    .unwrap()
}

/// All pillars are found to stand on one lattice, and gaps are those to each of the six neighbours.
#[test]
fn gaps_are_found_along_three_directions() {
    let clean = judge(chip(|_, _| DIAMETER), &[]);
    assert_eq!((broken(&clean), clean.pillars_on_lattices), (vec![], 169));
    // The six neighbours of the pillar in the middle, whose row is not shifted.
    let neighbours = [(7, 6), (5, 6), (6, 7), (5, 7), (6, 5), (5, 5)];
    for neighbour in neighbours {
        let wide = |c: i32, r: i32| {
            if (c, r) == (6, 6) || (c, r) == neighbour {
                314
            } else {
                150
            }
        };
        let near = judge(chip(wide), &[]);
        assert_eq!(
            (broken(&near), near.pillars_on_lattices),
            (vec![("gap.min", 1)], 169),
            "{neighbour:?}"
        );
    }
    for farther in [(8, 6), (7, 7), (6, 8), (4, 5)] {
        let wide = |c: i32, r: i32| {
            if (c, r) == (6, 6) || (c, r) == farther {
                314
            } else {
                150
            }
        };
        assert_eq!(broken(&judge(chip(wide), &[])), vec![], "{farther:?}");
    }
    // Three gaps for each pillar, but for those at the rim.
    let all = judge(chip(|_, _| 314), &[]);
    let rows = SIDE as u64;
    let gaps = rows * (rows - 1) + (rows - 1) * (2 * rows - 1);
    assert_eq!(broken(&all), vec![("gap.min", gaps)]);
}

#[test]
fn fill_is_that_of_the_lattice() {
    // Windows are whole columns and rows of equal cells.
    const EXACT: f64 = 1e-12;
    let report = judge(chip(|_, _| DIAMETER), &[("window_um = 31", "window_um = 1.9")]);
    let fill = report.rules.iter().find(|r| r.id == "density.fill").unwrap();
    let want = PI / 4.0 * f64::from(DIAMETER * DIAMETER) / f64::from(PITCH * ROW);
    for (name, value) in &fill.facts {
        // 10 columns by 6 rows of half a pitch: 30 of 60 places are sites.
        assert!((value - want).abs() < EXACT, "{name}: {value} {want}");
    }
    assert!(!fill.facts.is_empty());
}

fn design() -> Design {
    let path = metalith_testing::design("mini_3x3");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = metalith_testing::accepting(&text)
        .replacen("[cell]\n", "[cell]\nshape = \"circle\"\nlattice = \"hexagonal\"\n", 1)
        .replacen("elements = [3, 3]", "elements = [2, 1]", 1);
    Design::parse(&path, &text).unwrap()
}

/// True of these rows: at 400, 455 and 530 nm some of the light diffracts into the glass.
const NOTE: (&str, u64) = ("design.lattice_orders", 3);

/// Every hierarchy of a design holds it, and is the same as any other; a layout with one pillar changed is neither.
#[test]
fn layouts_are_compared_with_their_design_and_with_one_another() {
    let design = design();
    let mut array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let deck = deck_from("rules/circles.toml", &[("nm = 40", "nm = 20")]);
    let mut files = Vec::new();
    let mut write = |array: &PillarArray, hierarchy| {
        let path = folder.path().join(format!("{}.gds", files.len()));
        write_pillars(&design, array, hierarchy, &path, &Silent).unwrap();
        files.push(path.clone());
        Layout::open(&path).unwrap()
    };
    let folded = write(&array, Hierarchy::Folded);
    let flat = write(&array, Hierarchy::Flat);
    let with = CheckInput {
        design: Some(&design),
        ..input()
    };
    for file in [&folded, &flat] {
        let report = metalith_drc::check(file, &deck, &with, &Silent).unwrap();
        assert_eq!((broken(&report), report.exit_code()), (vec![NOTE], 0));
        assert_eq!(report.pillars_on_lattices, array.pillars());
    }
    let same = diff(&folded, &flat, &DiffPlan::default(), &Silent).unwrap();
    assert!(same.same_geometry && !same.same_bytes);
    assert_eq!((same.changes, same.elements.len()), (0, 2));

    let map = array.classes[0].widths.map_mut();
    let middle = map.lattice.sites() / 2;
    map.number[[middle, middle]] -= 2;
    array.classes[0].group = metalith_design::array::SymmetryGroup::trivial();
    let changed = write(&array, Hierarchy::Flat);
    let copies = array.placed.iter().filter(|p| p.class == 0).count() as u64;
    let report = metalith_drc::check(&changed, &deck, &with, &Silent).unwrap();
    assert_eq!(broken(&report), vec![("design.widths", copies), NOTE]);
    let other = diff(&flat, &changed, &DiffPlan::default(), &Silent).unwrap();
    assert_eq!((other.same_geometry, other.changes), (false, copies));
    let narrowed: u64 = other.elements.iter().map(|e| e.narrowed).sum();
    assert_eq!(narrowed, copies);
}

/// Squares that are narrower than the pitch, and wider than the rows are apart.
#[test]
fn pillars_of_neighbouring_rows_share_no_area() {
    let squares = |width: i32| {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for (column, row) in (0..SIDE * SIDE).map(|k| (k % SIDE, k / SIDE)) {
            let (x, y) = place(column, row);
            // Two neighbours in the middle are wide.
            let wide = [(6, 6), (6, 7)].contains(&(column, row));
            gds.square(1, x, y, if wide { width } else { 120 });
        }
        gds.end_cell();
        let report = crate::check(gds.end(), &[]);
        let rule = report.rules.iter().find(|r| r.id == "gap.overlap").unwrap();
        rule.violations
    };
    assert_eq!([squares(300), squares(310)], [0, 1]);
}
