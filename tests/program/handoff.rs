//! `metalith handoff`: what it makes without a process file, and what it says of a received folder.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::handoff::Manifest;
use metalith_testing::design;

/// Hand-off of the small design, made in a folder that has nothing else.
fn made(folder: &Path) -> PathBuf {
    let mut program = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
    program.current_dir(folder).arg("handoff").arg(design("mini_3x3"));
    program.args(["--out", "made", "--fast", "--fidelity", "published"]);
    program.assert().code(0);
    folder.join("made")
}

#[test]
fn the_program_says_so_by_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let received = made(folder.path());
    let verify = || {
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
        command.args(["handoff", "--verify"]).arg(&received);
        command.assert()
    };
    verify()
        .code(0)
        .stdout(predicates::str::contains("whole and unaltered"));
    fs::write(received.join("tone.svg"), "<svg/>").unwrap();
    verify().code(1).stdout(predicates::str::contains("altered: tone.svg"));
    fs::remove_file(received.join("manifest.json")).unwrap();
    let gone = format!(
        "{}cannot read {}",
        super::refusal("file/operation-failed"),
        received.display()
    );
    verify().code(2).stderr(predicates::str::contains(gone));
}

/// Without a process file, from a folder that has none: the shipped one, and the shipped decks of rules.
#[test]
fn the_program_brings_its_own_process() {
    let folder = tempfile::tempdir().unwrap();
    let made = made(folder.path());
    let manifest: Manifest = serde_json::from_slice(&fs::read(made.join("manifest.json")).unwrap()).unwrap();
    let shipped = metalith_testing::root().join("processes/jbx6300_zep520a.toml");
    let name = "inputs/process_jbx6300_zep520a.toml";
    assert!(manifest.files.contains_key(name));
    assert_eq!(fs::read(made.join(name)).unwrap(), fs::read(shipped).unwrap());
    for deck in [
        "sin_pillars",
        "sin_apertures",
        "dose_matrix",
        "test_structures",
        "test_openings",
    ] {
        let name = format!("inputs/rules_{deck}.toml");
        assert!(manifest.files.contains_key(&name), "{name}");
        let shipped = metalith_testing::root().join(format!("rules/{deck}.toml"));
        assert_eq!(
            fs::read(made.join(&name)).unwrap(),
            fs::read(shipped).unwrap(),
            "{name}"
        );
    }
}
