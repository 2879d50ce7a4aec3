//! Files that the program itself wrote: manifests, checkpoints, weights.

use std::fs;
use std::path::Path;

use metalith::handoff::{Manifest, ManifestEntry, verify_handoff};
use metalith::optimise::Checkpoint;
use metalith::{Design, Silent};
use metalith_testing::design;

use super::{Format, Kind};

/// Files that the program itself wrote: manifests, checkpoints, weights.
pub(super) fn all(folder: &Path) -> Vec<Format> {
    let handed = folder.join("handoff");
    fs::create_dir_all(&handed).unwrap();
    fs::write(handed.join("README.txt"), "a chip\n").unwrap();
    let digest = "0".repeat(64);
    let entry = ManifestEntry {
        bytes: 7,
        sha256: digest.clone(),
    };
    let manifest = Manifest {
        metalith: "0.1.0".into(),
        command: "metalith handoff".into(),
        design: "chip".into(),
        design_digest: digest.clone(),
        process: "writer".into(),
        files: [("README.txt".to_owned(), entry)].into(),
        seal: digest,
    };
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let checkpoint = folder.join("checkpoint.bin");
    Checkpoint::begin(&mini).save(&checkpoint).unwrap();
    let saved = fs::read(&checkpoint).unwrap();
    vec![
        Format::new(
            "manifest",
            handed.join("manifest.json"),
            Kind::Text,
            vec![serde_json::to_vec_pretty(&manifest).unwrap()],
            move |_| verify_handoff(&handed, &Silent),
        ),
        Format::new("checkpoint", checkpoint, Kind::Sealed, vec![saved], move |path| {
            Checkpoint::load(path, &mini)
        }),
    ]
}
