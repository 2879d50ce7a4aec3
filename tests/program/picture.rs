//! `metalith picture`: bad input is one clear error each, before any simulation.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use predicates::str::contains;

const DESIGN: &str = "designs/mini_3x3.toml";

fn picture(arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("metalith").unwrap();
    command
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
        .args(["picture", "golden/mini_3x3/folded.gds.gz", "star", "--design", DESIGN])
        .args(arguments);
    command
}

#[test]
fn what_cannot_be_pictured_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plain = fs::read_to_string("cameras/gt1930.toml").unwrap();
    let write = |name: &str, from: &str, to: &str| {
        for curve in ["red", "green", "blue"] {
            let file = format!("bayer_{curve}.csv");
            fs::copy(Path::new("cameras").join(&file), folder.path().join(&file)).unwrap();
        }
        let path = folder.path().join(name);
        let text = plain.replace(from, to);
        assert_ne!(text, plain);
        fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let beside = write("beside.toml", "offset_um = [0, 0] ", "offset_um = [9000, 0] ");
    let dark = write(
        "dark.toml",
        "source = \"d65\"",
        "source = \"leds\"\n[[illuminant.led]]\ncentre_nm = 900\nwidth_nm = 5",
    );
    let gt = "cameras/gt1930.toml";
    let cases: [(&[&str], &str); 7] = [
        (&["--camera", &beside], "does not see the chip"),
        (&["--camera", &dark], "counts n"),
        (&["--camera", gt, "--field-deg", "150"], "wider than the array"),
        (&["--camera", gt, "--method", "magic"], "no way to restore"),
        (&["--camera", gt, "--distance-mm", "0"], "positive"),
        (&["--camera", gt, "--field-deg", "NaN"], "field"),
        (&["--camera", "cameras/none.toml"], "cannot read"),
    ];
    for (arguments, words) in cases {
        let out = folder.path().join("out").display().to_string();
        picture(arguments)
            .args(["--out", &out])
            .assert()
            .code(2)
            .stderr(contains(words));
        assert!(!Path::new(&out).exists(), "nothing is left of {arguments:?}");
    }
}
