//! The unfinished file: opened so that nothing but itself is written, and held by one run at a time.

use std::fs::{self, File, Metadata, TryLockError};
use std::io;
use std::path::Path;

use crate::error::{Error, Result};

/// Largest number of times that another run may put its file in place between opening and locking, before that is an
/// error.
const MOST_TRIES: u32 = 100;

/// Open the unfinished file `part` of `target`, empty and locked, and make it if it is not there.
///
/// # Errors
/// If it cannot be made, something else than an ordinary file with this one name lies there, or another process
/// writes it.
pub(super) fn open(part: &Path, target: &Path) -> Result<File> {
    for _ in 0..MOST_TRIES {
        let file = reach(part)?;
        if claim(&file, part, target)? {
            file.set_len(0).map_err(Error::io("empty", part))?;
            return Ok(file);
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

fn busy(target: &Path) -> Error {
    Error::refused(
        "file/busy",
        format!("another process is writing {}", target.display()),
        "wait for it, or write elsewhere with --out",
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
fn same(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Elsewhere files have no numbers that can be compared; an open file cannot be renamed there either.
#[cfg(not(unix))]
fn same(_: &Metadata, _: &Metadata) -> bool {
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
              help: choose a folder that you may write to with --out
            ");
        // Another fault is one of the file, and so is one that is there and may not be written.
        assert_eq!(place(io::ErrorKind::InvalidInput), part);
        fs::write(&part, "").unwrap();
        assert_eq!(place(io::ErrorKind::PermissionDenied), part);
    }
}
