//! The unfinished file: opened so that nothing but itself is written, and held by one run at a time.

use std::fs::{self, File, Metadata, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::error::{Error, Result};

/// Largest number of times that another run may put its file in place between opening and locking, before that is an
/// error.
const MOST_TRIES: u32 = 100;

/// Open the unfinished file `part` of `target`, empty and locked, and make it if it is not there. None where there are no
/// locks: nothing tells then who writes it.
///
/// # Errors
/// If it cannot be made, something else than an ordinary file with this one name lies there, or another process
/// writes it.
pub(super) fn open(part: &Path, target: &Path) -> Result<Option<File>> {
    for _ in 0..MOST_TRIES {
        let file = reach(part)?;
        if claim(&file, part, target)? {
            // Asked again, a lock that is held is granted.
            if let Err(TryLockError::Error(_)) = file.try_lock() {
                if file.metadata().is_ok_and(|found| found.len() == 0) {
                    remove_own(&file, part);
                }
                return Ok(None);
            }
            file.set_len(0).map_err(Error::io("empty", part))?;
            return Ok(Some(file));
        }
    }
    Err(busy(target))
}

/// Open what lies at `part` without following a link, without waiting for the other end of a pipe, and without
/// changing it.
pub(super) fn reach(part: &Path) -> Result<File> {
    let mut options = File::options();
    options.write(true).create(true).truncate(false);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK);
    }
    let file = options.open(part).map_err(|error| refused(part, error))?;
    let there = file.metadata().map_err(Error::io("read", part))?;
    if there.is_file() && !has_other_names(&there) {
        Ok(file)
    } else if there.is_file() && !is_at(&file, part).map_err(Error::io("read", part))? {
        // Renamed by its run a moment ago; claiming it fails, and opening is tried again.
        Ok(file)
    } else {
        Err(not_ordinary(part))
    }
}

/// Reason why nothing could be opened at `part`. For a folder that may not be written to, the message names the folder,
/// because the user does not know of the unfinished file.
fn refused(part: &Path, error: io::Error) -> Error {
    let no_rights = matches!(
        error.kind(),
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem
    );
    match fs::symlink_metadata(part) {
        Ok(there) if !there.is_file() => not_ordinary(part),
        Err(_) if no_rights => Error::io("write into the folder", folder_of(part))(error),
        _ => Error::io("create", part)(error),
    }
}

/// Lock the file opened at `part`. Whether it is still there: the run that had it before may have put it in its
/// place in the meantime, and then it must not be touched.
pub(super) fn claim(file: &File, part: &Path, target: &Path) -> Result<bool> {
    // A file system without locks is written without.
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Err(busy(target));
    }
    is_at(file, part).map_err(Error::io("read", part))
}

/// Make something at `BEFORE.HOST-PROCESS-NUMBER` and an ending: a path that is of this run alone. `make` must fail if
/// there is something already.
pub(super) fn new_of_run<T>(
    before: &Path,
    ending: &str,
    make: impl Fn(&Path) -> io::Result<T>,
) -> Result<(PathBuf, T)> {
    for number in 0.. {
        let mut path = before.as_os_str().to_owned();
        path.push(format!(".{}-{}-{number}{ending}", host(), std::process::id()));
        let path = PathBuf::from(path);
        match make(&path) {
            Ok(made) => return Ok((path, made)),
            // Of another thread, or of a killed process of this number.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(refused(&path, error)),
        }
    }
    unreachable!("numbers do not end")
}

/// Make a file, and fail if there is one.
pub(super) fn create_new(path: &Path) -> io::Result<File> {
    File::options().write(true).create_new(true).open(path)
}

/// Name of this machine, as far as it can stand in the name of a file; empty if it is not known.
fn host() -> &'static str {
    static HOST: OnceLock<String> = OnceLock::new();
    HOST.get_or_init(|| {
        let name = fs::read_to_string("/proc/sys/kernel/hostname")
            .or_else(|_| std::env::var("HOSTNAME"))
            .or_else(|_| std::env::var("COMPUTERNAME"))
            .unwrap_or_default();
        let plain = name.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-');
        plain.take(32).collect()
    })
}

fn busy(target: &Path) -> Error {
    Error::refused(
        "file/busy",
        format!("another process is writing {}", target.display()),
        "wait for it, or write to another place",
    )
}

fn not_ordinary(part: &Path) -> Error {
    Error::refused(
        "file/not-regular",
        format!("{} is not an ordinary file", part.display()),
        "remove it: a file of this name is made while a file is being written",
    )
}

/// True if the open file is the one at `path`, no link followed.
pub(super) fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    match fs::symlink_metadata(path) {
        Ok(there) => Ok(same(&file.metadata()?, &there)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Succeeds if the open file is the one at `path`.
///
/// # Errors
/// If another process has put a file there.
pub(super) fn check_at(file: &File, path: &Path) -> Result<()> {
    if is_at(file, path).map_err(Error::io("read", path))? {
        return Ok(());
    }
    Err(Error::refused(
        "file/changed-meanwhile",
        format!("{} was replaced while it was written", path.display()),
        "let one program at a time write into this folder, and try again",
    ))
}

/// Remove the open file at `path`, if it is still that: after it was lost, what lies there is the file of another run. Removed
/// while it is locked, or another run could hold the file whose name is taken away here, and a third one a new file of this
/// name. What cannot be removed is left to the next run.
pub(super) fn remove_own(file: &File, path: &Path) {
    if is_at(file, path).unwrap_or(false) {
        let _ = fs::remove_file(path);
    }
}

/// True if two open files are one file.
pub(super) fn is_same(a: &File, b: &File) -> io::Result<bool> {
    Ok(same(&a.metadata()?, &b.metadata()?))
}

#[cfg(unix)]
pub(super) fn same(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Elsewhere files have no numbers that can be compared; an open file cannot be renamed there either.
#[cfg(not(unix))]
pub(super) fn same(_: &Metadata, _: &Metadata) -> bool {
    true
}

#[cfg(unix)]
fn has_other_names(file: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    file.nlink() > 1
}

#[cfg(not(unix))]
fn has_other_names(_: &Metadata) -> bool {
    false
}

/// The folder that a file is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// Bring the folder of a file to the disk, so that a renamed file is found there after a loss of power.
pub(super) fn flush_folder_of(path: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        match File::open(folder_of(path)).and_then(|f| f.sync_all()) {
            // Some file systems do not know this, and some folders may be written but not read.
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported | io::ErrorKind::PermissionDenied
                ) =>
            {
                Ok(())
            }
            other => other,
        }
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_rights_is_told_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let part = folder.path().join(".lens.gds.part");
        let place = |kind: io::ErrorKind| match refused(&part, kind.into()) {
            Error::Io { path, .. } => path,
            other => panic!("{other:?}"),
        };
        for kind in [io::ErrorKind::PermissionDenied, io::ErrorKind::ReadOnlyFilesystem] {
            assert_eq!(place(kind), folder.path());
        }
        let words = refused(&part, io::ErrorKind::PermissionDenied.into()).to_string();
        insta::assert_snapshot!(words.replace(&*folder.path().to_string_lossy(), "FOLDER"), @"
            cannot write into the folder FOLDER: permission denied
              help: choose a folder that you may write to
            ");
        // Another fault is one of the file, and so is one that is there and may not be written.
        assert_eq!(place(io::ErrorKind::InvalidInput), part);
        fs::write(&part, "").unwrap();
        assert_eq!(place(io::ErrorKind::PermissionDenied), part);
    }
}
