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
