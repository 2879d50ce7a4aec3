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
    let printed = |args: &[&str], code: i32| run(args).code(code).get_output().stdout.clone();
    let piped = String::from_utf8(printed(&["check", "-"], 1)).unwrap();
    assert!(
        piped.contains("standard input: 14409 shapes") && piped.contains("1 violations"),
        "{piped}"
    );
    printed(&["diff", "-", "broken.gds"], 0);
    // It ends where it has been read once.
    printed(&["diff", "-", "-"], 2);
    printed(&["check", "broken.gds", "--junit", "broken.xml"], 1);
    let file = std::fs::read_to_string(folder.path().join("broken.xml")).unwrap();
    let junit = printed(&["check", "broken.gds", "--junit", "-"], 1);
    assert_eq!(String::from_utf8(junit).unwrap().trim_end(), file.trim_end());
    printed(&["check", "broken.gds", "--junit", "-", "--json"], 2);
    assert!(!folder.path().join("-").exists());
}
