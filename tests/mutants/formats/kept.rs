//! Files that the program itself wrote: manifests, checkpoints, weights.

use std::fs;
use std::path::Path;

use metalith::file::{check_unaltered, settled};
use metalith::handoff::{Manifest, ManifestEntry, verify_handoff};
use metalith::optimise::Checkpoint;
use metalith::{Design, FolderLock, Silent};
use metalith_testing::design;

use super::{Format, Kind};

/// Files that the program itself wrote: lists of results, manifests, checkpoints.
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
    let [listed, decided] = results(folder);
    vec![
        listed,
        decided,
        Format::new(
            "manifest",
            handed.join("manifest.json"),
            Kind::Json,
            vec![serde_json::to_vec_pretty(&manifest).unwrap()],
            move |_| verify_handoff(&handed, &Silent),
        ),
        Format::new("checkpoint", checkpoint, Kind::Sealed, vec![saved], move |path| {
            Checkpoint::load(path, &mini)
        }),
    ]
}

/// Lists of the files of a result, in their places and on the way there: no list makes a reader or the next run touch another file.
fn results(folder: &Path) -> [Format; 2] {
    /// Files of the result that was there, of a new one, and of somebody else.
    const OLD: &[u8] = b"old";
    const NEW: &[u8] = b"new";
    const OTHER: &[u8] = b"precious";
    let home = folder.join("results");
    let result = home.join("result");
    fs::create_dir_all(&result).unwrap();
    let turn = FolderLock::wait(&result, &Silent, || ()).unwrap();
    let write = |into: &Path| {
        for name in ["a.txt", "b.txt"] {
            fs::write(into.join(name), OLD).unwrap();
        }
        Ok(())
    };
    turn.publish("set", &["stale.txt"], write).unwrap();
    drop(turn);
    let list = fs::read(result.join(".set.sha256")).unwrap();
    let stays = |home: &Path| {
        for other in ["other.txt", "result/other.txt"] {
            assert_eq!(fs::read(home.join(other)).unwrap(), OTHER, "{other}");
        }
    };
    for other in ["other.txt", "result/other.txt"] {
        fs::write(home.join(other), OTHER).unwrap();
    }
    let listed = {
        let (home, file) = (home.clone(), result.join("a.txt"));
        move |_: &Path| {
            let checked = check_unaltered(&file);
            stays(&home);
            checked
        }
    };
    let decided = move |list: &Path| {
        let (result, decided) = (home.join("result"), home.join("result/.set.publish"));
        fs::create_dir_all(&decided).unwrap();
        for name in ["a.txt", "c.txt"] {
            fs::write(decided.join(name), NEW).unwrap();
        }
        fs::copy(list, decided.join(".set.sha256")).unwrap();
        let done = settled(&result.join("a.txt"), &Silent);
        stays(&home);
        // What the list does not name stays where it is, and is no part of the next.
        let _ = fs::remove_dir_all(decided);
        done
    };
    let words = String::from_utf8(list.clone()).unwrap().replace("b.txt", "c.txt");
    [
        Format::new(
            "list of a result",
            result.join(".set.sha256"),
            Kind::Text,
            vec![list],
            listed,
        ),
        Format::new(
            "list of a result on its way",
            folder.join("list.sha256"),
            Kind::Text,
            vec![words.into_bytes()],
            decided,
        ),
    ]
}
