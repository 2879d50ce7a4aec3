//! Names and texts that a stranger chose.

use std::path::Path;

use metalith_testing::lens::Chip;
use serde_json::Value;

use super::metalith;

/// Name with a line break before a forged verdict, a colour and a change of direction.
const FORGED: &str = "x\nerror[none]: PASS\u{1b}[32m\u{202e}.gds";

#[test]
fn no_name_begins_a_line_or_changes_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(FORGED);
    std::fs::write(&path, "no layout").unwrap();
    let path = path.to_str().unwrap();
    let commands: [&[&str]; 14] = [
        &["layout", path],
        &["run", path],
        &["verify", path, "--design", path],
        &["check", path],
        &["diff", path, path],
        &["info", path],
        &["convert", path, path],
        &["psf", path],
        &["handoff", path],
        &["handoff", "--verify", path],
        &["calibrate", path],
        &["denoise", path, "--noise", "5"],
        &["study", "status", path],
        &[path],
    ];
    for command in commands {
        let run = metalith().args(command).current_dir(folder.path()).output().unwrap();
        assert_ne!(run.status.code(), Some(0), "{command:?}");
        for said in [run.stdout, run.stderr] {
            let said = String::from_utf8(said).unwrap();
            assert!(!said.lines().any(|line| line.starts_with("error[none]")), "{said}");
            assert!(!said.contains(['\u{1b}', '\u{202e}']), "{said:?}");
        }
    }
}

#[test]
fn every_label_is_judged_however_many_there_are() {
    const LABELS: u32 = 150_000;
    let folder = tempfile::tempdir().unwrap();
    let labelled = |layer: i16| {
        let mut chip = Chip::clean();
        for k in 0..LABELS as i32 {
            chip.extra.text(layer, "t", k % 400 * 1000, k / 400 * 1000);
        }
        let path = folder.path().join(format!("{layer}.gds"));
        std::fs::write(&path, chip.bytes()).unwrap();
        path
    };
    let [beside, exposed] = [11, 1].map(labelled);
    let rules = Path::new(env!("CARGO_MANIFEST_DIR")).join("rules/sin_pillars.toml");
    let judged = |layout: &Path, code: i32| -> u64 {
        let mut check = metalith();
        check.arg("check").arg(layout).arg("--json").arg("--rules").arg(&rules);
        let report: Value = serde_json::from_slice(&check.assert().code(code).get_output().stdout).unwrap();
        let found = report["rules"].as_array().unwrap();
        let rule = found.iter().find(|rule| rule["id"] == "layer.text").unwrap();
        rule["violations"].as_u64().unwrap()
    };
    assert_eq!([judged(&beside, 0), judged(&exposed, 1)], [0, LABELS.into()]);
    metalith().arg("diff").args([&exposed, &exposed]).assert().code(0);
    metalith().arg("diff").args([&beside, &exposed]).assert().code(1);
}
