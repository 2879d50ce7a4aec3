//! `metalith cells`.

use std::fs;

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn the_command_reports_on_a_cell_and_reuses_its_library() {
    let folder = tempfile::tempdir().unwrap();
    // Three orders and a tenth in t: wrong by far, but all of the way from the design to the report.
    let run = || {
        let mut command = assert_cmd::Command::cargo_bin("metalith").unwrap();
        command
            .current_dir(metalith_testing::root())
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
    assert!(page.contains("Widths to stay away from") && !page.contains("NaN"));
}
