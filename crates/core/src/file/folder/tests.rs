use std::collections::BTreeMap;

use super::*;

/// A folder with files of one version, and the archive that says which.
fn write(folder: &Path, archive: &Path, version: &str) {
    fs::create_dir_all(folder.join("deep")).unwrap();
    for name in ["a", "b", "deep/c"] {
        fs::write(folder.join(name), version).unwrap();
    }
    fs::write(archive, version).unwrap();
}

/// Version of the folder and of the archive; the folder must be of one version and have all its files.
fn versions(parent: &Path) -> (Option<String>, Option<String>) {
    let folder = parent.join("kit");
    let text = |path: &Path| fs::read_to_string(path).ok();
    let found: Vec<_> = ["a", "b", "deep/c"].iter().map(|n| text(&folder.join(n))).collect();
    assert!(found.iter().all(|f| *f == found[0]), "{found:?}");
    (found[0].clone(), text(&parent.join("kit.zip")))
}

fn names(parent: &Path) -> Vec<String> {
    let names = fs::read_dir(parent).unwrap();
    let mut names: Vec<_> = names.map(|n| n.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn begin(parent: &Path) -> Result<AtomicFolder> {
    AtomicFolder::create(&parent.join("kit"), &parent.join("kit.zip"))
}

fn replace(parent: &Path, version: &str) {
    let new = begin(parent).unwrap();
    write(&new.folder(), &new.archive(), version);
    new.publish().unwrap();
}

/// Leaves the folder as a killed process does: nothing is removed, and the lock is no longer held.
fn kill(mut new: AtomicFolder) {
    new.part = PathBuf::new();
    // Closing alone would not do: a process that another test is starting shares the open file until it executes.
    new.lock.take().unwrap().unlock().unwrap();
    std::mem::forget(new);
}

/// Some moments at which a run ends: after so many steps, and while what is old is being removed.
fn moments() -> impl Iterator<Item = (usize, usize)> {
    let after = (0..=Step::ALL.len()).map(|steps| (steps, 0));
    after.chain((1..=4).map(|removed| (Step::ALL.len() - 1, removed)))
}

/// Remove the first files of a tree, as a killed `remove_dir_all` does.
fn remove_some(tree: &Path, mut count: usize) {
    let mut open = vec![tree.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() {
                open.push(entry);
            } else if count > 0 {
                fs::remove_file(entry).unwrap();
                count -= 1;
            }
        }
    }
}

#[test]
fn killed_at_any_moment_the_old_or_the_new_is_found_and_the_next_run_succeeds() {
    for with_old in [false, true] {
        for unfinished in [true, false] {
            for (steps, removed) in moments() {
                let parent = tempfile::tempdir().unwrap();
                let parent = parent.path();
                if with_old {
                    replace(parent, "old");
                }
                let new = begin(parent).unwrap();
                write(&new.folder(), &new.archive(), "new");
                if unfinished {
                    if steps % 2 == 0 {
                        fs::remove_file(new.archive()).unwrap();
                    }
                } else {
                    new.places.decide(&new.part).unwrap();
                    for &step in &Step::ALL[..steps] {
                        new.places.perform(step).unwrap();
                    }
                    if removed > 0 && with_old {
                        remove_some(&new.places.old, removed);
                    }
                    // An archive never lies beside a folder that is newer.
                    let (folder, archive) = versions(parent);
                    assert!(
                        archive.is_none() || archive == folder,
                        "{folder:?} {archive:?} after {steps}"
                    );
                }
                kill(new);
                // The next run begins, and gives up: the new ones stand if they were decided, else the old ones.
                drop(begin(parent).unwrap());
                let expected = match (unfinished, with_old) {
                    (true, false) => None,
                    (true, true) => Some("old".to_owned()),
                    (false, _) => Some("new".to_owned()),
                };
                assert_eq!(versions(parent), (expected.clone(), expected.clone()), "after {steps}");
                let visible = if expected.is_some() {
                    vec!["kit", "kit.zip"]
                } else {
                    vec![]
                };
                assert_eq!(names(parent), visible);
                // And one that goes to its end.
                replace(parent, "next");
                assert_eq!(versions(parent), (Some("next".into()), Some("next".into())));
                assert_eq!(names(parent), ["kit", "kit.zip"]);
            }
        }
    }
}

/// A run that repairs may be killed too.
#[test]
fn killed_again_while_repairing() {
    for first in 0..=Step::ALL.len() {
        for second in 0..=Step::ALL.len() {
            let parent = tempfile::tempdir().unwrap();
            let parent = parent.path();
            replace(parent, "old");
            let new = begin(parent).unwrap();
            write(&new.folder(), &new.archive(), "new");
            new.places.decide(&new.part).unwrap();
            for steps in [first, second] {
                for &step in &Step::ALL[..steps] {
                    new.places.perform(step).unwrap();
                }
            }
            kill(new);
            drop(begin(parent).unwrap());
            assert_eq!(versions(parent), (Some("new".into()), Some("new".into())));
            assert_eq!(names(parent), ["kit", "kit.zip"]);
        }
    }
}

/// Four threads replace one folder again and again: some are told that another is writing, none leaves a mixture.
#[test]
fn of_several_at_once_one_wins() {
    const EACH: usize = 40;
    let parent = tempfile::tempdir().unwrap();
    let parent = parent.path();
    let outcomes = std::thread::scope(|scope| {
        let run = |who: usize| {
            move || {
                let mut counts = BTreeMap::new();
                for k in 0..EACH {
                    let outcome = begin(parent).and_then(|new| {
                        write(&new.folder(), &new.archive(), &format!("{who}-{k}"));
                        new.publish()
                    });
                    let refused = match &outcome {
                        Ok(()) => false,
                        Err(error) => {
                            assert!(error.to_string().contains("another process"), "{error}");
                            true
                        }
                    };
                    *counts.entry(refused).or_insert(0) += 1;
                }
                counts
            }
        };
        let runs: Vec<_> = (0..4).map(|who| scope.spawn(run(who))).collect();
        runs.into_iter().map(|r| r.join().unwrap()).collect::<Vec<_>>()
    });
    let published: usize = outcomes.iter().filter_map(|o| o.get(&false)).sum();
    assert!(published >= 1);
    let (folder, archive) = versions(parent);
    assert!(folder.is_some() && folder == archive);
    assert_eq!(names(parent), ["kit", "kit.zip"]);
}

#[test]
fn a_file_in_the_place_of_the_folder_is_left_alone() {
    let parent = tempfile::tempdir().unwrap();
    let parent = parent.path();
    fs::write(parent.join("kit"), "precious").unwrap();
    let error = begin(parent).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("is not a folder"), "{error}");
    assert_eq!(fs::read_to_string(parent.join("kit")).unwrap(), "precious");
    assert_eq!(names(parent), ["kit"]);
}

/// A run whose lock was removed by hand leaves that of the next run, which has begun meanwhile.
#[test]
fn the_lock_of_another_run_is_left_alone() {
    let parent = tempfile::tempdir().unwrap();
    let parent = parent.path();
    let first = begin(parent).unwrap();
    fs::remove_file(&first.places.lock).unwrap();
    let second = begin(parent).unwrap();
    drop(first);
    assert!(begin(parent).is_err(), "the second run still writes");
    write(&second.folder(), &second.archive(), "second");
    second.publish().unwrap();
    assert_eq!(versions(parent), (Some("second".into()), Some("second".into())));
    assert_eq!(names(parent), ["kit", "kit.zip"]);
}

#[test]
fn what_is_given_up_leaves_nothing() {
    let parent = tempfile::tempdir().unwrap();
    let parent = parent.path();
    let new = begin(parent).unwrap();
    write(&new.folder(), &new.archive(), "new");
    assert!(begin(parent).is_err());
    drop(new);
    assert_eq!(names(parent), Vec::<String>::new());
    // Without an archive nothing is published.
    replace(parent, "old");
    let new = begin(parent).unwrap();
    fs::write(new.folder().join("a"), "new").unwrap();
    assert!(new.publish().is_err());
    assert_eq!(versions(parent), (Some("old".into()), Some("old".into())));
    assert_eq!(names(parent), ["kit", "kit.zip"]);
}
