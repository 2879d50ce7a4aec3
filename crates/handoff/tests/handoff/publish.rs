//! Folder and archive appear together, whole or not at all.

use std::fs;
use std::path::Path;

use metalith_core::{Progress, Silent};
use metalith_handoff::{handoff, verify_handoff};

use crate::{options, unpack};

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = names.map(|n| n.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The folder is complete, and the archive holds its bytes.
fn assert_whole(out: &Path) {
    let found = verify_handoff(out, &Silent).unwrap();
    assert!(found.holds() && found.manifest.files.len() > 30);
    let unpacked = unpack(&fs::read(out.with_extension("zip")).unwrap());
    assert_eq!(unpacked.len(), found.manifest.files.len() + 1);
    for (name, bytes) in unpacked {
        let (_, name) = name.split_once('/').unwrap();
        assert_eq!(bytes, fs::read(out.join(name)).unwrap(), "{name}");
    }
}

/// Does something to the folder, once, when a piece of work begins.
struct AtWork<F: Fn() + Sync>(&'static str, F);

impl<F: Fn() + Sync> Progress for AtWork<F> {
    fn begin(&self, what: &str, _: u64) {
        if what == self.0 {
            (self.1)();
        }
    }

    fn advance(&self, _: u64) {}
}

#[test]
fn what_others_do_in_the_meantime_is_seen() {
    let parent = tempfile::tempdir().unwrap();
    let out = parent.path().join("kit");
    handoff(&options(&out), &Silent).unwrap();
    let first = fs::read(out.join("manifest.json")).unwrap();
    // A file of somebody else in the folder that is about to be replaced.
    let notes = out.join("notes.txt");
    let add = AtWork("packing", || fs::write(&notes, "measured today").unwrap());
    let error = handoff(&options(&out), &add).unwrap_err();
    assert_eq!(error.id(), "handoff/foreign-file");
    insta::assert_snapshot!(metalith_testing::without_folder(error, parent.path()), @"
    kit contains notes.txt, which is not a file of a hand-off
      help: choose another folder with --out, or move it away
    ");
    assert_eq!(fs::read_to_string(&notes).unwrap(), "measured today");
    fs::remove_file(&notes).unwrap();
    assert_whole(&out);
    // A file in the folder that is being made.
    let unfinished = || {
        let mut parts = names(parent.path()).into_iter().filter(|n| n.ends_with(".part"));
        parent.path().join(parts.next().unwrap()).join("folder")
    };
    let add = AtWork("rules", || fs::write(unfinished().join("more.txt"), "x").unwrap());
    let error = handoff(&options(&out), &add).unwrap_err();
    assert_eq!(error.id(), "handoff/folder-changed");
    insta::assert_snapshot!(error, @"
    more.txt was added or removed while the hand-off was written
      help: make sure that no other program writes into its folder, and try again
    ");
    assert_eq!(names(parent.path()), ["kit", "kit.zip"]);
    assert_eq!(fs::read(out.join("manifest.json")).unwrap(), first);
}

/// An archive that no hand-off put there is somebody's own.
#[test]
fn an_archive_of_others_stays() {
    let parent = tempfile::tempdir().unwrap();
    let out = parent.path().join("kit");
    let archive = out.with_extension("zip");
    fs::write(&archive, "theses").unwrap();
    for folder in [false, true] {
        if folder {
            fs::create_dir(&out).unwrap();
        }
        let error = handoff(&options(&out), &Silent).unwrap_err();
        assert_eq!(error.id(), "handoff/foreign-archive");
        assert_eq!(fs::read_to_string(&archive).unwrap(), "theses");
    }
    // That of a hand-off whose folder was removed is its own.
    fs::remove_file(&archive).unwrap();
    handoff(&options(&out), &Silent).unwrap();
    fs::remove_dir_all(&out).unwrap();
    handoff(&options(&out), &Silent).unwrap();
    assert_whole(&out);
}

/// Four at once: those that do not win are told why, and what stands is whole.
#[test]
fn of_several_at_once_one_wins() {
    let parent = tempfile::tempdir().unwrap();
    let out = parent.path().join("kit");
    let outcomes: Vec<_> = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..4)
            .map(|_| scope.spawn(|| handoff(&options(&out), &Silent)))
            .collect();
        runs.into_iter().map(|r| r.join().unwrap()).collect()
    });
    assert!(outcomes.iter().any(Result::is_ok));
    for error in outcomes.into_iter().filter_map(Result::err) {
        assert_eq!(error.id(), "file/busy");
    }
    assert_whole(&out);
    assert_eq!(names(parent.path()), ["kit", "kit.zip"]);
}

#[cfg(unix)]
#[test]
fn links_and_other_files_in_the_way_are_left_alone() {
    let parent = tempfile::tempdir().unwrap();
    let out = parent.path().join("kit");
    let elsewhere = parent.path().join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &out).unwrap();
    assert_eq!(
        handoff(&options(&out), &Silent).unwrap_err().id(),
        "handoff/not-a-folder"
    );
    fs::remove_file(&out).unwrap();
    fs::create_dir(parent.path().join("kit.zip")).unwrap();
    assert_eq!(handoff(&options(&out), &Silent).unwrap_err().id(), "handoff/not-a-file");
    assert_eq!(names(parent.path()), ["elsewhere", "kit.zip"]);
}
