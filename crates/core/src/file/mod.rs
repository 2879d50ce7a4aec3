//! Files that appear whole or not at all.

mod past_cache;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

pub use past_cache::{Ahead, Block};

use crate::error::{Error, Result};

/// A file written beside its place and renamed into it when complete.
///
/// Until [`WholeFile::commit`] the old file, if any, is untouched; dropped or killed before, nothing
/// replaces it. The unfinished file has a fixed name (`.name.part`), so that the next run overwrites
/// what a killed one left, and it is locked, so that two runs do not write into one another.
pub struct WholeFile {
    target: PathBuf,
    part: PathBuf,
    out: Option<past_cache::Output>,
}

impl WholeFile {
    /// Begin to write the file that is to stand at `target`, creating its folder if need be.
    ///
    /// # Errors
    /// If the folder or file cannot be created, or another process is writing the same file.
    pub fn create(target: &Path) -> Result<Self> {
        let folder = target.parent().filter(|p| !p.as_os_str().is_empty());
        if let Some(folder) = folder {
            fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
        }
        let name = target.file_name().ok_or_else(|| {
            Error::invalid(
                format!("{} is not the name of a file", target.display()),
                "name a file, not a folder",
            )
        })?;
        let part = target.with_file_name(format!(".{}.part", name.to_string_lossy()));
        let file = File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&part)
            .map_err(Error::io("create", &part))?;
        if let Err(fs::TryLockError::WouldBlock) = file.try_lock() {
            return Err(Error::invalid(
                format!("another process is writing {}", target.display()),
                "wait for it, or write elsewhere with --out",
            ));
        }
        file.set_len(0).map_err(Error::io("empty", &part))?;
        Ok(Self {
            target: target.to_owned(),
            out: Some(past_cache::Output::new(file, &part)),
            part,
        })
    }

    /// Write the whole of `bytes` to the file at `target`.
    ///
    /// # Errors
    /// As [`WholeFile::create`] and [`WholeFile::commit`].
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
        let out = self.out.take().expect("a file is committed once");
        let placed = self.place(out);
        if placed.is_err() {
            let _ = fs::remove_file(&self.part);
        }
        placed
    }

    fn place(&self, out: past_cache::Output) -> Result<()> {
        let file = out.finish().map_err(Error::io("write", &self.target))?;
        file.sync_all().map_err(Error::io("write", &self.target))?;
        fs::rename(&self.part, &self.target).map_err(Error::io("rename to", &self.target))
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.as_mut().expect("written before commit").write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.as_mut().expect("flushed before commit").flush()
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if let Some(out) = self.out.take() {
            // Not finished: what is left of an abandoned file is of no use.
            drop(out);
            let _ = fs::remove_file(&self.part);
        }
    }
}
