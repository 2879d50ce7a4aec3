//! The files of the folder that is being written, each with its purpose.

use std::path::{Path, PathBuf};

use metalith_core::{AtomicFile, Result};

/// The folder, and every file that is in it.
pub(super) struct Listing {
    folder: PathBuf,
    /// Path in the folder, with `/` between its parts, and purpose.
    pub files: Vec<(String, String)>,
}

impl Listing {
    pub(crate) fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            files: Vec::new(),
        }
    }

    /// Path of something in the folder.
    pub(crate) fn at(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// List a file; where it is to be written.
    pub(crate) fn add(&mut self, name: impl Into<String>, purpose: impl Into<String>) -> PathBuf {
        let name = name.into();
        let path = self.folder.join(&name);
        self.files.push((name, purpose.into()));
        path
    }

    /// List a file and write it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write(&mut self, name: impl Into<String>, purpose: impl Into<String>, bytes: &[u8]) -> Result<()> {
        AtomicFile::write(&self.add(name, purpose), bytes)
    }
}
