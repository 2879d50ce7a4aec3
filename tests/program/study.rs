//! `metalith study`: shards by processes, and what is said of them.

use std::path::Path;

use assert_cmd::Command;

use super::refusal;

fn metalith(arguments: &[&str]) -> Command {
    let mut command = super::metalith();
    command.args(arguments);
    command
}

/// The tolerance of `.ci/run`, for a single small lens.
fn tolerance(folder: &Path) {
    let design = std::fs::read_to_string("designs/mini_3x3.toml").unwrap();
    let design = design
        .replace("diameter_um = 60", "diameter_um = 20")
        .replace("elements = [3, 3]", "elements = [1, 1]")
        .replace("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [530]");
    std::fs::write(folder.join("design.toml"), design).unwrap();
    let text = std::fs::read_to_string("scripts/study/tolerance.toml").unwrap();
    std::fs::write(folder.join("tolerance.toml"), text.replace("DESIGN", "design.toml")).unwrap();
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn shards_by_processes_are_those_of_one_process() {
    let folder = tempfile::tempdir().unwrap();
    tolerance(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, by_two, alone) = (path("tolerance.toml"), path("by_two"), path("alone"));
    metalith(&["study", "plan", &file, "--out", &by_two, "--draws-per-shard", "2"])
        .assert()
        .code(0);
    metalith(&["study", "plan", &file, "--out", &alone]).assert().code(0);
    metalith(&["study", "merge", &by_two])
        .assert()
        .code(2)
        .stderr(predicates::str::contains(format!(
            "{}6 of 6 ",
            refusal("study/draws-missing")
        )));
    metalith(&["study", "run", &by_two, "--missing", "--jobs", "2"])
        .assert()
        .code(0);
    metalith(&["study", "run", &by_two, "--shard", "1"]).assert().code(0);
    metalith(&["study", "run", &by_two, "--shard", "3"])
        .assert()
        .code(2)
        .stderr(predicates::str::contains(refusal("study/unknown-shard")));
    metalith(&["study", "run", &alone, "--missing", "--threads", "1"])
        .assert()
        .code(0);
    let said = metalith(&["study", "status", &by_two, "--json"])
        .output()
        .unwrap()
        .stdout;
    let said: serde_json::Value = serde_json::from_slice(&said).unwrap();
    assert_eq!(
        (said["finished"].as_u64(), said["missing"].as_array().unwrap().len()),
        (Some(3), 0)
    );
    let draws = |study: &str| {
        let out = path(&format!(
            "{}.jsonl",
            Path::new(study).file_name().unwrap().to_str().unwrap()
        ));
        metalith(&["study", "merge", study, "--out", &out, "--psfs", "0"])
            .assert()
            .code(0);
        std::fs::read_to_string(out).unwrap()
    };
    assert_eq!(draws(&by_two), draws(&alone));
    let slurm = path("slurm.toml");
    std::fs::write(&slurm, "max_array_size = 2\n").unwrap();
    metalith(&["study", "submit", &by_two, "--slurm", &slurm, "--dry-run"])
        .assert()
        .code(0)
        .stdout(predicates::str::contains("nothing is missing"));
}
