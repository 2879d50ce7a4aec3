//! A folder, and one file beside it that belongs to it, that appear together, whole or not at all.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::file_set::wait_for_other;
use super::part;
use crate::error::{Error, Result};

/// A folder written beside its place, with the file that goes with it (its archive), and put in their places when
/// both are complete.
///
/// Beside `NAME` there are, while it is written or after a run was killed:
///
/// | name | what |
/// | --- | --- |
/// | `.NAME.lock` | held by the run that writes; one at a time |
/// | `.NAME.PROCESS-NUMBER.part` | an unfinished folder and archive; the next run removes it |
/// | `.NAME.ready` | a finished folder and archive, on their way to their places |
/// | `.NAME.old` | the replaced folder and archive, on their way out |
///
/// Renaming `.part` to `.ready` decides: before, the old ones are untouched; after, whatever is left to do is done by
/// the next run, which finds the new ones. At no moment does an archive lie beside a folder that is newer.
pub struct AtomicFolder {
    places: Places,
    part: PathBuf,
    /// Held until the end; the file is removed with it.
    lock: Option<File>,
}

/// Paths of everything that an unfinished folder consists of.
struct Places {
    folder: PathBuf,
    archive: PathBuf,
    lock: PathBuf,
    ready: PathBuf,
    old: PathBuf,
}

/// Names in `.part`, `.ready` and `.old`.
const FOLDER: &str = "folder";
const ARCHIVE: &str = "archive";

/// One operation of the way from `.ready` to the places. Each is one or more system calls that can be done again;
/// a run may end between any two, and in the middle of those that remove.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    MakeOld,
    ArchiveOut,
    FolderOut,
    FolderIn,
    ArchiveIn,
    RemoveReady,
    RemoveOld,
}

impl Step {
    const ALL: [Self; 7] = [
        Self::MakeOld,
        Self::ArchiveOut,
        Self::FolderOut,
        Self::FolderIn,
        Self::ArchiveIn,
        Self::RemoveReady,
        Self::RemoveOld,
    ];
}

impl AtomicFolder {
    /// Begin to write the folder that is to stand at `target`, with an archive that is to stand at `archive` in the
    /// same parent. What a killed run left is finished or removed first.
    ///
    /// # Errors
    /// If another process writes the same folder, something else than a folder or a link to one lies there, or the disk refuses.
    pub fn create(target: &Path, archive: &Path) -> Result<Self> {
        let places = Places::of(target, archive)?;
        // What lies there is removed in the end: it must be what an earlier run may have left.
        if is_there(target)? && !target.is_dir() {
            return Err(Error::refused(
                "file/not-a-folder",
                format!("{} is not a folder", target.display()),
                "name a folder with --out, or remove what lies there",
            ));
        }
        let parent = part::folder_of(target);
        fs::create_dir_all(parent).map_err(Error::io("create the folder", parent))?;
        let lock = part::open(&places.lock, target)?;
        let is_locked = lock.is_some();
        let mut this = Self {
            part: PathBuf::new(),
            places,
            lock,
        };
        if !is_locked {
            wait_for_other(&this.places.ready)?;
        }
        this.places.finish()?;
        if is_locked {
            this.places.remove_unfinished()?;
        }
        this.part = this.places.new_part()?;
        Ok(this)
    }

    /// Path at which the folder is to be written: it is there, and empty.
    pub fn folder(&self) -> PathBuf {
        self.part.join(FOLDER)
    }

    /// Path at which the archive is to be written.
    pub fn archive(&self) -> PathBuf {
        self.part.join(ARCHIVE)
    }

    /// Put both in their places. Returns only when they are there; what lay there before is removed.
    ///
    /// # Errors
    /// If the archive is missing or the disk refuses. The old ones are then as they were, or the next run finishes
    /// what this one began.
    pub fn publish(mut self) -> Result<()> {
        let there = |path: &Path| fs::symlink_metadata(path).map_err(Error::io("publish", path));
        let own = [there(&self.folder())?, there(&self.archive())?];
        self.places.decide(&self.part)?;
        // From here on the new ones stand: nothing is thrown away.
        self.part = PathBuf::new();
        self.places.finish()?;
        let is_own = |path: &Path, own| there(path).is_ok_and(|found| part::same(&found, own));
        if is_own(&self.places.folder, &own[0]) && is_own(&self.places.archive, &own[1]) {
            return Ok(());
        }
        // Where there are no locks.
        Err(Error::refused(
            "file/changed-meanwhile",
            format!("{} was replaced while it was written", self.places.folder.display()),
            "let one program at a time write into this folder, and try again",
        ))
    }
}

impl Drop for AtomicFolder {
    fn drop(&mut self) {
        if !self.part.as_os_str().is_empty() {
            // Not finished: what is left of it is of no use.
            let _ = fs::remove_dir_all(&self.part);
        }
        if let Some(lock) = self.lock.take() {
            part::remove_own(&lock, &self.places.lock);
        }
    }
}

/// True if something is at the path; links are not followed.
pub(super) fn is_there(path: &Path) -> Result<bool> {
    match fs::symlink_metadata(path) {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(Error::io("read", path)(error)),
    }
}

pub(super) fn rename(from: &Path, to: &Path) -> Result<()> {
    fs::rename(from, to).map_err(Error::io("rename to", to))
}

pub(super) fn remove_tree(path: &Path) -> Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Error::io("remove", path)(error)),
        _ => Ok(()),
    }
}

impl Places {
    fn of(target: &Path, archive: &Path) -> Result<Self> {
        let Some(name) = target.file_name() else {
            return Err(Error::refused(
                "file/no-folder-name",
                format!("{} is not the name of a folder", target.display()),
                "name a folder with --out",
            ));
        };
        let beside = |ending: &str| {
            let mut hidden = OsString::from(".");
            hidden.push(name);
            hidden.push(ending);
            target.with_file_name(hidden)
        };
        Ok(Self {
            folder: target.to_owned(),
            archive: archive.to_owned(),
            lock: beside(".lock"),
            ready: beside(".ready"),
            old: beside(".old"),
        })
    }

    /// A new folder for this run alone.
    fn new_part(&self) -> Result<PathBuf> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let part = self
                .ready
                .with_extension(format!("{}-{number}.part", std::process::id()));
            match fs::create_dir(&part) {
                Ok(()) => {
                    let folder = part.join(FOLDER);
                    fs::create_dir(&folder).map_err(Error::io("create the folder", &folder))?;
                    return Ok(part);
                }
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(Error::io("create the folder", &part)(error)),
            }
        }
    }

    /// Remove unfinished folders of runs that were killed: this run holds the lock.
    fn remove_unfinished(&self) -> Result<()> {
        let parent = part::folder_of(&self.folder);
        let begin = self.ready.with_extension("");
        let begin = format!("{}.", begin.file_name().unwrap_or_default().to_string_lossy());
        for entry in fs::read_dir(parent).map_err(Error::io("read the folder", parent))? {
            let entry = entry.map_err(Error::io("read the folder", parent))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let Some(middle) = name.strip_prefix(&begin).and_then(|n| n.strip_suffix(".part")) else {
                continue;
            };
            let is_run = middle
                .split_once('-')
                .is_some_and(|(process, number)| process.parse::<u32>().is_ok() && number.parse::<u32>().is_ok());
            if is_run && entry.file_type().map_err(Error::io("read", &entry.path()))?.is_dir() {
                remove_tree(&entry.path())?;
            }
        }
        Ok(())
    }

    /// The moment from which the new ones count.
    fn decide(&self, part: &Path) -> Result<()> {
        for made in [part.join(FOLDER), part.join(ARCHIVE)] {
            part::flush_folder_of(&made).map_err(Error::io("flush the folder of", &made))?;
        }
        rename(part, &self.ready)?;
        part::flush_folder_of(&self.ready).map_err(Error::io("flush the folder of", &self.ready))
    }

    /// Do what is left to do.
    fn finish(&self) -> Result<()> {
        for step in Step::ALL {
            self.perform(step)?;
        }
        part::flush_folder_of(&self.folder).map_err(Error::io("flush the folder of", &self.folder))
    }

    fn perform(&self, step: Step) -> Result<()> {
        let (new_folder, new_archive) = (self.ready.join(FOLDER), self.ready.join(ARCHIVE));
        let (old_folder, old_archive) = (self.old.join(FOLDER), self.old.join(ARCHIVE));
        match step {
            // What is in `.old` already is what a killed run has replaced, or the last of what another removed.
            Step::MakeOld if is_there(&new_folder)? => {
                fs::create_dir_all(&self.old).map_err(Error::io("create the folder", &self.old))
            }
            // The archive goes first and comes last.
            Step::ArchiveOut if is_there(&new_folder)? && is_there(&self.archive)? => {
                rename(&self.archive, &old_archive)
            }
            Step::FolderOut if is_there(&new_folder)? && is_there(&self.folder)? => {
                remove_tree(&old_folder)?;
                rename(&self.folder, &old_folder)
            }
            Step::FolderIn if is_there(&new_folder)? => rename(&new_folder, &self.folder),
            Step::ArchiveIn if is_there(&new_archive)? => rename(&new_archive, &self.archive),
            Step::RemoveReady => remove_tree(&self.ready),
            Step::RemoveOld => remove_tree(&self.old),
            _ => Ok(()),
        }
    }
}

#[cfg(all(test, unix))]
mod tests;
