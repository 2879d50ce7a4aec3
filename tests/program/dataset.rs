//! `metalith dataset`: images and folders that cannot be used are named before any work.

use std::fs;
use std::path::Path;

use predicates::prelude::*;
use predicates::str::contains;

use super::refusal;

fn dataset(images: &Path, out: &Path, more: &[&str]) -> assert_cmd::assert::Assert {
    super::metalith()
        .args(["dataset", "--layout", "golden/mini_3x3/folded.gds.gz"])
        .args(["--design", "designs/mini_3x3.toml", "--camera", "cameras/gt1930.toml"])
        .arg(images)
        .arg("--out")
        .arg(out)
        .args(more)
        .assert()
}

#[test]
fn bad_images_and_planned_folders_are_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let (images, out) = (folder.path().join("images"), folder.path().join("out"));
    for (name, rows) in [("a.png", 48), ("b.png", 48), ("c.png", 64)] {
        let grey = ndarray::Array3::from_elem((rows, 64, 3), 0.5);
        metalith::imaging::write_picture(&images.join(name), &grey).unwrap();
    }
    fs::write(images.join("d.png"), "no picture").unwrap();
    let ways: [&[&str]; 2] = [&[], &["--plan"]];
    for plan in ways {
        dataset(&images, &out, plan).code(2).stderr(
            contains(refusal("scene/images-unusable"))
                .and(contains("c.png: "))
                .and(contains("64 x 64"))
                .and(contains("d.png: ")),
        );
        let kept = ["kernels", "plan.json", "manifest.json", "000000-000999"];
        assert!(kept.iter().all(|name| !out.join(name).exists()));
    }
    for bad in ["c.png", "d.png"] {
        fs::remove_file(images.join(bad)).unwrap();
    }
    fs::create_dir_all(&out).unwrap();
    fs::write(out.join("plan.json"), "{}").unwrap();
    dataset(&images, &out, &[])
        .code(2)
        .stderr(contains(refusal("dataset/folder-holds-plan")));
}
