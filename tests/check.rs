//! Design rules: for each rule of the standard decks a layout that breaks it once and only it; what does not
//! run is not clean; waivers; the forms of the report.

#[path = "support/gds.rs"]
mod gds;
#[path = "support/lens.rs"]
mod lens;
#[path = "support/mutate.rs"]
mod mutate;

use std::path::Path;

use gds::Gds;
use lens::{Chip, site};
use metalith::drc::{self, CheckInput, Date, Deck, DrcReport, Severity, Status, Waivers};
use metalith::gds::ReadLimits;
use metalith::{Design, Layout, Silent};

fn layout(bytes: Vec<u8>) -> Layout {
    Layout::from_bytes("chip.gds", bytes, ReadLimits::default()).unwrap()
}

/// The standard deck with words replaced: for rules that others dominate at the standard limits.
fn deck(changes: &[(&str, &str)]) -> Deck {
    deck_from("rules/sin_pillars.toml", changes)
}

fn deck_from(path: &str, changes: &[(&str, &str)]) -> Deck {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let mut text = std::fs::read_to_string(path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deck.toml");
    std::fs::write(&path, text).unwrap();
    Deck::read(&path).unwrap()
}

fn input<'a>() -> CheckInput<'a> {
    CheckInput {
        markers: 100,
        today: Date::parse("2026-11-21").unwrap(),
        ..CheckInput::default()
    }
}

fn check(bytes: Vec<u8>, changes: &[(&str, &str)]) -> DrcReport {
    drc::check(&layout(bytes), &deck(changes), &input(), &Silent).unwrap()
}

/// Ids of rules with violations, how many each.
fn broken(report: &DrcReport) -> Vec<(&str, u64)> {
    let violated = report.rules.iter().filter(|r| r.violations > 0);
    violated.map(|r| (r.id.as_str(), r.violations)).collect()
}

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
            c.extra.rect(1, x - 100, y - 100, x + 100, y + 102);
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
            let w = lens::width(5, 5) + 20;
            c.extra.square(1, x, y, w);
        },
        &[],
    ),
    (
        "gap.duplicate",
        |c| {
            c.extra.square(1, site(5), site(5), lens::width(5, 5));
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
        |c| {
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
        },
        &[],
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

/// The apertures over two lenses, and what can be wrong with them.
#[test]
fn openings_against_lenses() {
    let pillars = layout(Chip::clean().bytes());
    let deck = deck_from("rules/sin_apertures.toml", &[]);
    let judge = |draw: &dyn Fn(&mut Gds)| {
        let mut gds = Gds::library();
        gds.cell("OPEN");
        draw(&mut gds);
        for (length, at) in [(1_000_000, 4_300_000), (200_000, 3_400_000)] {
            for (sx, sy) in [(-1, -1), (1, -1), (-1, 1), (1, 1)] {
                gds.rect(
                    4,
                    sx * at - length / 2,
                    sy * at - length / 2,
                    sx * at + length / 2,
                    sy * at + length / 2,
                );
            }
        }
        let bytes = gds.end_cell().end();
        let with = CheckInput {
            with: vec![&pillars],
            ..input()
        };
        let report = drc::check(&layout(bytes), &deck, &with, &Silent).unwrap();
        broken(&report)
            .iter()
            .map(|(id, n)| format!("{id} {n}"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let opening = |gds: &mut Gds, x: i32, half: i32| {
        gds.rect(2, x - half, -half, x + half, half);
    };
    // The lens reaches 21 um less half a gap.
    assert_eq!(judge(&|g| opening(g, 0, 23_000)), "");
    assert_eq!(judge(&|g| opening(g, 1_000, 22_400)), "opening.margin 1");
    assert_eq!(judge(&|g| opening(g, 3_000, 23_000)), "opening.metal_on_pillars 1");
    let two = |g: &mut Gds| {
        opening(g, 0, 23_000);
        opening(g, 1_000_000, 23_000);
    };
    assert_eq!(judge(&two), "opening.each 1");
}

#[test]
fn what_does_not_run_is_not_clean() {
    // No element: rules about elements are skipped, and the answer is 3, not 0.
    let mut gds = Gds::library();
    gds.cell("EMPTY").rect(10, 0, 0, 1000, 1000).end_cell();
    let report = check(
        gds.end(),
        &[(
            "check = \"marks_complete\"",
            "check = \"marks_complete\"\nwhen = \"design\"",
        )],
    );
    let skipped = report
        .rules
        .iter()
        .filter(|r| matches!(r.status, Status::Skipped(_)))
        .count();
    assert!(skipped >= 4, "{skipped}");
    assert_eq!(report.exit_code(), 3);
    assert!(drc::junit(&report).contains("<error message=\"skipped"));
    assert!(drc::text(&report).contains("not all was checked"));
    // A layout too large to be expanded: what needs its shapes fails, what counts runs.
    let mut bomb = Gds::library();
    bomb.cell("L0").square(1, 0, 0, 200).end_cell();
    for k in 1..=40 {
        let below = format!("L{}", k - 1);
        bomb.cell(&format!("L{k}"))
            .sref(&below, 0, 0)
            .sref(&below, 1000, 0)
            .end_cell();
    }
    let report = check(bomb.end(), &[]);
    assert_eq!(report.exit_code(), 3);
    let status = |id: &str| report.rules.iter().find(|r| r.id == id).unwrap();
    assert!(matches!(status("pillar.width.min").status, Status::Failed(_)));
    assert!(matches!(status("gap.min").status, Status::Failed(_)));
    assert_eq!(status("budget.shapes").violations, 1);
}

/// A folded lens counts what is wrong in its eighth eight times, as the flat one does, at the same places.
#[test]
fn copies_are_counted() {
    let octant = |gds: &mut Gds| {
        for ix in 0..50 {
            for iy in 0..ix {
                let w = if (ix, iy) == (30, 10) { 98 } else { 200 };
                gds.square(1, 175 + 350 * ix, 175 + 350 * iy, w);
            }
        }
    };
    let mut folded = Gds::library();
    folded.cell("OCT");
    octant(&mut folded);
    folded.end_cell().cell("TOP");
    for k in 0..8 {
        folded.placed("OCT", 0, 0, k > 3, 1.0, f64::from(k % 4) * 90.0);
    }
    let mut flat = Gds::library();
    flat.cell("TOP");
    for (sx, sy) in [(1, 1), (-1, 1), (1, -1), (-1, -1)] {
        for ix in 0..50 {
            for iy in 0..ix {
                let w = if (ix, iy) == (30, 10) { 98 } else { 200 };
                let (x, y) = (175 + 350 * ix, 175 + 350 * iy);
                flat.square(1, sx * x, sy * y, w).square(1, sx * y, sy * x, w);
            }
        }
    }
    let report = |gds: &mut Gds| check(gds.end_cell().end(), &[]);
    let (a, b) = (report(&mut folded), report(&mut flat));
    let hashes = |r: &DrcReport| {
        let rule = r.rules.iter().find(|r| r.id == "pillar.width.min").unwrap();
        assert_eq!(rule.violations, 8);
        let mut hashes: Vec<_> = rule.markers.iter().map(|m| m.hash.clone()).collect();
        hashes.sort();
        hashes
    };
    assert_eq!(hashes(&a), hashes(&b));
    assert_eq!(a.pillars_on_lattices, b.pillars_on_lattices);
}

#[test]
fn waivers_cover_places() {
    let mut chip = Chip::clean();
    chip.at(60, 60).4 = 98;
    chip.at(70, 70).4 = 96;
    let bytes = chip.bytes();
    let report = check(bytes.clone(), &[]);
    let markers = &report.rules[0].markers;
    assert_eq!((markers.len(), report.exit_code()), (2, 1));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("waivers.toml");
    let waiver = |hash: &str, expires: &str| {
        format!(
            "[[waiver]]\nrule = \"pillar.width.min\"\nhash = \"{hash}\"\nreason = \"test pad\"\nauthor = \"A. Nyone\"\n\
             expires = \"{expires}\"\n"
        )
    };
    let with = |text: String| {
        std::fs::write(&path, text).unwrap();
        let waivers = Waivers::read(&path).unwrap();
        let input = CheckInput {
            waivers: Some(&waivers),
            ..input()
        };
        drc::check(&layout(bytes.clone()), &deck(&[]), &input, &Silent).unwrap()
    };
    let both = waiver(&markers[0].hash, "2027-01-01") + &waiver(&markers[1].hash, "2026-11-21");
    let waived = with(both);
    assert_eq!(
        (waived.exit_code(), waived.rules[0].waived, waived.rules[0].violations),
        (0, 2, 2)
    );
    assert!(waived.warnings.is_empty());
    let stale = with(waiver(&markers[0].hash, "2026-11-20") + &waiver("0123456789abcdef", "2027-01-01"));
    assert_eq!((stale.exit_code(), stale.rules[0].waived), (1, 0));
    assert!(stale.warnings[0].contains("expired") && stale.warnings[1].contains("covers nothing"));
}

#[test]
fn forms_of_the_report() {
    let mut chip = Chip::clean();
    chip.at(60, 60).4 = 98;
    let report = check(chip.bytes(), &[]);
    let sarif: serde_json::Value = serde_json::from_str(&drc::sarif(&report)).unwrap();
    let run = &sarif["runs"][0];
    assert_eq!(sarif["version"], "2.1.0");
    assert_eq!(run["results"][0]["ruleId"], "pillar.width.min");
    let fingerprint = run["results"][0]["partialFingerprints"]["metalithPlace/v1"]
        .as_str()
        .unwrap();
    assert_eq!(fingerprint, report.rules[0].markers[0].hash);
    assert_eq!(
        run["tool"]["driver"]["rules"].as_array().unwrap().len(),
        report.rules.len()
    );
    assert_eq!(run["invocations"][0]["executionSuccessful"], true);
    let lyrdb = drc::lyrdb(&report);
    for expected in [
        "<category>pillar.width.min</category>",
        "<name>width</name>",
        "polygon: (",
        "<top-cell>CHIP<",
    ] {
        assert!(lyrdb.contains(expected), "{expected}");
    }
    let junit = drc::junit(&report);
    assert!(junit.contains("failures=\"1\"") && junit.contains("errors=\"0\"") && junit.contains("skipped=\"4\""));
    assert!(drc::text(&report).contains("98 nm wide, at least 100 nm"));
}

/// Damaged layouts that can still be read are judged, whatever is in them.
#[test]
fn damaged_layouts_never_panic() {
    use rand::SeedableRng;
    let corpus = [gds::everything()];
    let deck = deck(&[]);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let mut judged = 0;
    for _ in 0..2000 {
        let bytes = mutate::mutate(&mut rng, &corpus);
        let Ok(layout) = Layout::from_bytes("mutant.gds", bytes, mutate::LIMITS) else {
            continue;
        };
        if let Ok(report) = drc::check(&layout, &deck, &input(), &Silent) {
            judged += 1;
            assert!(!drc::text(&report).is_empty() && !drc::lyrdb(&report).is_empty());
        }
    }
    assert!(judged > 100, "{judged}");
}

/// The shipped small design holds what it should, and an altered one does not.
#[test]
fn a_layout_against_its_design() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let design = Design::read(&root.join("designs/mini_3x3.toml")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mini.gds");
    let array = metalith::PillarArray::build(&design, &Silent).unwrap();
    metalith::write_pillars(&design, &array, metalith::Hierarchy::Flat, &path, &Silent).unwrap();
    let judge = |path: &Path| {
        let with = CheckInput {
            design: Some(&design),
            ..input()
        };
        drc::check(&Layout::open(path).unwrap(), &Deck::standard(), &with, &Silent).unwrap()
    };
    let report = judge(&path);
    assert_eq!(broken(&report), [("design.lattice_orders", 1)]);
    assert_eq!(report.exit_code(), 0);
    // The first square two nanometres wider on all sides.
    let mut bytes = std::fs::read(&path).unwrap();
    let head = [0, 4, 8, 0, 0, 6, 13, 2, 0, 1, 0, 6, 14, 2, 0, 0, 0, 44, 16, 3];
    let at = bytes.windows(20).position(|w| w == head).unwrap() + 20;
    let shift = |bytes: &mut Vec<u8>, k: usize, by: i32| {
        let place = at + 4 * k..at + 4 * k + 4;
        let value = i32::from_be_bytes(bytes[place.clone()].try_into().unwrap()) + by;
        bytes[place].copy_from_slice(&value.to_be_bytes());
    };
    let corners: Vec<i32> = (0..10)
        .map(|k| i32::from_be_bytes(bytes[at + 4 * k..at + 4 * k + 4].try_into().unwrap()))
        .collect();
    for k in 0..10 {
        let low = corners[k] == *corners.iter().skip(k % 2).step_by(2).min().unwrap();
        shift(&mut bytes, k, if low { -1 } else { 1 });
    }
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(
        broken(&judge(&path)),
        [("design.width_map", 1), ("design.lattice_orders", 1)]
    );
}

/// Exit codes of both commands, and the files that they leave.
#[test]
fn the_program_answers_with_exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let mut broken = Chip::clean();
    broken.at(60, 60).4 = 98;
    let clean = write("clean.gds", &Chip::clean().bytes());
    let broken = write("broken.gds", &broken.bytes());
    let mut empty = Gds::library();
    empty.cell("EMPTY").rect(10, 0, 0, 1000, 1000).end_cell();
    let empty = write("empty.gds", &empty.end());
    let noise = write("noise.gds", b"no layout at all");
    let run = |command: &str, files: &[&Path]| {
        let mut program = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
        program.arg(command).args(files).assert()
    };
    run("check", &[&clean]).code(0);
    run("check", &[&broken]).code(1);
    run("check", &[&noise]).code(2);
    run("check", &[&empty]).code(3);
    run("diff", &[&clean, &clean]).code(0);
    let page = folder.path().join("diff.html");
    run("diff", &[&clean, &broken, Path::new("--report"), &page]).code(1);
    run("diff", &[&clean, &noise]).code(2);
    assert!(std::fs::read_to_string(page).unwrap().contains("The geometry differs"));
    let sarif = folder.path().join("check.sarif");
    run("check", &[&broken, Path::new("--sarif"), &sarif]).code(1);
    let sarif = std::fs::read_to_string(sarif).unwrap();
    assert!(sarif.contains("pillar.width.min"));
}
