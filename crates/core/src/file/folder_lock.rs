//! One run at a time writes the files of a folder.

use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::file_set;
use super::inputs::InputFiles;
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};

/// Time that a run waits before it asks again.
pub(super) const PAUSE: Duration = Duration::from_millis(50);

/// The turn of a run to write the files of a folder, which belong together: two runs at once would leave some of the one and
/// some of the other. It ends when it is dropped, or with the process. A folder that was made for it and is empty by then is removed.
#[derive(Debug)]
pub struct FolderLock {
    folder: PathBuf,
    /// True if the folder was not there before.
    is_new: bool,
    /// The folder itself, locked; none where folders or their file system have no locks.
    locked: Option<File>,
    /// Files that nothing written here replaces.
    inputs: InputFiles,
}

impl FolderLock {
    /// Wait for the turn at `folder`, which is made if need be. `wait` is called once if another process has it. What a
    /// killed run has left there is finished or removed.
    ///
    /// # Errors
    /// If the folder cannot be made, the disk refuses, or the user stops the run while it waits.
    pub fn wait(folder: &Path, progress: &dyn Progress, wait: impl FnOnce()) -> Result<Self> {
        let turn = Self {
            folder: folder.to_owned(),
            is_new: !folder.exists(),
            locked: Self::locked(folder, progress, wait)?,
            inputs: InputFiles::default(),
        };
        file_set::settle(&turn)?;
        Ok(turn)
    }

    /// Variant of [`FolderLock::wait`] that waits without a word.
    ///
    /// # Errors
    /// As [`FolderLock::wait`].
    pub fn of(folder: &Path) -> Result<Self> {
        Self::wait(folder, &Silent, || ())
    }

    /// Variant of this lock in which no result replaces or removes these files, which it is made from.
    #[must_use]
    pub fn keeping<'p>(mut self, inputs: impl IntoIterator<Item = &'p Path>) -> Self {
        inputs.into_iter().for_each(|path| self.inputs.add(path));
        self
    }

    /// Files that nothing written here replaces.
    pub fn inputs(&self) -> &InputFiles {
        &self.inputs
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    #[cfg(test)]
    pub(super) fn without_locks(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            is_new: false,
            locked: None,
            inputs: InputFiles::default(),
        }
    }

    /// True if others are kept out: false where there are no locks.
    pub fn is_held(&self) -> bool {
        self.locked.is_some()
    }

    fn locked(folder: &Path, progress: &dyn Progress, wait: impl FnOnce()) -> Result<Option<File>> {
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let mut wait = Some(wait);
        // Who had the turn before may have removed the folder that was waited for.
        loop {
            fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
            let opened = match File::open(folder) {
                Ok(opened) => opened,
                Err(why) if why.kind() == ErrorKind::NotFound => {
                    progress.check_stopped()?;
                    continue;
                }
                // A folder may be written and not read; and elsewhere it cannot be opened.
                Err(_) => return Ok(None),
            };
            loop {
                match opened.try_lock() {
                    Ok(()) if is_at(&opened, folder) => return Ok(Some(opened)),
                    Ok(()) => break,
                    Err(TryLockError::Error(_)) => return Ok(None),
                    Err(TryLockError::WouldBlock) => {}
                }
                progress.check_stopped()?;
                if let Some(wait) = wait.take() {
                    wait();
                }
                std::thread::sleep(PAUSE);
            }
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // Only while the lock keeps others out, who wait for a folder that stays.
        if self.is_new && self.is_held() {
            // A folder that holds anything is not removed.
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

/// True if an open folder is the one at a path.
#[cfg(unix)]
fn is_at(opened: &File, folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let [own, there] = [opened.metadata(), fs::metadata(folder)];
    own.is_ok_and(|own| there.is_ok_and(|there| (own.dev(), own.ino()) == (there.dev(), there.ino())))
}

/// True if an open folder is the one at a path: elsewhere an open folder cannot be removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A person who stops the run as soon as it has to wait.
    struct Impatient;

    impl Progress for Impatient {
        fn begin(&self, _what: &str, _steps: u64) {}

        fn advance(&self, _steps: u64) {}

        fn stopped(&self) -> bool {
            true
        }
    }

    #[test]
    fn one_has_the_turn_until_it_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("new");
        let first = FolderLock::wait(&place, &Impatient, || panic!("nobody else is there")).unwrap();
        assert!(matches!(
            FolderLock::wait(&place, &Impatient, || ()),
            Err(Error::Interrupted)
        ));
        let other = FolderLock::wait(folder.path(), &Impatient, || panic!("another folder")).unwrap();
        drop((first, other));
        FolderLock::wait(&place, &Silent, || panic!("it is free again")).unwrap();
    }

    #[test]
    fn a_new_folder_that_stays_empty_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("new");
        drop(FolderLock::of(&place).unwrap());
        assert!(!place.exists() && folder.path().exists());
        let turn = FolderLock::of(&place).unwrap();
        fs::write(place.join("file"), "").unwrap();
        drop(turn);
        assert!(place.join("file").exists());
        fs::remove_file(place.join("file")).unwrap();
        drop(FolderLock::of(&place).unwrap());
        assert!(place.exists(), "it was there before");
    }

    #[test]
    fn who_waits_for_a_folder_that_is_removed_gets_one() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("new");
        let mut first = Some(FolderLock::of(&place).unwrap());
        let turn = FolderLock::wait(&place, &Silent, || drop(first.take())).unwrap();
        assert!(turn.is_held() && place.exists());
    }

    #[test]
    fn who_waits_gets_it() {
        let folder = tempfile::tempdir().unwrap();
        let first = FolderLock::wait(folder.path(), &Silent, || ()).unwrap();
        let (mut first, mut waited) = (Some(first), false);
        FolderLock::wait(folder.path(), &Silent, || {
            waited = true;
            drop(first.take());
        })
        .unwrap();
        assert!(waited);
    }
}
