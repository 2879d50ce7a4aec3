use super::*;
use std::sync::Mutex;

/// Names of the files of two results; the last one differs.
const NAMES: [[&str; 3]; 2] = [["a.png", "b.json", "old.png"], ["a.png", "b.json", "new.png"]];
/// A file that a new result makes stale, and one of somebody else.
const STALE: &str = "report.html";
const FOREIGN: &str = "notes.txt";

fn publish(turn: &FolderLock, version: usize) -> Result<()> {
    turn.publish("set", &[STALE], |folder| {
        for name in NAMES[version] {
            AtomicFile::write(&folder.join(name), format!("{version} {name}").as_bytes())?;
        }
        Ok(())
    })
}

/// Version of each file that is there, and of the list.
fn versions(folder: &Path) -> Vec<usize> {
    let text = |name: &str| fs::read_to_string(folder.join(name)).ok();
    let of_file = |name: &&str| text(name).map(|t| t[..1].parse().unwrap());
    let all = NAMES.iter().flatten().collect::<std::collections::BTreeSet<_>>();
    let files = all.into_iter().filter_map(of_file);
    let list = text(".set.sha256").map(|t| usize::from(t.contains("new.png")));
    files.chain(list).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = entries(folder)
        .unwrap()
        .into_iter()
        .map(|n| n.into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// A folder with the first result, a report on it, and a file of somebody else.
fn begun() -> (tempfile::TempDir, FolderLock) {
    let place = tempfile::tempdir().unwrap();
    let turn = FolderLock::of(place.path()).unwrap();
    publish(&turn, 0).unwrap();
    for name in [STALE, FOREIGN] {
        fs::write(place.path().join(name), "of the first").unwrap();
    }
    (place, turn)
}

#[test]
fn without_a_list_nothing_else_goes() {
    let (place, turn) = begun();
    fs::write(place.path().join("old.lyrdb"), "old").unwrap();
    let replace = |names: &[&str]| {
        turn.replace("set", &[STALE], |folder| {
            names
                .iter()
                .try_for_each(|name| AtomicFile::write(&folder.join(name), b"new"))
        })
        .unwrap();
    };
    replace(&["a.lyrdb", "a.xml"]);
    replace(&["a.lyrdb"]);
    let there = [
        ".set.sha256",
        "a.lyrdb",
        "a.png",
        "a.xml",
        "b.json",
        FOREIGN,
        "old.lyrdb",
        "old.png",
    ];
    assert_eq!(names(place.path()), there);
}

/// Leave the second result as a run does that is killed after its decision.
fn decide(folder: &Path) -> FileSet {
    let set = FileSet::of(folder, "set").unwrap();
    let unfinished = folder.join(".set.there-1-0.unfinished");
    fs::create_dir(&unfinished).unwrap();
    for name in NAMES[1] {
        fs::write(unfinished.join(name), format!("1 {name}")).unwrap();
    }
    set.complete(&unfinished, &[STALE], true).unwrap();
    fs::rename(&unfinished, &set.decided).unwrap();
    set
}

#[test]
fn the_new_files_replace_all_old_ones() {
    let (place, turn) = begun();
    publish(&turn, 1).unwrap();
    assert_eq!(versions(place.path()), [1; 4]);
    assert_eq!(
        names(place.path()),
        [".set.sha256", "a.png", "b.json", "new.png", FOREIGN]
    );
}

#[test]
fn killed_at_any_step_two_results_never_lie_side_by_side() {
    let count = {
        let (place, turn) = begun();
        drop(turn);
        decide(place.path()).steps().unwrap().len()
    };
    for first in 0..=count {
        for second in 0..=count {
            let (place, turn) = begun();
            let folder = place.path();
            drop(turn);
            let set = decide(folder);
            for steps in [first, second] {
                for step in set.steps().unwrap().iter().take(steps) {
                    step.perform().unwrap();
                    let there = versions(folder);
                    assert!(
                        there.iter().all(|v| *v == there[0]),
                        "{there:?} after {first} and {second}"
                    );
                    assert!(!folder.join(STALE).exists() || there.contains(&0));
                }
            }
            // Whoever reads one of them finishes.
            settled(&folder.join("a.png"), &Silent).unwrap();
            assert_eq!(versions(folder), [1; 4]);
            assert_eq!(names(folder), [".set.sha256", "a.png", "b.json", "new.png", FOREIGN]);
            publish(&FolderLock::of(folder).unwrap(), 0).unwrap();
            assert_eq!(versions(folder), [0; 4]);
        }
    }
}

#[test]
fn what_is_not_complete_replaces_nothing() {
    let (place, turn) = begun();
    let before = names(place.path());
    let failed = turn.publish("set", &[STALE], |folder| {
        AtomicFile::write(&folder.join("a.png"), b"1")?;
        let full = io::ErrorKind::StorageFull.into();
        Err::<(), _>(Error::io("write", &folder.join("b.json"))(full))
    });
    // The error names the file that the user knows.
    let words = failed.unwrap_err().to_string();
    insta::assert_snapshot!(words.replace(&*place.path().to_string_lossy(), "FOLDER"), @"
    cannot write FOLDER/b.json: no storage space
      help: free space or choose another folder; nothing was replaced
    ");
    assert_eq!(names(place.path()), before);
    // A folder where a file is to stand.
    fs::create_dir(place.path().join("new.png")).unwrap();
    assert_eq!(publish(&turn, 1).unwrap_err().id(), "file/is-a-folder");
    assert_eq!(versions(place.path()), [0; 4]);
    // Of a killed run.
    drop(turn);
    let folders = [
        ".set.there-1-0.unfinished",
        ".set.unfinished",
        ".mine.publish",
        ".publish",
    ];
    let [left, kept @ ..] = folders.map(|name| place.path().join(name));
    for folder in [&left].into_iter().chain(&kept) {
        fs::create_dir(folder).unwrap();
        fs::write(folder.join("a.png"), "1").unwrap();
    }
    drop(FolderLock::of(place.path()).unwrap());
    // Those that no run makes are of somebody else.
    assert!(!left.exists() && kept.iter().all(|folder| folder.join("a.png").exists()));
    assert_eq!(versions(place.path()), [0; 4]);
    fs::remove_dir(place.path().join("new.png")).unwrap();
    fs::create_dir_all(place.path().join(".set.publish/foreign")).unwrap();
    let turn = FolderLock::of(place.path()).unwrap();
    assert_eq!(publish(&turn, 1).unwrap_err().id(), "file/foreign-remains");
    assert_eq!(versions(place.path()), [0; 4]);
}

#[test]
fn no_file_of_another_result_is_replaced() {
    let (place, turn) = begun();
    let other = |names: &[&str], text: &str| {
        turn.publish("other", &[], |folder| {
            names
                .iter()
                .try_for_each(|name| AtomicFile::write(&folder.join(name), text.as_bytes()))
        })
    };
    let refused = other(&["c.png", "a.png"], "of another").unwrap_err();
    assert_eq!(refused.id(), "file/of-another-result");
    assert_eq!(versions(place.path()), [0; 4]);
    assert!(!place.path().join("c.png").exists());
    // Equal files may be of both.
    other(&["a.png"], "0 a.png").unwrap();
    other(&["c.png"], "of another").unwrap_err();
    publish(&turn, 0).unwrap();
}

#[test]
fn a_result_on_replaced_files_goes_with_its_list() {
    let (place, turn) = begun();
    let stale = ["page.html", ".page.sha256"];
    for version in ["1", "2"] {
        turn.publish("made", &stale, |folder| {
            AtomicFile::write(&folder.join("made.gds"), version.as_bytes())
        })
        .unwrap();
        assert!(stale.iter().all(|name| !place.path().join(name).exists()));
        turn.publish("page", &[], |folder| {
            AtomicFile::write(&folder.join("page.html"), version.as_bytes())
        })
        .unwrap();
    }
    // Without its list the page is of another result.
    let refused = turn.publish("made", &stale[..1], |folder| {
        AtomicFile::write(&folder.join("made.gds"), b"3")
    });
    assert_eq!(refused.unwrap_err().id(), "file/of-another-result");
}

#[test]
fn no_input_is_replaced_or_removed() {
    let (place, turn) = begun();
    let before = names(place.path());
    drop(turn);
    // Of the new files, one that goes as the earlier result had it, and one that the new result makes stale.
    for input in ["a.png", "old.png", STALE] {
        let path = place.path().join(input);
        let turn = FolderLock::of(place.path()).unwrap().keeping([path.as_path()]);
        assert_eq!(publish(&turn, 1).unwrap_err().id(), "option/same-file", "{input}");
        assert_eq!(names(place.path()), before);
        assert_eq!(versions(place.path()), [0; 4]);
    }
    let turn = FolderLock::of(place.path()).unwrap();
    publish(&turn.keeping([place.path().join(FOREIGN).as_path()]), 1).unwrap();
    assert_eq!(versions(place.path()), [1; 4]);
}

#[test]
fn a_file_of_another_run_is_refused_by_name() {
    let (place, _turn) = begun();
    let [file, other] = ["a.png", "b.json"].map(|name| place.path().join(name));
    check_unaltered(&file).unwrap();
    fs::write(&file, "0 a.pnh").unwrap();
    let error = check_unaltered(&file).unwrap_err();
    assert_eq!((error.id(), error.exit_code()), ("file/altered", 2));
    assert!(
        error.to_string().contains("a.png") && error.to_string().contains(".set.sha256"),
        "{error}"
    );
    check_unaltered(&other).unwrap();
    // Not of a set.
    check_unaltered(&place.path().join(FOREIGN)).unwrap();
    check_unaltered(&place.path().join("nowhere/a.png")).unwrap();
}

#[test]
fn a_list_leads_out_of_no_folder() {
    for name in ["..", ".", "", "a/b", "../a", "/a", "a\\b", "a\nb"] {
        assert!(!is_plain(name), "{name:?}");
    }
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("in");
    fs::create_dir_all(folder.join(".set.publish")).unwrap();
    fs::write(place.path().join("precious"), "p").unwrap();
    fs::write(
        folder.join(".set.publish/.set.sha256"),
        "# removed: ../precious\n00  ../precious\n",
    )
    .unwrap();
    drop(FolderLock::of(&folder).unwrap());
    assert!(place.path().join("precious").exists());
    let turn = FolderLock::of(&folder).unwrap();
    assert_eq!(
        turn.publish("a/b", &[], |_| Ok(())).unwrap_err().id(),
        "file/unusual-name"
    );
}

/// Four threads write one set again and again, with locks and without: what stands is whole, and of one that said so.
#[test]
fn of_several_at_once_the_last_one_that_said_so_is_there() {
    const ROUNDS: usize = 20;
    for has_locks in [true, false] {
        let place = tempfile::tempdir().unwrap();
        let said = Mutex::new([0; 2]);
        std::thread::scope(|threads| {
            for version in [0, 1, 0, 1] {
                let (said, folder) = (&said, place.path());
                threads.spawn(move || {
                    for _ in 0..ROUNDS {
                        let turn = if has_locks {
                            FolderLock::of(folder).unwrap()
                        } else {
                            FolderLock::without_locks(folder)
                        };
                        match publish(&turn, version) {
                            Ok(()) => said.lock().unwrap()[version] += 1,
                            Err(error) => assert!(!has_locks && error.id() == "file/changed-meanwhile", "{error}"),
                        }
                    }
                });
            }
        });
        let there = versions(place.path());
        assert_eq!(there, [there[0]; 4]);
        let said = said.into_inner().unwrap();
        assert!(
            said[there[0]] > 0 && (!has_locks || said == [2 * ROUNDS; 2]),
            "{said:?}"
        );
        assert_eq!(names(place.path()).len(), 4);
    }
}
