//! Every command that reads a layout says of one in OASIS what it says of the same in GDSII.

use std::fs;
use std::path::Path;

use metalith::Silent;
use metalith::extract::PillarsAt;
use metalith::layout::{LayoutFormat, convert};
use metalith_testing::{design, session::small_set};
use serde_json::Value;

const FORMATS: [&str; 2] = ["gds", "oas"];

fn run(args: &[&str], folder: &Path) -> (Option<i32>, String) {
    let output = super::metalith().args(args).current_dir(folder).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(!said.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    (output.status.code(), said)
}

fn json(args: &[&str], folder: &Path) -> (Option<i32>, Value) {
    let (code, said) = run(args, folder);
    (code, serde_json::from_str(&said).unwrap())
}

#[test]
fn commands_read_oasis_as_gdsii() {
    let folder = tempfile::tempdir().unwrap();
    let mini = design("mini_3x3");
    let mini = mini.to_str().unwrap();
    for format in ["gds", "oasis"] {
        run(&["layout", mini, "--format", format, "--out", "."], folder.path());
    }
    let layouts = FORMATS.map(|format| format!("mini_3x3_pillars.{format}"));
    let both = |args: &[&str]| {
        layouts.each_ref().map(|layout| {
            let args: Vec<&str> = args.iter().map(|a| if *a == "LAYOUT" { layout } else { *a }).collect();
            json(&args, folder.path())
        })
    };
    // Every pillar compared and nothing simulated, which would take seconds.
    let [gds, oasis] = both(&[
        "verify",
        mini,
        "LAYOUT",
        "--memory-mb",
        "1",
        "--json",
        "--out",
        "verified",
    ]);
    assert_eq!(gds.0, oasis.0);
    for part in ["elements", "foreign", "checks"] {
        assert!(!gds.1[part].is_null() && gds.1[part] == oasis.1[part], "verify: {part}");
    }
    assert_eq!(gds.1["layout"]["survey"], oasis.1["layout"]["survey"]);

    let [gds, oasis] = both(&[
        "psf",
        "LAYOUT",
        "--fidelity",
        "published",
        "--distance-um",
        "144",
        "--wavelength-nm",
        "550",
        "--json",
        "--out",
        "psf",
    ]);
    assert_eq!(gds.0, oasis.0);
    for part in ["elements", "psfs"] {
        assert!(!gds.1[part].is_null() && gds.1[part] == oasis.1[part], "psf: {part}");
    }

    let [gds, oasis] = both(&["check", "LAYOUT", "--design", mini, "--json"]);
    assert_eq!(gds.0, Some(0));
    let rules = |found: &Value| {
        let outcome = |rule: &Value| [rule["id"].clone(), rule["status"].clone(), rule["violations"].clone()];
        let rules = found["rules"].as_array().unwrap();
        rules.iter().map(outcome).collect::<Vec<_>>()
    };
    assert!(rules(&gds.1).len() > 40);
    assert_eq!(rules(&gds.1), rules(&oasis.1));

    let (code, found) = json(&["diff", &layouts[0], &layouts[1], "--json"], folder.path());
    assert!(code == Some(0) && found["same_geometry"] == true, "{found}");
}

/// A measured set whose layout is in the other format is the same set.
#[test]
fn a_measured_set_takes_oasis() {
    let folder = tempfile::tempdir().unwrap();
    let path = small_set(folder.path());
    let read = || metalith::calibrate::MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
    let from_gds = read();
    let text = fs::read_to_string(&path).unwrap();
    let line = text.lines().find(|line| line.starts_with("layout = ")).unwrap();
    let name = line.split('"').nth(1).unwrap();
    let oasis = LayoutFormat::of_name(Path::new("layout.oas"));
    let gds = metalith::Layout::open(&folder.path().join(name)).unwrap();
    convert(&gds, oasis, &folder.path().join("layout.oas"), &Silent).unwrap();
    fs::remove_file(folder.path().join(name)).unwrap();
    fs::write(&path, text.replace(line, "layout = \"layout.oas\"")).unwrap();
    let from_oasis = read();
    assert!(from_gds.elements.iter().all(|e| e.pillars.pillars() > 0));
    let pillars =
        |set: &metalith::calibrate::MeasuredSet| set.elements.iter().map(|e| e.pillars.clone()).collect::<Vec<_>>();
    assert!(pillars(&from_gds) == pillars(&from_oasis));
}
