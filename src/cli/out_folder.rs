//! Folders that outputs go to if none is named: each belongs to the file that its outputs were made from.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::{AtomicFile, Error, FolderLock, Result};

use super::Terminal;

/// A folder for outputs, and the file that they are made from.
pub(crate) struct OutFolder {
    pub path: PathBuf,
    source: String,
    /// Whether the folder was left out and has its name from the input, which another input may have too.
    is_default: bool,
}

impl OutFolder {
    /// The folder `asked` for, else `default`, for outputs that are made from the file `source` (`-` for standard input).
    ///
    /// # Errors
    /// If `default` holds outputs of another file that is still there and has other contents.
    pub(crate) fn of(asked: Option<&Path>, default: PathBuf, source: &Path) -> Result<Self> {
        let (path, is_default) = asked.map_or((default, true), |asked| (asked.to_owned(), false));
        let folder = Self {
            path,
            source: source
                .canonicalize()
                .unwrap_or_else(|_| source.to_owned())
                .to_string_lossy()
                .into_owned(),
            is_default,
        };
        match fs::read_to_string(folder.record()) {
            Ok(other) if folder.is_default && folder.path.exists() && folder.is_of_another(other.trim_end()) => {
                Err(Error::refused(
                    "option/folder-of-another-input",
                    format!(
                        "{} holds what was made from {}, and {} would replace it: both have the same name",
                        folder.path.display(),
                        other.trim_end(),
                        folder.source
                    ),
                    "name another folder with --out, or give one of them another name",
                ))
            }
            _ => Ok(folder),
        }
    }

    /// Wait for the turn to write into the folder, and note the file that it is made from. The `inputs` are not replaced.
    ///
    /// # Errors
    /// As [`Terminal::turn_at`] and [`OutFolder::note`].
    pub(crate) fn turn<'p>(
        &self,
        inputs: impl IntoIterator<Item = &'p Path>,
        terminal: &Terminal,
    ) -> Result<FolderLock> {
        let turn = terminal.turn_at(&self.path, inputs)?;
        self.note()?;
        Ok(turn)
    }

    /// Note beside the folder the file that it is made from: for folders with default names, and for those that have a note.
    ///
    /// # Errors
    /// If the note cannot be written.
    pub(crate) fn note(&self) -> Result<()> {
        let record = self.record();
        if self.is_default || record.exists() {
            AtomicFile::write(&record, format!("{}\n", self.source).as_bytes())?;
        }
        Ok(())
    }

    /// The note is beside the folder: a hand-off has a list of its files, and no others.
    fn record(&self) -> PathBuf {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        self.path.with_file_name(format!(".{name}.source"))
    }

    fn is_of_another(&self, other: &str) -> bool {
        if other == self.source {
            return false;
        }
        // A file that was moved or copied is the same input.
        match (fs::read(other), fs::read(&self.source)) {
            (Ok(there), Ok(own)) => there != own,
            (Err(_), _) => other == "-" || Path::new(other).exists(),
            (Ok(_), Err(_)) => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_another_file_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = place.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let (first, second) = (file("a.toml", "1"), file("b.toml", "2"));
        let folder = place.path().join("out/lens");
        let of = |source: &Path| OutFolder::of(None, folder.clone(), source);
        let made = |source: &Path| {
            let found = of(source).unwrap();
            fs::create_dir_all(&found.path).unwrap();
            found.note().unwrap();
        };
        made(&first);
        // The same file, edited.
        fs::write(&first, "3").unwrap();
        made(&first);
        let refusal = of(&second).err().unwrap();
        assert_eq!(refusal.id(), "option/folder-of-another-input");
        let words = refusal.to_string();
        assert!(words.contains("a.toml") && words.contains("b.toml"), "{words}");
        assert!(of(Path::new("-")).is_err());
        // A copy, a folder that is named, a folder that was removed, a file that was moved.
        assert!(of(&file("copy.toml", "3")).is_ok());
        let named = OutFolder::of(Some(&folder), PathBuf::from("other"), &second).unwrap();
        named.note().unwrap();
        assert!(of(&first).is_err() && of(&second).is_ok());
        fs::rename(&second, place.path().join("c.toml")).unwrap();
        assert!(of(&first).is_ok());
        made(Path::new("-"));
        assert!(of(&first).is_err());
        fs::remove_dir(&folder).unwrap();
        assert!(of(&first).is_ok());
    }
}
