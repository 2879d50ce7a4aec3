//! `metalith train`: what cannot be learnt is refused before any work, and a stop loses nothing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::assert::OutputAssertExt;
use predicates::str::contains;

use super::refusal;

/// A folder with three small photographs.
fn photographs(folder: &Path) -> PathBuf {
    let at = folder.join("photographs");
    for k in 0..3 {
        let stripes = ndarray::Array3::from_shape_fn((56, 56, 3), |(y, x, c)| ((x + k * y + c) % 9) as f64 / 9.0);
        metalith::imaging::write_picture(&at.join(format!("{k}.png")), &stripes).unwrap();
    }
    at
}

fn train(photographs: &Path, out: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_metalith"));
    command
        .arg("train")
        .arg(photographs)
        .args(arguments)
        .arg("--out")
        .arg(out);
    command
}

#[test]
fn what_cannot_be_learnt_is_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let photographs = photographs(folder.path());
    let out = folder.path().join("out.safetensors");
    let stage = [
        "--stage",
        "flatnet",
        "--camera",
        "cameras/gt1930.toml",
        "--pixels",
        "48",
    ];
    let odd = [&stage[..], &["--piece", "36"]].concat();
    let cases: [(&[&str], &str); 3] = [
        (&odd, "train/piece-out-of-range"),
        (&stage, "train/too-few-photographs"),
        (&["--piece", "32", "--batch", "0"], "train/steps-out-of-range"),
    ];
    for (arguments, id) in cases {
        train(&photographs, &out, arguments)
            .assert()
            .code(2)
            .stderr(contains(refusal(id)));
        // Nothing was taken by a camera.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{arguments:?}");
    }
    train(&photographs, folder.path(), &["--piece", "32"])
        .assert()
        .code(2)
        .stderr(contains(refusal("file/is-a-folder")));
}

/// A second signal that follows at once, as those of shells and of `timeout` do, is the same wish: the state is written.
#[cfg(target_os = "linux")]
#[test]
fn two_signals_of_one_press_lose_nothing() {
    use std::process::Stdio;
    /// Of CPU time, a hundredth of a second each: well within the first steps.
    const WORKED_TICKS: u64 = 60;
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.safetensors");
    // Steps of a third of a second: both signals come within one.
    let arguments = ["--piece", "48", "--batch", "20", "--threads", "1"];
    let mut child = train(&photographs(folder.path()), &out, &arguments)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let stat = Path::new("/proc").join(child.id().to_string()).join("stat");
    let worked = || -> u64 {
        let text = fs::read_to_string(&stat).unwrap();
        let fields = text[text.rfind(')').unwrap()..].split(' ').skip(12);
        fields.take(2).map(|ticks| ticks.parse::<u64>().unwrap()).sum()
    };
    while worked() < WORKED_TICKS {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let twice = "kill -INT \"$1\"; sleep 0.03; kill -INT \"$1\"";
    let sent = Command::new("sh")
        .args(["-c", twice, "sh", &child.id().to_string()])
        .status();
    assert!(sent.is_ok());
    assert_eq!(child.wait().unwrap().code(), Some(3));
    assert!(folder.path().join("out.safetensors.state").exists());
}
