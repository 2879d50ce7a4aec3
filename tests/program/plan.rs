//! `metalith plan`: what is refused before anything is simulated.

use metalith_testing::session;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;

use super::refusal;

fn plan(bench: &str, more: &[&str]) -> assert_cmd::assert::Assert {
    plan_of("designs/mini_3x3.toml", bench, more)
}

fn plan_of(design: &str, bench: &str, more: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = super::metalith();
    command.args(["plan", design, "--bench", bench]).args(more);
    command.assert()
}

#[test]
fn faults_of_the_bench_are_named_and_frames_are_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let bench = path("bench.toml");
    std::fs::write(&bench, "schema = 1\n[captures]\npeak = 3.0\n").unwrap();
    let told = plan(&bench, &["--out", &path("out")]).code(2);
    told.stderr(contains("captures.peak/out-of-range").and(contains("camera/missing")));
    std::fs::write(&bench, format!("schema = 1\n{}\n[captures]\n", session::bench())).unwrap();
    plan(&bench, &["--out", &path("out"), "--effects", "cd_bais"])
        .code(2)
        .stderr(contains(refusal("effects/unknown")).and(contains("`cd_bias`")));
    std::fs::create_dir_all(folder.path().join("begun/captures")).unwrap();
    std::fs::write(folder.path().join("begun/captures/a.npy"), b"").unwrap();
    plan(&bench, &["--out", &path("begun")])
        .code(2)
        .stderr(contains(refusal("plan/folder-in-use")));
}

/// A lens of 10 mm is more than a set can say; its layout of 641 million pillars is not written first.
#[test]
fn what_no_set_can_say_is_refused_before_a_layout_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let bench = path("bench.toml");
    let text = format!("schema = 1\n{}\n[captures]\n", session::bench());
    std::fs::write(&bench, &text).unwrap();
    plan_of("designs/lens_10mm.toml", &bench, &["--out", &path("out")])
        .code(2)
        .stderr(contains(refusal("plan/out-of-range")).and(contains("10000 um")));
    assert!(!folder.path().join("out").exists());
    std::fs::write(&bench, format!("{text}[wanted]\nfilm_height = 710\n")).unwrap();
    plan(&bench, &["--out", &path("out")])
        .code(2)
        .stderr(contains(refusal("plan/size-out-of-range")));
}
