//! `metalith cells`.

use std::fs;

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn the_command_reports_on_a_cell_and_reuses_its_library() {
    let folder = tempfile::tempdir().unwrap();
    // Three orders and a tenth in t: wrong by far, but all of the way from the design to the report.
    let run = || {
        let mut command = super::metalith();
        command
            .args(["cells", "designs/mini_3x3.toml", "--orders", "3", "--tolerance", "0.1"])
            .arg("--cache")
            .arg(folder.path().join("cache"))
            .arg("--out")
            .arg(folder.path().join("out"));
        let output = command.assert().success().get_output().stdout.clone();
        String::from_utf8(output).unwrap()
    };
    let first = run();
    assert!(
        first.contains("cells solved)") && first.contains("most light"),
        "{first}"
    );
    let files = [
        "cells.html",
        "cells.json",
        "mapping_exact.csv",
        "mapping_most_light.csv",
    ];
    let read = || files.map(|f| fs::read(folder.path().join("out").join(f)).unwrap());
    let before = read();
    let second = run();
    assert!(second.contains("(kept)"), "{second}");
    assert!(before == read(), "the same library gives the same bytes");
    let json: serde_json::Value = serde_json::from_slice(&before[1]).unwrap();
    assert!(json.to_string().contains("round_trip"));
    let page = String::from_utf8_lossy(&before[0]).into_owned();
    assert!(page.contains("Widths to avoid") && !page.contains("NaN"));
}

/// The shipped library of upright rectangles is what the command makes of its design, to the byte.
#[test]
fn the_library_of_upright_rectangles_is_made_of_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let root = metalith_testing::root();
    // As for a new design: nothing is there yet.
    let text = fs::read_to_string(root.join("designs/birefringent_532.toml")).unwrap();
    let design = folder.path().join("new.toml");
    fs::write(&design, text.replacen("phases/birefringent_532.csv", "library.csv", 1)).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = super::metalith();
        command
            .arg(arguments[0])
            .arg(&design)
            .args(&arguments[1..])
            .output()
            .unwrap()
    };
    let before = run(&["layout"]);
    let said = String::from_utf8_lossy(&before.stderr).into_owned();
    assert_eq!(before.status.code(), Some(2));
    assert!(said.contains("mapping.library/no-file"), "{said}");
    let out = folder.path().to_str().unwrap();
    let made = run(&["cells", "--out", out]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let printed = String::from_utf8_lossy(&made.stdout).into_owned();
    assert!(
        printed.contains("sizes are the nearest to some pair of phases"),
        "{printed}"
    );
    let [library, shipped] = [
        folder.path().join("library.csv"),
        root.join("designs/phases/birefringent_532.csv"),
    ];
    assert!(fs::read(library).unwrap() == fs::read(shipped).unwrap());
    let page = fs::read_to_string(folder.path().join("cells.html")).unwrap();
    assert!(page.contains("Phases that pillars have") && !page.contains("NaN"));
    // Now it is where the design says.
    assert_eq!(run(&["layout", "--out", out]).status.code(), Some(0));
}
