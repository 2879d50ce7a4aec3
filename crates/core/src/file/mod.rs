//! Files that appear whole or not at all.

mod digest;
mod direct_io;
mod file_set;
mod folder;
mod folder_lock;
mod inputs;
mod part;
mod set_manifest;

use std::ffi::OsStr;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

pub use digest::file_digest;
pub use direct_io::{Ahead, Block};
pub use file_set::{check_unaltered, settled};
pub use folder::AtomicFolder;
pub use folder_lock::FolderLock;
pub use inputs::InputFiles;

use crate::error::{Error, Result};

/// The bytes of an ordinary file of at most `most` bytes; `what` says what it should be.
///
/// # Errors
/// If it cannot be read, is a device or a pipe, or is longer.
pub fn read_at_most(path: &Path, most: u64, what: &str) -> Result<Vec<u8>> {
    let found = fs::metadata(path).map_err(Error::io("read", path))?;
    let refused = |id, why: String| {
        let hint = format!("{what} of up to {most} bytes is read; is this the right file?");
        Err(Error::refused(id, format!("{} {why}", path.display()), hint))
    };
    if !found.is_file() {
        let kind = if found.is_dir() {
            "a folder"
        } else {
            "not an ordinary file"
        };
        return refused("file/not-regular", format!("is {kind}"));
    }
    if found.len() > most {
        return refused("file/too-large", format!("is {} bytes long", found.len()));
    }
    let mut bytes = Vec::with_capacity(found.len() as usize);
    let file = fs::File::open(path).map_err(Error::io("read", path))?;
    // The file may grow while it is read.
    file.take(most + 1)
        .read_to_end(&mut bytes)
        .map_err(Error::io("read", path))?;
    if bytes.len() as u64 > most {
        return refused("file/too-large", "grows while it is read".into());
    }
    Ok(bytes)
}

/// A file written beside its place and renamed into it when complete.
///
/// Until [`AtomicFile::commit`] the old file, if any, is untouched; dropped or killed before, nothing
/// replaces it. The unfinished file has a fixed name (`.name.part`), so that the next run overwrites
/// what a killed one left. It is locked, so that two runs do not write into one another, and it is written only
/// if it is an ordinary file with no other name: links and pipes that lie there are refused. Where there are no locks, the name
/// holds host and process, and the run that ends well is the one whose file is there.
pub struct AtomicFile {
    target: PathBuf,
    part: PathBuf,
    is_locked: bool,
    out: Option<direct_io::Output>,
}

impl AtomicFile {
    /// Remove the file that an earlier run left at `target`, if there is one.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn discard(target: &Path) -> Result<()> {
        match fs::remove_file(target) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Error::io("remove", target)(error)),
            _ => Ok(()),
        }
    }

    /// Remove what a killed run left unfinished of the file at `target`; what a living one writes stays.
    pub fn clear(target: &Path) {
        let left = target.file_name().map(|name| part_of(target, name));
        if left.is_some_and(|part| fs::symlink_metadata(part).is_ok()) {
            // Dropped before it is complete, it goes.
            let _ = Self::create(target);
        }
    }

    /// Begin to write the file that is to stand at `target`, creating its folder if need be.
    ///
    /// # Errors
    /// If the folder or file cannot be created, a folder stands at `target`, or another process is writing the same file.
    pub fn create(target: &Path) -> Result<Self> {
        let folder = target.parent().filter(|p| !p.as_os_str().is_empty());
        if let Some(folder) = folder {
            fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
        }
        let name = target.file_name().ok_or_else(|| {
            Error::refused(
                "file/no-file-name",
                format!("{} is not the name of a file", target.display()),
                "name a file, not a folder",
            )
        })?;
        // Found only when the file is put in its place otherwise, after all the work.
        if target.is_dir() {
            return Err(Error::refused(
                "file/is-a-folder",
                format!("{} is a folder", target.display()),
                "name a file in it, or another file",
            ));
        }
        let part = part_of(target, name);
        let locked = part::open(&part, target)?;
        let is_locked = locked.is_some();
        let (part, file) = match locked {
            Some(file) => (part, file),
            None => part::new_of_run(&part.with_extension(""), ".part", part::create_new)?,
        };
        Ok(Self {
            target: target.to_owned(),
            is_locked,
            out: Some(direct_io::Output::new(file, &part)),
            part,
        })
    }

    /// Write the whole of `bytes` to the file at `target`.
    ///
    /// # Errors
    /// As [`AtomicFile::create`] and [`AtomicFile::commit`].
    pub fn write(target: &Path, bytes: &[u8]) -> Result<()> {
        let mut file = Self::create(target)?;
        file.write_all(bytes).map_err(Error::io("write", target))?;
        file.commit()
    }

    /// Flush to the disk and put the file in its place. Returns only when it is there.
    ///
    /// # Errors
    /// If the disk is full or refuses; the old file is then as it was.
    pub fn commit(mut self) -> Result<()> {
        let out = self.out.as_mut().expect("a file is committed once");
        let file = out.finish().map_err(Error::io("write", &self.target))?;
        file.sync_all().map_err(Error::io("write", &self.target))?;
        part::check_at(file, &self.part)?;
        fs::rename(&self.part, &self.target).map_err(Error::io("rename to", &self.target))?;
        if !self.is_locked {
            part::check_at(file, &self.target)?;
        }
        // What is at the path of the unfinished file from now on belongs to another run.
        self.out = None;
        part::flush_folder_of(&self.target).map_err(Error::io("flush the folder of", &self.target))
    }
}

/// Path of the unfinished file.
fn part_of(target: &Path, name: &OsStr) -> PathBuf {
    target.with_file_name(format!(".{}.part", name.to_string_lossy()))
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.as_mut().expect("written before commit").write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.as_mut().expect("flushed before commit").flush()
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        // Not finished: what is left of an abandoned file is of no use.
        if let Some(out) = &self.out {
            part::remove_own(out.file(), &self.part);
        }
    }
}

#[cfg(all(test, unix))]
mod tests;
