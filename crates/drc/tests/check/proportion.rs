//! Work in proportion to the file: a few bytes that describe much, and outlines on which comparing all with all
//! would take minutes. What is not carried out is not clean.

use metalith_core::Silent;
use metalith_drc::diff::{DiffPlan, diff};
use metalith_drc::{DrcReport, Status};
use metalith_gds::{Layout, ReadLimits};
use metalith_testing::gds::Gds;

use crate::check;

/// CPU time that any file may take, and each megabyte of it (s); builds that are not optimised are 30 times slower.
const ANY_FILE_S: f64 = 5.0;
const A_MEGABYTE_S: f64 = 5.0;
const NOT_OPTIMISED: f64 = 30.0;

/// CPU seconds beside other tests, in a slow hour, over those alone in a fast one: both cores share one memory, and machines differ
/// by a third from hour to hour.
const BESIDE_OTHERS: f64 = 3.0;

/// Do something with a file of so many bytes, in the time that it may take.
fn in_time<T>(what: &str, bytes: usize, work: impl FnOnce() -> T) -> T {
    let before = metalith_testing::cpu_s();
    let result = work();
    if let (Some(before), Some(after)) = (before, metalith_testing::cpu_s()) {
        let slower = if cfg!(debug_assertions) { NOT_OPTIMISED } else { 1.0 };
        let most = (ANY_FILE_S + A_MEGABYTE_S * bytes as f64 * 1e-6) * slower * BESIDE_OTHERS;
        assert!(
            after - before < most,
            "{what}: {:.1} s, at most {most:.1}",
            after - before
        );
    }
    result
}

fn checked(what: &str, bytes: Vec<u8>) -> DrcReport {
    in_time(what, bytes.len(), || check(bytes, &[]))
}

fn status<'r>(report: &'r DrcReport, id: &str) -> &'r Status {
    &report.rules.iter().find(|r| r.id == id).unwrap().status
}

fn violations(report: &DrcReport, id: &str) -> u64 {
    report.rules.iter().find(|r| r.id == id).unwrap().violations
}

/// An outline of any number of vertices, in several XY records.
fn long_polygon(gds: &mut Gds, layer: i16, points: &[(i32, i32)]) {
    gds.empty(0x08).int2(0x0d, &[layer]).int2(0x0e, &[0]);
    for part in points.chunks(8000) {
        let flat: Vec<i32> = part.iter().flat_map(|&(x, y)| [x, y]).collect();
        gds.int4(0x10, &flat);
    }
    gds.empty(0x11);
}

fn of_one_polygon(points: &[(i32, i32)]) -> Vec<u8> {
    let mut gds = Gds::library();
    gds.cell("TOP");
    long_polygon(&mut gds, 1, points);
    gds.end_cell().end()
}

/// `columns` by `rows` copies of what `draw` draws, in a file of a few hundred bytes.
fn copies(columns: i16, rows: i16, (step_x, step_y): (i32, i32), draw: impl FnOnce(&mut Gds)) -> Vec<u8> {
    let mut gds = Gds::library();
    gds.cell("ONE");
    draw(&mut gds);
    let corners = [0, 0, step_x * i32::from(columns), 0, 0, step_y * i32::from(rows)];
    gds.end_cell().cell("TOP").array("ONE", columns, rows, corners);
    gds.end_cell().end()
}

#[test]
fn millions_of_copies_from_a_few_bytes() {
    // As many as are read, one upon the other: what lies off every lattice is more than is held.
    let same_place = copies(4000, 4000, (0, 0), |gds| {
        gds.square(1, 0, 0, 200);
    });
    let report = checked("one place", same_place);
    assert!(matches!(status(&report, "gap.duplicate"), Status::Failed(_)));
    assert_eq!(report.exit_code(), 3);
    // Twice as many are not read.
    let off_lattice = copies(8000, 8000, (37, 41), |gds| {
        gds.square(1, 0, 0, 20);
    });
    let report = checked("off the lattice", off_lattice);
    assert!(matches!(status(&report, "pillar.width.min"), Status::Failed(_)));
    assert_eq!(report.exit_code(), 3);
}

/// Tall boxes side by side, each over hundreds of others: the sweep stops where its work is out of proportion.
#[test]
fn tall_boxes_over_one_another() {
    let tall = copies(32_767, 30, (2, 1000), |gds| {
        gds.rect(1, 0, 0, 1000, 900_000);
    });
    let report = checked("tall boxes", tall);
    let Status::Failed(why) = status(&report, "gap.overlap") else {
        panic!("all pairs were compared");
    };
    let words = why.replace(|c: char| c.is_ascii_digit(), "");
    insta::assert_snapshot!(words, @"more than  steps of work, which is out of proportion to the size of the files");
    assert_eq!(report.exit_code(), 3);
    // Those beside one another are as many, and are compared.
    let apart = copies(32_767, 30, (1001, 1_000_000), |gds| {
        gds.rect(1, 0, 0, 1000, 900_000);
    });
    let report = checked("boxes beside one another", apart);
    assert_eq!(*status(&report, "gap.overlap"), Status::Run);
    assert_eq!(violations(&report, "gap.min"), 32_766 * 30);
}

#[test]
fn outlines_of_many_vertices() {
    // A zigzag of 250,000 vertices, level strokes one above the other, there and back beside the way there.
    let along = |k: i32, aside: i32| (aside + if k % 2 == 0 { 0 } else { 1_000_000 }, 20 * k);
    let there = (0..125_000).map(|k| along(k, 0));
    let mut zigzag: Vec<_> = there.chain((0..125_000).rev().map(|k| along(k, 7))).collect();
    zigzag.push(zigzag[0]);
    let report = checked("zigzag", of_one_polygon(&zigzag));
    assert_eq!(*status(&report, "outline.self_crossing"), Status::Run);
    assert_eq!(violations(&report, "outline.self_crossing"), 0);
    // A comb of 50,000 teeth.
    let mut comb: Vec<(i32, i32)> = vec![(0, -500)];
    for tooth in 0..50_000 {
        let x = 20 * tooth;
        comb.extend([(x, 0), (x, 1_000_000), (x + 10, 1_000_000), (x + 10, 0)]);
    }
    comb.extend([(1_000_000, -500), (0, -500)]);
    let report = checked("comb", of_one_polygon(&comb));
    assert_eq!(*status(&report, "outline.self_crossing"), Status::Run);
    assert_eq!(violations(&report, "outline.self_crossing"), 0);
    // One tooth over the next.
    comb[100_002].0 += 25;
    let report = checked("crossing comb", of_one_polygon(&comb));
    assert_eq!(violations(&report, "outline.self_crossing"), 1);
}

/// Outline of 8000 vertices placed 10,000 times: vertices count, not shapes.
#[test]
fn copies_of_long_outlines() {
    let bytes = copies(100, 100, (1000, 1000), |gds| {
        let saw = (0..4000).flat_map(|k| [(k, 0), (k, 1 + k % 2)]);
        let points: Vec<_> = saw.chain([(4000, -5), (0, -5), (0, 0)]).collect();
        long_polygon(gds, 1, &points);
    });
    let report = checked("copies of long outlines", bytes);
    assert!(matches!(status(&report, "gap.min"), Status::Failed(_)));
    assert_eq!(report.exit_code(), 3);
}

/// A long text under an array is kept once, or not at all.
#[test]
fn copies_of_long_texts() {
    for columns in [100, 1000] {
        let bytes = copies(columns, columns, (100, 100), |gds| {
            gds.text(1, &"x".repeat(500), 0, 0);
        });
        let report = checked("texts", bytes);
        assert_ne!(report.exit_code(), 0);
    }
}

/// Two stacks of 100,000 boxes, drawn as one outline each, with one box shifted by a nanometre.
#[test]
fn stacks_that_differ_by_one_box() {
    let stack = |shift: i32| {
        let right = (0..100_000).flat_map(|k| {
            let x = 1000 + 10 * (k % 5) + if k == 60_000 { shift } else { 0 };
            [(x, 10 * k), (x, 10 * k + 10)]
        });
        let points: Vec<_> = [(0, 0)]
            .into_iter()
            .chain(right)
            .chain([(0, 1_000_000), (0, 0)])
            .collect();
        of_one_polygon(&points)
    };
    let boxes = {
        let mut gds = Gds::library();
        gds.cell("TOP");
        for k in 0..100_000 {
            gds.rect(1, 0, 10 * k, 1000 + 10 * (k % 5), 10 * k + 10);
        }
        gds.end_cell().end()
    };
    let compare = |a: &[u8], b: &[u8]| {
        in_time("stacks", a.len() + b.len(), || {
            let folder = tempfile::tempdir().unwrap();
            let open = |name: &str, bytes: &[u8]| {
                let path = folder.path().join(name);
                std::fs::write(&path, bytes).unwrap();
                Layout::open_with(&path, ReadLimits::default(), &Silent).unwrap()
            };
            let (a, b) = (open("a.gds", a), open("b.gds", b));
            diff(&a, &b, &DiffPlan::default(), &Silent).unwrap().same_geometry
        })
    };
    let whole = stack(0);
    assert!(compare(&whole, &boxes));
    assert!(!compare(&whole, &stack(1)));
    assert!(!compare(&boxes, &stack(1)));
}
