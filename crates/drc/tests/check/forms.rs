//! Tests of the report of a check: what did not run, copies, waivers, the forms of the report, exit codes.

use metalith_core::Silent;
use metalith_drc::{CheckInput, DrcReport, Status, Waivers};
use metalith_gds::Layout;

use crate::{check, deck, input, layout};
use metalith_testing::gds::{self, Gds};
use metalith_testing::lens::Chip;

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
    let junit = metalith_drc::junit(&report);
    assert_eq!(junit.matches("<error message=").count(), report.not_run());
    insta::assert_snapshot!(metalith_drc::text(&report).lines().last().unwrap(), @"44 rules: 32 run; 7 not run: pillar.lattice, pillar.exposure_grid, density.fill, density.gradient, field.cut, field.in_lens, mark.keep_out; 5 not in force without a design: mark.complete, design.pillar_count, design.width_map, design.phase_step, design.lattice_orders; 0 violations, 0 notes, 0 waived: not clean, and not all was checked");
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
        metalith_drc::check(&layout(bytes.clone()), &deck(&[]), &input, &Silent).unwrap()
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
    let warnings = stale.warnings.join("\n").replace(&markers[0].hash, "HASH");
    insta::assert_snapshot!(warnings, @"
        waiver HASH of pillar.width.min by A. Nyone expired on 2026-11-20
        waiver 0123456789abcdef of pillar.width.min by A. Nyone covers nothing: the violation is gone, or the geometry changed
        ");
}

#[test]
fn forms_of_the_report() {
    let mut chip = Chip::clean();
    chip.at(60, 60).4 = 98;
    let report = check(chip.bytes(), &[]);
    let sarif: serde_json::Value = serde_json::from_str(&metalith_drc::sarif(&report)).unwrap();
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
    let lyrdb = metalith_drc::lyrdb(&report);
    for expected in [
        "<category>pillar.width.min</category>",
        "<name>width</name>",
        "polygon: (",
        "<top-cell>CHIP<",
    ] {
        assert!(lyrdb.contains(expected), "{expected}");
    }
    let junit = metalith_drc::junit(&report);
    assert!(junit.contains("failures=\"1\"") && junit.contains("errors=\"0\"") && junit.contains("skipped=\"4\""));
    let text = metalith_drc::text(&report);
    let marker = text.lines().find(|line| line.ends_with(&format!("[{fingerprint}]")));
    insta::assert_snapshot!(marker.unwrap().trim().replace(fingerprint, "HASH"), @"98 nm wide, at least 100 nm at (0.175, 0.175) um  [HASH]");
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
        let bytes = metalith_testing::mutate::mutate(&mut rng, &corpus);
        let Ok(layout) = Layout::from_bytes("mutant.gds", bytes, metalith_testing::mutate::LIMITS) else {
            continue;
        };
        if let Ok(report) = metalith_drc::check(&layout, &deck, &input(), &Silent) {
            judged += 1;
            assert!(!metalith_drc::text(&report).is_empty() && !metalith_drc::lyrdb(&report).is_empty());
        }
    }
    assert!(judged > 100, "{judged}");
}

/// Of pillars below two cells at the top, the cause is stated first, and nothing is said of places that they share by chance.
#[test]
fn several_tops_are_stated_first() {
    let mut gds = Gds::library();
    for cell in ["AA", "BB"] {
        gds.cell(cell);
        for k in 0..36 {
            gds.square(1, 350 * (k % 6), 350 * (k / 6), 150);
        }
        gds.end_cell();
    }
    let report = metalith_drc::check_generic(&layout(gds.end()), None, &input(), &Silent).unwrap();
    assert_eq!(super::broken(&report), [("cell.one_top", 1)]);
    assert_eq!(report.exit_code(), 3);
    let text = metalith_drc::text(&report);
    let first = text.lines().nth(3).unwrap();
    assert!(
        first.starts_with("cell.one_top ") && first.contains("1 error"),
        "{text}"
    );
    assert!(
        text.contains("2 cells at the top have shapes on 1/0, such as AA, BB: check each of them with --top"),
        "{text}"
    );
}
