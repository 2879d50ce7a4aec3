//! `metalith check` and `metalith diff`: exit codes.

use std::path::Path;

use metalith_testing::gds::Gds;
use metalith_testing::lens::Chip;

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
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let strict = [Path::new("--rules"), &root.join("rules/sin_pillars.toml")];
    for (layout, code) in [(&clean, 0), (&broken, 1), (&noise, 2), (&empty, 3)] {
        run("check", &[layout, strict[0], strict[1]]).code(code);
    }
    // Without rules nothing is said of widths.
    for (layout, code) in [(&clean, 0), (&broken, 0), (&noise, 2), (&empty, 3)] {
        run("check", &[layout]).code(code);
    }
    run("diff", &[&clean, &clean]).code(0);
    let page = folder.path().join("diff.html");
    run("diff", &[&clean, &broken, Path::new("--report"), &page]).code(1);
    run("diff", &[&clean, &noise]).code(2);
    assert!(std::fs::read_to_string(page).unwrap().contains("The geometry differs"));
    let sarif = folder.path().join("check.sarif");
    run("check", &[&broken, Path::new("--sarif"), &sarif, strict[0], strict[1]]).code(1);
    let sarif = std::fs::read_to_string(sarif).unwrap();
    assert!(sarif.contains("pillar.width.min"));
}

/// Pillars of each shape are judged by the rules of their shape where no others are named: layouts of the program are clean
/// without their designs, and keep the rules that are written from them.
#[test]
fn layouts_without_a_design_are_judged_by_the_shape_of_their_pillars() {
    let folder = tempfile::tempdir().unwrap();
    let program = |args: &[&std::ffi::OsStr]| {
        let mut program = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
        let output = program.args(args).output().unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned(),
        )
    };
    for (design, deck) in [
        ("mini_3x3", "Square pillars"),
        ("geometric_phase_532", "Rectangular pillars"),
        ("hexagonal_1550", "Round pillars"),
    ] {
        let path = metalith_testing::design(design);
        let out = folder.path().join(design);
        program(&["layout".as_ref(), path.as_ref(), "--out".as_ref(), out.as_ref()]);
        let layout = out.join(format!("{design}_pillars.gds"));
        let (code, said) = program(&["check".as_ref(), layout.as_ref()]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains(deck), "{said}");
        let rules = out.join("rules.toml");
        let (code, said) = program(&[
            "check".as_ref(),
            layout.as_ref(),
            "--new-rules".as_ref(),
            rules.as_ref(),
        ]);
        assert_eq!(code, Some(0), "{said}");
        let (code, said) = program(&["check".as_ref(), layout.as_ref(), "--rules".as_ref(), rules.as_ref()]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("gap.min") && said.contains("pillar.lattice"), "{said}");
        let (code, said) = program(&["info".as_ref(), layout.as_ref(), "--json".as_ref()]);
        let found: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert_eq!(code, Some(0));
        assert!(
            !found["lattices"][0]["elements"].as_array().unwrap().is_empty(),
            "{said}"
        );
    }
}

/// Rules that are written from a layout hold for it, and not for one with a narrower gap.
#[test]
fn rules_from_a_layout_find_a_narrower_gap() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&std::ffi::OsStr]| {
        let mut program = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
        program.args(args).assert()
    };
    let write = |name: &str, chip: &Chip| {
        let path = folder.path().join(name);
        std::fs::write(&path, chip.bytes()).unwrap();
        path
    };
    let layout = write("lens.gds", &Chip::clean());
    let rules = folder.path().join("rules.toml");
    run(&[
        "check".as_ref(),
        layout.as_ref(),
        "--new-rules".as_ref(),
        rules.as_ref(),
    ])
    .code(0);
    let check = |layout: &Path| {
        run(&[
            "check".as_ref(),
            layout.as_ref(),
            "--rules".as_ref(),
            rules.as_ref(),
            "--json".as_ref(),
        ])
    };
    check(&layout).code(0);
    // The widest pillar, and the one beside it: 2 nm each.
    let mut narrow = Chip::clean();
    let widest = narrow.pillars.iter().map(|p| p.4).max().unwrap();
    let (ix, iy) = narrow
        .pillars
        .iter()
        .find(|p| p.4 == widest)
        .map(|p| (p.0, p.1))
        .unwrap();
    narrow.at(ix, iy).4 += 2;
    let beside = if ix > 0 { ix - 1 } else { ix + 1 };
    narrow.at(beside, iy).4 = widest;
    let out = check(&write("narrow.gds", &narrow)).code(1);
    let found: serde_json::Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    let judged = found["rules"].as_array().unwrap();
    assert!(
        judged
            .iter()
            .any(|rule| rule["id"] == "gap.min" && rule["violations"] != 0)
    );
    run(&[
        "check".as_ref(),
        layout.as_ref(),
        "--new-rules".as_ref(),
        layout.as_ref(),
    ])
    .code(2);
    // Rules that a person has changed.
    run(&[
        "check".as_ref(),
        layout.as_ref(),
        "--new-rules".as_ref(),
        rules.as_ref(),
    ])
    .code(2);
}

/// `-` is what is piped in, and what is printed; both are as with files.
#[test]
fn a_dash_is_standard_input_or_output() {
    let folder = tempfile::tempdir().unwrap();
    let mut broken = Chip::clean();
    broken.at(60, 60).4 = 98;
    let layout = folder.path().join("broken.gds");
    std::fs::write(&layout, broken.bytes()).unwrap();
    let run = |args: &[&str]| {
        let mut program = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
        program.current_dir(folder.path()).args(args);
        program.write_stdin(broken.bytes()).assert()
    };
    // Widths are limited by these.
    let rules = concat!(env!("CARGO_MANIFEST_DIR"), "/rules/sin_pillars.toml");
    let printed = |args: &[&str], code: i32| run(args).code(code).get_output().stdout.clone();
    let piped = String::from_utf8(printed(&["check", "-", "--rules", rules], 1)).unwrap();
    assert!(
        piped.contains("standard input: 14,409 shapes") && piped.contains("1 violation"),
        "{piped}"
    );
    printed(&["diff", "-", "broken.gds"], 0);
    printed(&["convert", "-", "copy.oas"], 0);
    printed(&["diff", "broken.gds", "copy.oas"], 0);
    printed(&["info", "-"], 0);
    // It ends where it has been read once.
    printed(&["diff", "-", "-"], 2);
    printed(&["check", "broken.gds", "--junit", "broken.xml", "--rules", rules], 1);
    let file = std::fs::read_to_string(folder.path().join("broken.xml")).unwrap();
    let junit = printed(&["check", "broken.gds", "--junit", "-", "--rules", rules], 1);
    assert_eq!(String::from_utf8(junit).unwrap().trim_end(), file.trim_end());
    printed(&["check", "broken.gds", "--junit", "-", "--json"], 2);
    assert!(!folder.path().join("-").exists());
}
