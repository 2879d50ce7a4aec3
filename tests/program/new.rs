//! A first design.

use std::fs;

use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;

use super::{metalith, refusal};

/// What `new` writes passes its own run and the design rules, at more than one size.
#[test]
fn a_new_design_can_be_run_and_checked() {
    for options in [&[][..], &["--elements", "1", "--diameter-um", "80.3"]] {
        let folder = tempfile::tempdir().unwrap();
        let run = |arguments: &[&str]| metalith().current_dir(folder.path()).args(arguments).assert().success();
        run(&[&["new", "mine.toml"], options].concat());
        assert!(
            fs::read_to_string(folder.path().join("mine.toml"))
                .unwrap()
                .contains("# ")
        );
        run(&["run", "mine.toml", "--fast", "--fidelity", "published", "--quiet"]);
        let pillars = "out/mine/mine_pillars.gds";
        run(&["check", pillars, "--design", "mine.toml", "--quiet"]);
        let apertures = "out/mine/mine_apertures.gds";
        let rules = concat!(env!("CARGO_MANIFEST_DIR"), "/rules/sin_apertures.toml");
        run(&[
            "check",
            apertures,
            "--rules",
            rules,
            "--design",
            "mine.toml",
            "--with",
            pillars,
            "--quiet",
        ]);
    }
}

#[test]
fn a_new_design_replaces_nothing_and_says_what_cannot_be() {
    let folder = tempfile::tempdir().unwrap();
    let new = |arguments: &[&str]| {
        metalith()
            .current_dir(folder.path())
            .arg("new")
            .args(arguments)
            .assert()
            .code(2)
    };
    fs::write(folder.path().join("mine.toml"), "mine").unwrap();
    new(&["mine.toml"]).stderr(contains(refusal("new/exists")));
    assert_eq!(fs::read_to_string(folder.path().join("mine.toml")).unwrap(), "mine");
    new(&["none.toml", "--elements", "0"]).stderr(contains("array.elements/out-of-range"));
    new(&["nan.toml", "--diameter-um", "nan"]);
    assert!(!folder.path().join("none.toml").exists() && !folder.path().join("nan.toml").exists());
}

/// One line gives the design of a lens for a wavelength, whose mapping is solved from its cell; what cannot be is refused with what can.
#[test]
fn a_new_design_is_for_its_wavelength_and_material() {
    let folder = tempfile::tempdir().unwrap();
    let new = |arguments: &[&str]| {
        let mut program = metalith();
        program
            .current_dir(folder.path())
            .env("METALITH_CACHE", folder.path().join("cache"));
        program.arg("new").args(arguments).assert()
    };
    let lens = [
        "--material",
        "TiO2",
        "--wavelength-nm",
        "633",
        "--diameter-um",
        "20",
        "--focal-length-um",
        "40",
    ];
    new(&[&["lens.toml"][..], &lens].concat()).success();
    let text = fs::read_to_string(folder.path().join("lens.toml")).unwrap();
    for said in [
        "source = \"cells\"",
        "pillar_material = \"tio2_siefke_2016\"",
        "wavelengths_nm = [633]",
        "shape = \"circle\"",
    ] {
        assert!(text.contains(said), "{said} in {text}");
    }
    let run = ["run", "lens.toml", "--fast", "--quiet"];
    let mut program = metalith();
    program
        .current_dir(folder.path())
        .env("METALITH_CACHE", folder.path().join("cache"));
    program.args(run).assert().success();
    let report = fs::read_to_string(folder.path().join("out/lens/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["mapping"]["digest"].as_str().unwrap().len(), 32);
    assert!(report["mapping"]["light"]["first"].as_f64().unwrap() > 0.7);
    let refused = |options: &[&str]| new(&[&["none.toml"][..], &lens, options].concat()).code(2);
    refused(&["--pitch-nm", "500"]).stderr(contains(refusal("new/pitch-diffracts")).and(contains(" 434 ")));
    refused(&["--pillar-height-nm", "150"]).stderr(contains(refusal("new/no-usable-height")));
    new(&["none.toml", "--material", "TiO3"])
        .code(2)
        .stderr(contains("use one of tio2"));
    // A shipped design is rescaled to another wavelength and another size, and what it has no other of is refused.
    let like = [
        "like.toml",
        "--like",
        "asi_940",
        "--wavelength-nm",
        "1550",
        "--diameter-um",
        "50",
        "--array",
        "2x1",
    ];
    new(&like).success();
    let text = fs::read_to_string(folder.path().join("like.toml")).unwrap();
    for said in [
        "wavelength_nm = 1550",
        "focal_length_um = 75",
        "elements = [2, 1]",
        "source = \"cells\"",
        "wavelengths_nm = [1550]",
    ] {
        assert!(text.contains(said), "{said} in {text}");
    }
    assert!(!folder.path().join("mappings").exists());
    let rectangles = ["none.toml", "--like", "birefringent_532", "--wavelength-nm", "633"];
    new(&rectangles)
        .code(2)
        .stderr(contains("birefringent_532 with other values"));
    assert!(!folder.path().join("none.toml").exists());
}

/// Every design of the repository can be begun with from the program alone, and is the same but for its name.
#[test]
fn a_new_design_may_be_like_one_that_comes_with_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let shipped = metalith_testing::root().join("designs");
    let new = |arguments: &[&str]| {
        let mut program = metalith();
        program.current_dir(folder.path()).arg("new").args(arguments);
        program.assert()
    };
    let mut tried = 0;
    for entry in fs::read_dir(&shipped).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let like = path.file_stem().unwrap().to_str().unwrap();
        let mine = format!("my_{like}");
        new(&[&format!("{mine}.toml"), "--like", like]).success();
        let written = fs::read_to_string(folder.path().join(format!("{mine}.toml"))).unwrap();
        // The first line is for editors.
        let written = written.strip_prefix("#:schema ./design.schema.json\n").unwrap();
        let renamed = written.replacen(&format!("name = \"{mine}\""), &format!("name = \"{like}\""), 1);
        assert!(
            renamed != written && renamed == fs::read_to_string(&path).unwrap(),
            "{like}"
        );
        tried += 1;
    }
    assert!(tried > 15);
    for file in [
        "phases/birefringent_532.csv",
        "phases/four_spots.npy",
        "mappings/tio2_532.csv",
    ] {
        assert!(fs::read(folder.path().join(file)).unwrap() == fs::read(shipped.join(file)).unwrap());
    }
    let mut layout = metalith();
    layout.current_dir(folder.path());
    layout
        .args(["layout", "my_birefringent_532.toml", "--quiet"])
        .assert()
        .success();
}

/// A file of another content is kept, and nothing is left of a design that cannot be.
#[test]
fn a_new_design_like_another_replaces_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let new = |arguments: &[&str]| {
        let mut program = metalith();
        program.current_dir(folder.path()).arg("new").args(arguments);
        program.assert().code(2)
    };
    new(&["two words.toml", "--like", "tio2_532"]).stderr(contains("name/inconsistent"));
    assert!(!folder.path().join("two words.toml").exists() && !folder.path().join("mappings/tio2_532.csv").exists());
    let mapping = folder.path().join("mappings/tio2_532.csv");
    fs::create_dir_all(mapping.parent().unwrap()).unwrap();
    fs::write(&mapping, "mine").unwrap();
    new(&["mine.toml", "--like", "tio2_532"]).stderr(contains(refusal("new/exists")));
    assert_eq!(fs::read_to_string(&mapping).unwrap(), "mine");
    assert!(!folder.path().join("mine.toml").exists());
    new(&["mine.toml", "--like", "tio2"]).stderr(contains("tio2_532"));
}

/// A design that is piped in makes the layout of the same design in a file.
#[test]
fn a_design_may_come_by_standard_input() {
    let folder = tempfile::tempdir().unwrap();
    let design = std::fs::read(metalith_testing::design("mini_3x3")).unwrap();
    let bytes = |from: &str, out: &str| {
        let mut program = metalith();
        program
            .current_dir(folder.path())
            .args(["layout", from, "--quiet", "--out", out]);
        program.write_stdin(design.clone()).assert().success();
        std::fs::read(folder.path().join(out).join("mini_3x3_pillars.gds")).unwrap()
    };
    std::fs::write(folder.path().join("mini.toml"), &design).unwrap();
    assert!(bytes("-", "piped") == bytes("mini.toml", "named"));
    let mut program = metalith();
    let failed = program
        .args(["layout", "-"])
        .write_stdin("schema = 2\n")
        .assert()
        .code(2);
    let said = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(
        said.contains("[standard input:1:10]") && said.contains("schema/"),
        "{said}"
    );
}

/// Two designs may have one name, and would have one folder for their outputs.
#[test]
fn outputs_of_a_design_of_the_same_name_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| metalith().current_dir(folder.path()).args(arguments).assert();
    for (design, diameter) in [("a/lens.toml", "60"), ("b/lens.toml", "50")] {
        fs::create_dir(folder.path().join(design).parent().unwrap()).unwrap();
        run(&["new", design, "--elements", "1", "--diameter-um", diameter]).success();
    }
    run(&["layout", "a/lens.toml"]).success();
    let layout = || fs::read(folder.path().join("out/lens/lens_pillars.gds")).unwrap();
    let first = layout();
    for command in ["layout", "run", "cells", "optimise"] {
        run(&[command, "b/lens.toml"])
            .code(2)
            .stderr(contains(refusal("option/folder-of-another-input")));
    }
    assert_eq!(layout(), first);
    run(&["layout", "a/lens.toml"]).success();
    run(&["layout", "b/lens.toml", "--out", "out/lens"]).success();
    assert_ne!(layout(), first);
    run(&["layout", "b/lens.toml"]).success();
}
