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

/// Pillars that are no squares are judged by rules of squares where nothing else is named, and the rules of their own are told.
#[test]
fn pillars_that_are_no_squares_are_told_with_their_rules() {
    let folder = tempfile::tempdir().unwrap();
    let design = metalith_testing::design("geometric_phase_532");
    let text = std::fs::read_to_string(&design).unwrap();
    let name = text.lines().find_map(|l| l.strip_prefix("name = \"")).unwrap();
    let out = folder.path().join("out");
    let program = |args: &[&std::ffi::OsStr]| {
        let mut program = assert_cmd::Command::new(env!("CARGO_BIN_EXE_metalith"));
        let output = program.args(args).output().unwrap();
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    program(&["layout".as_ref(), design.as_ref(), "--out".as_ref(), out.as_ref()]);
    let layout = out.join(format!("{}_pillars.gds", name.trim_end_matches('"')));
    assert!(layout.exists(), "{}", layout.display());
    let rules = Path::new(env!("CARGO_MANIFEST_DIR")).join("rules/rectangles.toml");
    const TOLD: &str = "--rules rules/rectangles.toml";
    let said = program(&["check".as_ref(), layout.as_ref()]);
    assert!(said.contains(TOLD), "{said}");
    for own in [
        ["--rules".as_ref(), rules.as_os_str()],
        ["--design".as_ref(), design.as_os_str()],
    ] {
        let said = program(&["check".as_ref(), layout.as_ref(), own[0], own[1]]);
        assert!(!said.contains(TOLD), "{said}");
    }
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
