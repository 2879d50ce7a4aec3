//! Whole files with links and pipes in the way, and with two processes at once.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::{AtomicFile, part};

/// Tells the process that a test starts what to do, and where.
const ROLE: &str = "METALITH_TEST_ROLE";
const FILE: &str = "METALITH_TEST_FILE";

/// Bytes of a test's file: larger than a block, so that the way past the page cache is taken too.
const LENGTH: usize = (1 << 20) + 4097;

/// Files that each of two processes puts in place.
const WRITES: usize = 40;

fn part_of(target: &Path) -> PathBuf {
    target.with_file_name(format!(".{}.part", target.file_name().unwrap().to_string_lossy()))
}

/// This program again, as another process that plays a role.
fn start(role: &str, file: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            "file::tests::other_process",
            "--nocapture",
            "--include-ignored",
        ])
        .env(ROLE, role)
        .env(FILE, file)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

fn wait_for(child: &mut BufReader<std::process::ChildStdout>, word: &str) {
    let mut line = String::new();
    while !line.contains(word) {
        line.clear();
        assert!(
            child.read_line(&mut line).unwrap() > 0,
            "the other process ended before it said {word}"
        );
    }
}

/// Work of the other process; without a role, nothing.
#[test]
#[ignore = "started by other tests"]
fn other_process() {
    let (Ok(role), Some(file)) = (std::env::var(ROLE), std::env::var_os(FILE)) else {
        return;
    };
    let target = PathBuf::from(file);
    match role.as_str() {
        // Opens the unfinished file, waits, and only then asks for its lock.
        "late" => {
            let part = part_of(&target);
            let opened = part::reach(&part).unwrap();
            println!("opened");
            std::io::stdin().lock().read_line(&mut String::new()).unwrap();
            let claimed = part::claim(&opened, &part, &target).unwrap();
            println!("claimed {claimed}");
            drop(opened);
            AtomicFile::write(&target, b"late").unwrap();
        }
        // Holds the file until it is killed or told to end.
        "holder" => {
            let mut file = AtomicFile::create(&target).unwrap();
            file.write_all(&vec![b'h'; LENGTH]).unwrap();
            println!("holds");
            std::io::stdin().lock().read_line(&mut String::new()).unwrap();
        }
        // Writes again and again; that the other is at it is the one excuse.
        _ => {
            let bytes = vec![role.as_bytes()[0]; LENGTH];
            let mut done = 0;
            while done < WRITES {
                match AtomicFile::write(&target, &bytes) {
                    Ok(()) => done += 1,
                    Err(error) => assert_eq!(error.id(), "file/busy"),
                }
            }
        }
    }
}

/// A run that opened the unfinished file of another before that was put in place leaves the published file alone.
#[test]
fn a_late_process_does_not_touch_the_published_file() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    let mut first = AtomicFile::create(&target).unwrap();
    let mut late = start("late", &target);
    let mut said = BufReader::new(late.stdout.take().unwrap());
    wait_for(&mut said, "opened");
    let bytes = vec![b'f'; LENGTH];
    first.write_all(&bytes).unwrap();
    first.commit().unwrap();
    // An open handle on the published file shows whether its bytes are changed in place.
    let mut published = std::fs::File::open(&target).unwrap();
    late.stdin.take().unwrap().write_all(b"go\n").unwrap();
    wait_for(&mut said, "claimed false");
    assert!(late.wait().unwrap().success());
    let mut kept = Vec::new();
    published.read_to_end(&mut kept).unwrap();
    assert!(kept == bytes, "the published file was changed in place");
    assert_eq!(std::fs::read(&target).unwrap(), b"late");
    assert!(!part_of(&target).exists());
}

/// Two processes that write the same file time after time: it is always one of the two, whole.
#[test]
fn two_processes_never_mix() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    std::fs::write(&target, vec![b'a'; LENGTH]).unwrap();
    let mut writers = ["a", "b"].map(|role| start(role, &target));
    let mut looks = 0;
    while writers.iter_mut().any(|w| w.try_wait().unwrap().is_none()) {
        let bytes = std::fs::read(&target).unwrap();
        assert!(
            bytes.len() == LENGTH && bytes.iter().all(|b| *b == bytes[0]),
            "half a file"
        );
        looks += 1;
    }
    for mut writer in writers {
        assert!(writer.wait().unwrap().success());
    }
    assert!(looks > 0);
    assert!(!part_of(&target).exists());
}

/// While another process writes, a second is refused; once that is killed, what it left is in nobody's way.
#[test]
fn a_killed_process_leaves_nothing_in_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    std::fs::write(&target, b"old").unwrap();
    let mut holder = start("holder", &target);
    let mut said = BufReader::new(holder.stdout.take().unwrap());
    wait_for(&mut said, "holds");
    let error = AtomicFile::create(&target).map(|_| ()).unwrap_err();
    assert_eq!(error.id(), "file/busy");
    holder.kill().unwrap();
    holder.wait().unwrap();
    assert_eq!(std::fs::read(&target).unwrap(), b"old");
    assert!(part_of(&target).exists());
    AtomicFile::clear(&target);
    assert!(!part_of(&target).exists());
    assert_eq!(std::fs::read(&target).unwrap(), b"old");
    AtomicFile::write(&target, b"new").unwrap();
    assert_eq!(std::fs::read(&target).unwrap(), b"new");
    assert!(!part_of(&target).exists());
}

/// A run whose unfinished file was removed by hand ends with an error, and leaves that of the next run, which has begun
/// meanwhile.
#[test]
fn a_run_that_lost_its_file_leaves_that_of_another_alone() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    for commits in [true, false] {
        let mut first = AtomicFile::create(&target).unwrap();
        first.write_all(b"first").unwrap();
        std::fs::remove_file(part_of(&target)).unwrap();
        let mut second = AtomicFile::create(&target).unwrap();
        second.write_all(b"second").unwrap();
        if commits {
            assert_eq!(first.commit().unwrap_err().id(), "file/changed-meanwhile");
        } else {
            drop(first);
        }
        assert!(part_of(&target).exists());
        second.commit().unwrap();
        assert_eq!(std::fs::read(&target).unwrap(), b"second");
        assert!(!part_of(&target).exists());
        std::fs::remove_file(&target).unwrap();
    }
}

/// Links, hard or soft, are refused and what they lead to is as it was.
#[test]
fn links_are_not_followed() {
    let folder = tempfile::tempdir().unwrap();
    let (target, other) = (folder.path().join("out"), folder.path().join("precious"));
    let part = part_of(&target);
    std::fs::write(&other, b"precious").unwrap();
    symlink(&other, &part).unwrap();
    let refused = || AtomicFile::write(&target, b"new").unwrap_err().id();
    assert_eq!(refused(), "file/not-regular");
    std::fs::remove_file(&part).unwrap();
    symlink(folder.path().join("nowhere"), &part).unwrap();
    assert_eq!(refused(), "file/not-regular");
    assert!(!folder.path().join("nowhere").exists());
    std::fs::remove_file(&part).unwrap();
    std::fs::hard_link(&other, &part).unwrap();
    assert_eq!(refused(), "file/not-regular");
    assert_eq!(std::fs::read(&other).unwrap(), b"precious");
    assert!(!target.exists());
}

/// A pipe that nobody reads, or a folder, is refused at once.
#[test]
fn pipes_and_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out");
    let part = part_of(&target);
    assert!(Command::new("mkfifo").arg(&part).status().unwrap().success());
    let refused = || AtomicFile::create(&target).map(|_| ()).unwrap_err().id();
    assert_eq!(refused(), "file/not-regular");
    // With a reader the pipe can be opened, and is refused all the same.
    let reader = std::fs::File::options().read(true).write(true).open(&part).unwrap();
    assert_eq!(refused(), "file/not-regular");
    drop(reader);
    std::fs::remove_file(&part).unwrap();
    std::fs::create_dir(&part).unwrap();
    assert_eq!(refused(), "file/not-regular");
    std::fs::remove_dir(&part).unwrap();
    // Where the file itself is to stand, before any of it is written.
    std::fs::create_dir(&target).unwrap();
    assert_eq!(refused(), "file/is-a-folder");
    assert!(!part.exists());
}
