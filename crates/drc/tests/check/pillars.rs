//! The standard deck for pillars: for each rule a chip that breaks it once and only it.

use metalith_drc::{Severity, Status};

use crate::{broken, check};
use metalith_testing::gds::Gds;
use metalith_testing::lens::{self, Chip, site};

#[test]
fn a_clean_chip_is_clean() {
    let report = check(Chip::clean().bytes(), &[]);
    assert_eq!(broken(&report), []);
    assert_eq!((report.exit_code(), report.not_run()), (0, 0));
    assert_eq!((report.elements, report.pillars_on_lattices), (1, 14_400));
    assert!(report.rules.iter().filter(|r| r.status == Status::Run).count() > 35);
}

/// A rule, what is done to the chip, and where another rule would say the same at the standard limits, what
/// of the deck is changed. A pillar that is missing leaves no full window of 31 um for the rules of density:
/// what is removed stands near a corner.
type Case = (&'static str, fn(&mut Chip), &'static [(&'static str, &'static str)]);

const CASES: &[Case] = &[
    ("pillar.width.min", |c| c.at(60, 60).4 = 98, &[]),
    ("pillar.width.max", |c| c.at(60, 60).4 = 302, &[]),
    (
        "pillar.width.cell",
        |c| c.at(60, 60).4 = 250,
        &[("forbidden_nm = []", "forbidden_nm = [250, 252]")],
    ),
    ("pillar.aspect", |c| c.at(60, 60).4 = 92, &[("nm = 100\n", "nm = 90\n")]),
    (
        "pillar.square",
        |c| {
            remove(c, 5, 5);
            let (x, y) = (site(5), site(5));
            c.extra.rect(1, x - 100, y - 100, x + 100, y + 104);
        },
        &[],
    ),
    ("pillar.lattice", |c| c.at(5, 5).2 = 4, &[]),
    (
        "pillar.exposure_grid",
        |c| {
            // All widths multiples of 14 but one, and a beam of 14 nm, which divides the pitch.
            c.pillars.iter_mut().for_each(|p| p.4 = 196);
            c.at(60, 60).4 = 198;
        },
        &[("beam_step_nm = 2", "beam_step_nm = 14")],
    ),
    (
        "gap.min",
        |c| {
            c.at(5, 5).4 = 300;
            c.at(6, 5).4 = 300;
            c.at(6, 5).2 = -4;
        },
        // Moved off the lattice to be nearer; 46 nm are 1 : 15.2.
        &[
            ("id = \"pillar.lattice\"", "id = \"x\"\nwhen = \"design\""),
            ("ratio = 14.5", "ratio = 16"),
        ],
    ),
    (
        "gap.aspect",
        |c| {
            c.at(60, 60).4 = 300;
            c.at(61, 60).4 = 296;
        },
        &[("ratio = 14.5", "ratio = 13.4")],
    ),
    (
        "gap.overlap",
        |c| {
            let (x, y) = (site(5), site(5));
            let w = metalith_testing::lens::width(5, 5) + 20;
            c.extra.square(1, x, y, w);
        },
        &[],
    ),
    (
        "gap.duplicate",
        |c| {
            c.extra.square(1, site(5), site(5), metalith_testing::lens::width(5, 5));
        },
        &[],
    ),
    (
        "outline.grid",
        |c| {
            // A half nanometre in a database of half nanometres, on a mark of another size.
            c.unit_m = 0.5e-9;
            c.extra.rect(3, 6_000_000, 0, 6_400_001, 400_001);
        },
        &[
            ("length_um = [1000, 200]", "length_um = [1000, 200, 200.0005]"),
            ("count = [4, 4]", "count = [4, 4, 1]"),
        ],
    ),
    (
        "outline.manhattan",
        |c| {
            octagon(&mut c.extra, 2_000_000, 0);
        },
        &[
            ("length_um = [1000, 200]", "length_um = [1000, 200, 40]"),
            ("count = [4, 4]", "count = [4, 4, 1]"),
        ],
    ),
    (
        "outline.acute",
        |c| {
            c.extra.polygon(
                3,
                &[(2_000_000, 0), (2_040_000, 0), (2_000_000, 40_000), (2_000_000, 0)],
            );
        },
        &[
            ("length_um = [1000, 200]", "length_um = [1000, 200, 40]"),
            ("count = [4, 4]", "count = [4, 4, 1]"),
        ],
    ),
    (
        "outline.self_crossing",
        |c| {
            let p = [(0, 0), (30, 0), (30, 40), (40, 40), (40, 5), (0, 5), (0, 0)];
            let p: Vec<_> = p.iter().map(|&(x, y)| (2_000_000 + 1000 * x, 1000 * y)).collect();
            c.extra.polygon(3, &p);
        },
        &[
            ("length_um = [1000, 200]", "length_um = [1000, 200, 40]"),
            ("count = [4, 4]", "count = [4, 4, 1]"),
        ],
    ),
    (
        "outline.doubled_vertex",
        |c| {
            remove(c, 5, 5);
            vertex(c, false);
        },
        &[],
    ),
    (
        "outline.collinear_vertex",
        |c| {
            remove(c, 5, 5);
            vertex(c, true);
        },
        &[],
    ),
    (
        "outline.zero_area",
        |c| {
            c.extra
                .polygon(1, &[(50_000, 0), (50_200, 0), (50_200, 0), (50_000, 0), (50_000, 0)]);
        },
        &[],
    ),
    (
        "outline.closed",
        |c| {
            remove(c, 5, 5);
            let (x, y) = (site(5), site(5));
            c.extra.polygon(
                1,
                &[(x - 80, y - 80), (x + 80, y - 80), (x + 80, y + 80), (x - 80, y + 80)],
            );
        },
        &[],
    ),
    (
        "outline.winding",
        clockwise,
        &[(
            "[[rule]]\nid = \"outline.vertices\"",
            "[[rule]]\nid = \"outline.winding\"\ncheck = \"winding\"\ndirection = \"counter_clockwise\"\n\n\
             [[rule]]\nid = \"outline.vertices\"",
        )],
    ),
    (
        "outline.vertices",
        |c| {
            // A comb: 4 vertices a tooth.
            let mut p = vec![(1_000_000, -4_500_000), (1_000_000, -4_540_000)];
            for k in 0..60 {
                let x = 1_000_000 + 2000 * k;
                let y = -4_540_000;
                p.extend([(x + 1000, y), (x + 1000, y + 20_000), (x + 2000, y + 20_000)]);
                p.push((x + 2000, y));
            }
            p.extend([(1_121_000, -4_540_000), (1_121_000, -4_500_000)]);
            p.push((1_000_000, -4_500_000));
            c.extra.polygon(10, &p);
        },
        &[],
    ),
    ("density.fill", |c| c.pillars.iter_mut().for_each(|p| p.4 = 300), &[]),
    (
        "density.gradient",
        |c| {
            // A second lens, three windows wide, its middle window 0.18 of the area, the others 0.47.
            for ix in 0..268 {
                for iy in 0..100 {
                    let w = if (90..178).contains(&ix) { 150 } else { 240 };
                    c.pillars.push((ix + 1000, iy, 0, 0, w));
                }
            }
        },
        &[("max = 0.25", "max = 0.28")],
    ),
    (
        "field.cut",
        |c| {
            // One pillar alone in the first column, and a boundary through it.
            c.pillars.retain(|p| p.0 != 0 || p.1 == 60);
        },
        &[(
            "check = \"field_cut\"\nfield_um = 499.8",
            "check = \"field_cut\"\nfield_um = 499.8\noffset_um = [-270.725, 0]",
        )],
    ),
    (
        "field.in_lens",
        |_| {},
        &[(
            "check = \"field_in_lens\"\nfield_um = 499.8",
            "check = \"field_in_lens\"\nfield_um = 499.8\noffset_um = [249.9, 0]",
        )],
    ),
    (
        "mark.keep_out",
        |c| {
            c.extra.square(1, 3_400_000 + 112_000, 3_400_000, 200);
        },
        &[],
    ),
    (
        "mark.complete",
        |c| {
            c.marks = false;
            lens::cross(&mut c.extra, 4_300_000, 4_300_000, 1_000_000, 10_000);
        },
        &[
            ("length_um = [1000, 200]", "length_um = [1000]"),
            ("count = [4, 4]", "count = [4]"),
        ],
    ),
    (
        "layer.known",
        |c| {
            c.extra.rect(77, 0, -100_000, 1000, -99_000);
        },
        &[],
    ),
    (
        "layer.active_area",
        |c| {
            c.extra.square(1, 4_950_000, 0, 200);
        },
        &[],
    ),
    (
        "layer.text",
        |c| {
            c.extra.text(1, "exposed?", 0, -100_000);
        },
        &[],
    ),
    ("cell.names", |c| c.top = "CHIP-1", &[]),
    (
        "cell.depth",
        |c| {
            c.before.cell("L0").rect(10, 0, -100_000, 1000, -99_000).end_cell();
            for k in 1..9 {
                c.before
                    .cell(&format!("L{k}"))
                    .sref(&format!("L{}", k - 1), 0, 0)
                    .end_cell();
            }
            c.extra.sref("L8", 0, 0);
        },
        &[],
    ),
    (
        "cell.references",
        |c| {
            c.before.cell("W").rect(10, 0, 0, 1000, 1000).end_cell();
            c.extra.sref("W", 0, 100_000).sref("W", 0, 200_000);
        },
        &[(
            "count = 200_000_000\n\n[[rule]]\nid = \"cell.one_top\"",
            "count = 1\n\n[[rule]]\nid = \"cell.one_top\"",
        )],
    ),
    (
        "cell.one_top",
        |c| {
            c.after.cell("LOST").rect(10, 0, 0, 1000, 1000).end_cell();
        },
        &[],
    ),
    (
        "cell.dangling",
        |c| {
            c.extra.sref("NOWHERE", 0, 0);
        },
        &[],
    ),
    (
        "cell.recursive",
        |c| {
            c.before
                .cell("LOOP")
                .rect(10, 0, 0, 1000, 1000)
                .sref("LOOP", 5, 5)
                .end_cell();
            c.extra.sref("LOOP", 0, 100_000);
        },
        &[],
    ),
    (
        "cell.twice",
        |c| {
            c.before.cell("TWICE").rect(10, 0, 0, 1000, 1000).end_cell();
            c.after.cell("TWICE").rect(10, 0, 0, 2000, 1000).end_cell();
            c.extra.sref("TWICE", 0, 100_000);
        },
        &[],
    ),
    ("budget.file_size", |_| {}, &[("mb = 12_000", "mb = 0.5")]),
    (
        "budget.shapes",
        |_| {},
        &[(
            "check = \"shape_count\"\ncount = 200_000_000",
            "check = \"shape_count\"\ncount = 10_000",
        )],
    ),
    ("budget.write_time", |_| {}, &[("hours = 24", "hours = 0.0001")]),
];

/// One pillar drawn clockwise.
fn clockwise(c: &mut Chip) {
    remove(c, 5, 5);
    let (x, y) = (site(5), site(5));
    let p = [
        (x - 80, y - 80),
        (x - 80, y + 80),
        (x + 80, y + 80),
        (x + 80, y - 80),
        (x - 80, y - 80),
    ];
    c.extra.polygon(1, &p);
}

fn remove(c: &mut Chip, ix: i32, iy: i32) {
    c.pillars.retain(|p| (p.0, p.1) != (ix, iy));
}

/// The pillar of site (5, 5) with a vertex more than it needs.
fn vertex(c: &mut Chip, between: bool) {
    let (x, y) = (site(5), site(5));
    let more = if between { (x, y - 80) } else { (x - 80, y - 80) };
    let p = [
        (x - 80, y - 80),
        more,
        (x + 80, y - 80),
        (x + 80, y + 80),
        (x - 80, y + 80),
        (x - 80, y - 80),
    ];
    c.extra.polygon(1, &p);
}

/// 40 um across, no angle below 90 degrees.
fn octagon(gds: &mut Gds, x: i32, y: i32) {
    let p = [
        (-20, -8),
        (-8, -20),
        (8, -20),
        (20, -8),
        (20, 8),
        (8, 20),
        (-8, 20),
        (-20, 8),
        (-20, -8),
    ];
    let p: Vec<_> = p.iter().map(|&(dx, dy)| (x + 1000 * dx, y + 1000 * dy)).collect();
    gds.polygon(3, &p);
}

/// Rules for which one defect is more than one place, with the number.
const SEVERAL: &[(&str, u64)] = &[("density.gradient", 2)];

#[test]
fn each_rule_is_broken_alone() {
    let mut wrong = Vec::new();
    for (id, break_it, changes) in CASES {
        let mut chip = Chip::clean();
        break_it(&mut chip);
        let report = check(chip.bytes(), changes);
        let times = SEVERAL.iter().find(|s| s.0 == *id).map_or(1, |s| s.1);
        if broken(&report) != [(*id, times)] {
            wrong.push(format!("{id}: {:?}", broken(&report)));
        }
        let not_run = report
            .rules
            .iter()
            .filter(|r| matches!(r.status, Status::Skipped(_) | Status::Failed(_)));
        wrong.extend(not_run.map(|r| format!("{id}: {} {:?}", r.id, r.status)));
        let note = report.rules.iter().any(|r| r.id == *id && r.severity == Severity::Note);
        if report.exit_code() != u8::from(!note) {
            wrong.push(format!("{id}: exit {}", report.exit_code()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Every rule of the standard deck is in the list above, or needs a design or trailing bytes.
#[test]
fn no_rule_is_left_out() {
    let report = check(Chip::clean().bytes(), &[]);
    for rule in &report.rules {
        let elsewhere = rule.id.starts_with("design.") || rule.id == "file.end";
        assert!(elsewhere || CASES.iter().any(|c| c.0 == rule.id), "{}", rule.id);
    }
}

#[test]
fn bytes_behind_the_end() {
    let mut bytes = Chip::clean().bytes();
    bytes.extend([0; 100]);
    assert_eq!(broken(&check(bytes.clone(), &[])), []);
    bytes.push(7);
    assert_eq!(broken(&check(bytes, &[])), [("file.end", 1)]);
}

/// GDSII gives the direction of an outline no meaning: KLayout writes all of them clockwise.
#[test]
fn clockwise_outlines_are_no_finding() {
    let mut chip = Chip::clean();
    clockwise(&mut chip);
    assert_eq!(broken(&check(chip.bytes(), &[])), []);
}

/// Circles and turned squares are no squares, whichever other rule looks at their sides.
#[test]
fn what_is_no_square_is_found() {
    /// Vertices of the polygon that stands for a circle.
    const VERTICES: i32 = 32;
    let mut chip = Chip::clean();
    for k in 0..10 {
        let (x, y) = (site(2 * k), site(5));
        remove(&mut chip, 2 * k, 5);
        let angle = |v: i32| std::f64::consts::TAU * f64::from(v % VERTICES) / f64::from(VERTICES);
        let circle: Vec<_> = (0..=VERTICES)
            .map(|v| {
                let (sin, cos) = angle(v).sin_cos();
                (x + (100.0 * cos).round() as i32, y + (100.0 * sin).round() as i32)
            })
            .collect();
        chip.extra.polygon(1, &circle);
        let y = site(9);
        remove(&mut chip, 2 * k, 9);
        let turned = [(x + 90, y), (x, y + 90), (x - 90, y), (x, y - 90), (x + 90, y)];
        chip.extra.polygon(1, &turned);
    }
    let report = check(chip.bytes(), &[]);
    let violations = |id: &str| report.rules.iter().find(|r| r.id == id).unwrap().violations;
    assert_eq!((violations("pillar.square"), violations("outline.manhattan")), (20, 20));
}
