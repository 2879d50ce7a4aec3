//! Files of results: they replace no input, a set of two runs is refused, and what killed runs leave goes.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::text::hex;
use metalith_testing::{changed, replaced, root};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::refusal;

/// Sensor of 32 x 32 pixels.
const CAMERA: &str = r#"schema = 1
name = "tiny"
[sensor]
pixel_um = 2.0
columns = 32
rows = 32
filter = "none"
offset_um = [0, 0]
tilt_deg = [0, 0]
bits = 12
full_well_e = 32000
read_noise_e = 7
dark_current_e_s = 5
gain_e = 7.8
[[channel]]
name = "mono"
efficiency = 0.6
band_nm = [658, 662]
[exposure]
time_ms = 10
white = 0.9
[illuminant]
source = "leds"
[[illuminant.led]]
centre_nm = 660
width_nm = 4
"#;

/// A folder with a lens of 20 um, its layout, its camera and a photograph: it holds inputs and takes results.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let small = changed(
            "mini_3x3",
            &[
                ("name = \"mini_3x3\"", "name = \"lens\""),
                ("diameter_um = 60", "diameter_um = 20"),
                ("focal_length_um = 144", "focal_length_um = 48"),
                ("elements = [3, 3]", "elements = [1, 1]"),
                ("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [660]"),
                ("field_x_deg = [0, 15]", "field_x_deg = [0]"),
                ("field_y_deg = [0, 0]", "field_y_deg = [0]"),
                ("window_samples = 128", "window_samples = 32"),
            ],
        );
        fs::write(bench.at("lens.toml"), &small).unwrap();
        fs::write(bench.at("camera.toml"), CAMERA).unwrap();
        photograph(&bench.at("0.png"));
        bench.said(&["layout", "lens.toml", "--out", "."], 0);
        bench
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The text of the design with a phase from a table in a file of this name.
    fn write_with_phase(&self, file: &str) {
        fs::write(self.at(file), "r_um,phase_rad\n0,0\n5,-1\n10,-4\n").unwrap();
        let table = format!("source = \"table\"\nfile = \"{file}\"\n#");
        let text = fs::read_to_string(self.at("lens.toml")).unwrap();
        let text = replaced(
            &text,
            &[
                ("source = \"hyperbola\"", &table),
                ("wavelength_nm = 550", &"#".to_owned()),
            ],
        );
        fs::write(self.at("of_table.toml"), text).unwrap();
    }

    /// A list of a result with one file, in the folder of the file.
    fn list(&self, set: &str, file: &str, digest: &str) {
        let path = self.at(file);
        let line = format!("{digest}  {}\n", path.file_name().unwrap().to_string_lossy());
        fs::write(path.with_file_name(format!(".{set}.sha256")), line).unwrap();
    }

    fn digest(&self, file: &str) -> String {
        hex(&Sha256::digest(fs::read(self.at(file)).unwrap()))
    }

    fn run(&self, words: &[&str]) -> assert_cmd::assert::Assert {
        let mut command = super::metalith();
        command.args(words).arg("-q").current_dir(self.folder.path()).assert()
    }

    fn said(&self, words: &[&str], code: i32) {
        self.run(words).code(code);
    }

    /// Names in a folder, all below it.
    fn names(&self, folder: &str) -> Vec<String> {
        let mut names = Vec::new();
        let mut open = vec![self.at(folder)];
        while let Some(next) = open.pop() {
            for entry in fs::read_dir(next).unwrap().map(|entry| entry.unwrap()) {
                if entry.file_type().unwrap().is_dir() {
                    open.push(entry.path());
                }
                let below = entry.path().strip_prefix(self.at(folder)).unwrap().to_owned();
                names.push(below.to_string_lossy().into_owned());
            }
        }
        names.sort();
        names
    }

    /// The command ends before it replaces its input.
    fn refuses_to_replace(&self, words: &[&str], input: &str) {
        let before = fs::read(self.at(input)).unwrap();
        self.run(words).code(2).stderr(contains(refusal("option/same-file")));
        assert!(fs::read(self.at(input)).unwrap() == before, "{words:?}");
    }
}

fn photograph(path: &Path) {
    let grey = ndarray::Array3::from_shape_fn((40, 40, 3), |(y, x, _)| (y + x) as f64 / 80.0);
    metalith::imaging::write_picture(path, &grey).unwrap();
}

const SEEN: [&str; 6] = ["--design", "lens.toml", "--camera", "camera.toml", "--field-deg", "20"];

/// Each command that writes files, with an input that has the name of a result, or that a list names as a file of an earlier run.
#[test]
fn no_command_replaces_its_inputs() {
    let bench = Bench::new();
    let refused = |words: &[&str], input: &str| bench.refuses_to_replace(words, input);
    fs::create_dir(bench.at("kit")).unwrap();
    // A table that the design names.
    let of_design: [(&str, &str, &[&str]); 5] = [
        ("layout", "lens.lyp", &["--out", "."]),
        (
            "run",
            "report.json",
            &["--fast", "--fidelity", "published", "--out", "."],
        ),
        (
            "verify",
            "report.html",
            &["lens_pillars.gds", "--fast", "--fidelity", "published"],
        ),
        ("handoff", "kit/phase.csv", &["--out", "kit"]),
        ("optimise", "phase.csv", &["--out", "."]),
    ];
    for (command, file, options) in of_design {
        bench.write_with_phase(file);
        refused(&[&[command, "of_table.toml"], options].concat(), file);
    }
    fs::copy(bench.at("lens_pillars.gds"), bench.at("report.json")).unwrap();
    let light = ["--layer", "1/0", "--wavelength-nm", "660", "--distance-um", "48"];
    refused(
        &[&["psf", "report.json", "--out", "."], &light[..]].concat(),
        "report.json",
    );
    fs::copy(bench.at("lens.toml"), bench.at("model.toml")).unwrap();
    refused(&["calibrate", "model.toml", "--out", "."], "model.toml");
    let named: [&[&str]; 4] = [
        &["denoise", "0.png", "--noise", "5", "--out", "0.png"],
        &["convert", "lens_pillars.gds", "./lens_pillars.gds"],
        &["check", "lens_pillars.gds", "--sarif", "lens_pillars.gds"],
        &[
            "diff",
            "lens_pillars.gds",
            "report.json",
            "--report",
            "lens_pillars.gds",
        ],
    ];
    for words in named {
        refused(words, words[1]);
    }
}

/// Each command that writes several files, a second time into its folder after the design has changed, and `run` among results of others.
#[test]
fn a_command_run_again_replaces_its_own_result() {
    let bench = Bench::new();
    let light = ["--layer", "1/0", "--wavelength-nm", "660", "--distance-um", "48"];
    let psf = [&["psf", "lens_pillars.gds", "--fast", "--out", "p"], &light[..]].concat();
    let layout = "lens_pillars.gds";
    let commands: [&[&str]; 8] = [
        &["run", "lens.toml", "--fast", "--fidelity", "published", "--out", "r"],
        &["run", "lens.toml", "--fast", "--fidelity", "published", "--out", "."],
        &["layout", "lens.toml", "--out", "l"],
        &[
            "verify",
            "lens.toml",
            layout,
            "--fast",
            "--fidelity",
            "published",
            "--out",
            "v",
        ],
        &["handoff", "lens.toml", "--out", "h"],
        &["check", layout, "--design", "lens.toml", "--sarif", "c.sarif"],
        &["optimise", "lens.toml", "--out", "o"],
        &psf,
    ];
    let text = fs::read_to_string(bench.at("lens.toml")).unwrap();
    let another = replaced(&text, &[("focal_length_um = 48", "focal_length_um = 60")]);
    for design in [&text, &another, &another] {
        fs::write(bench.at("lens.toml"), design).unwrap();
        bench.said(&["layout", "lens.toml", "--out", "."], 0);
        for words in commands {
            let done = bench.run(words).get_output().clone();
            let is_refused = done.status.code() != Some(0) && done.status.code() != Some(1);
            assert!(!is_refused, "{words:?}: {}", String::from_utf8_lossy(&done.stderr));
        }
    }
}

/// Commands of pictures, whose images may be those of an earlier result.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn no_image_is_replaced_by_what_is_made_of_it() {
    let bench = Bench::new();
    let refused = |words: &[&str], input: &str| bench.refuses_to_replace(words, input);
    let picture = [&["picture", "lens_pillars.gds", "0.png", "--no-forecast"], &SEEN[..]].concat();
    bench.said(&[&picture[..], &["--out", "p"]].concat(), 0);
    bench.list("picture", "0.png", &bench.digest("0.png"));
    refused(&[&picture[..], &["--out", "."]].concat(), "0.png");
    bench.list("restored", "p/frame.png", &bench.digest("p/frame.png"));
    let restore = [
        "restore",
        "lens_pillars.gds",
        "p/frame.png",
        "--pixels",
        "64",
        "--out",
        "p",
    ];
    refused(&[&restore, &SEEN[..]].concat(), "p/frame.png");
    bench.list("compare", "0.png", &bench.digest("0.png"));
    let compare = [
        "compare",
        "0.png",
        "--camera",
        "camera.toml",
        "--field-deg",
        "20",
        "--out",
        ".",
    ];
    refused(
        &[&compare[..], &["--design", "lens.toml:lens_pillars.gds"]].concat(),
        "0.png",
    );
    let frame = "000000-000999/000000.frame.png";
    fs::create_dir(bench.at("000000-000999")).unwrap();
    photograph(&bench.at(frame));
    for plan in [&[][..], &["--plan"]] {
        let dataset = ["dataset", "000000-000999", "--layout", "lens_pillars.gds", "--out", "."];
        refused(&[&dataset, &SEEN[..], plan].concat(), frame);
    }
}

/// Each command that reads a file of a result, with the list of another result beside it.
#[test]
fn a_file_beside_those_of_another_run_is_named() {
    let bench = Bench::new();
    let other = "0".repeat(64);
    let refused = |words: &[&str], file: &str| {
        let told = bench.run(words).code(2);
        told.stderr(contains(refusal("file/altered")).and(contains(file)));
    };
    for (set, file) in [
        ("calibration", "made/model.toml"),
        ("calibration", "made/proposal.toml"),
        ("picture", "made/frame.png"),
        ("cells", "made/mapping_exact.csv"),
    ] {
        fs::create_dir_all(bench.at("made")).unwrap();
        fs::write(bench.at(file), "").unwrap();
        bench.list(&format!("{set}_{}", file.len()), file, &other);
    }
    let model = "made/model.toml";
    let light = ["--layer", "1/0", "--wavelength-nm", "660", "--distance-um", "48"];
    let with_model: [&[&str]; 8] = [
        &["layout", "lens.toml", "--compensate", model],
        &["run", "lens.toml", "--model", model],
        &["verify", "lens.toml", "lens_pillars.gds", "--model", model],
        &[
            "check",
            "lens_pillars.gds",
            "--design",
            "lens.toml",
            "--compensated",
            model,
        ],
        &["handoff", "lens.toml", "--compensate", model],
        &["handoff", "lens.toml", "--dose-classes", model],
        &[&["psf", "lens_pillars.gds", "--model", model], &light[..]].concat(),
        &[&["picture", "lens_pillars.gds", "0.png", "--model", model], &SEEN[..]].concat(),
    ];
    with_model.iter().for_each(|words| refused(words, "model.toml"));
    let frames = [
        "dataset",
        ".",
        "--layout",
        "lens_pillars.gds",
        "--out",
        "pairs",
        "--model",
        model,
    ];
    refused(&[&frames, &SEEN[..]].concat(), "model.toml");
    let frame = ["restore", "lens_pillars.gds", "made/frame.png"];
    refused(&[&frame, &SEEN[..]].concat(), "frame.png");
    let set = root().join("golden/session");
    let declare = [
        "calibrate",
        set.to_str().unwrap(),
        "--out",
        "out",
        "--declare",
        "made/proposal.toml",
    ];
    refused(&declare, "proposal.toml");
    let text = fs::read_to_string(bench.at("lens.toml")).unwrap();
    let (before, rest) = text.split_once("basis = ").unwrap();
    let after = rest.split_once("[layout]").unwrap().1;
    fs::write(
        bench.at("mapped.toml"),
        format!("{before}table = \"made/mapping_exact.csv\"\n[layout]{after}"),
    )
    .unwrap();
    for command in ["layout", "run", "handoff", "cells", "optimise"] {
        refused(&[command, "mapped.toml"], "mapping_exact.csv");
    }
}

/// What a killed run has begun, in the forms that files under way have, of this input and of one with more images.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn what_killed_runs_began_is_removed_by_the_next() {
    let bench = Bench::new();
    let commands: [(&str, Vec<&str>); 4] = [
        ("layout", vec!["layout", "lens.toml"]),
        (
            "verify",
            vec![
                "verify",
                "lens.toml",
                "lens_pillars.gds",
                "--fast",
                "--fidelity",
                "published",
            ],
        ),
        (
            "picture",
            [&["picture", "lens_pillars.gds", "0.png", "--no-forecast"], &SEEN[..]].concat(),
        ),
        (
            "dataset",
            [&["dataset", "images", "--layout", "lens_pillars.gds"], &SEEN[..]].concat(),
        ),
    ];
    fs::create_dir(bench.at("images")).unwrap();
    photograph(&bench.at("images/0.png"));
    for (out, words) in commands {
        let words = [&words[..], &["--out", out]].concat();
        bench.said(&words, 0);
        let clean = bench.names(out);
        let begun = format!("{out}/.{out}.there-1-0.unfinished");
        fs::create_dir(bench.at(&begun)).unwrap();
        fs::write(bench.at(&begun).join("report.html"), "half").unwrap();
        if out == "dataset" {
            for left in ["000000.frame", "000000.truth", "000007.frame", "000007.truth"] {
                let left = format!("{out}/000000-000999/.{left}.png.part");
                fs::write(bench.at(&left), "half").unwrap();
            }
        }
        bench.said(&words, 0);
        assert_eq!(bench.names(out), clean, "{out}");
    }
    // A file that a living run writes stays, and so does what no run makes.
    let kept = ["000007.frame.png.part", "notes.part"].map(|name| format!("dataset/000000-000999/.{name}"));
    kept.iter().for_each(|name| fs::write(bench.at(name), "mine").unwrap());
    let living = fs::File::options().write(true).open(bench.at(&kept[0])).unwrap();
    living.lock().unwrap();
    let dataset = ["dataset", "images", "--layout", "lens_pillars.gds", "--out", "dataset"];
    bench.said(&[&dataset, &SEEN[..]].concat(), 0);
    assert!(kept.iter().all(|name| bench.at(name).exists()));
}
