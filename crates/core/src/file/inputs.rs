//! Files that are read, which no output may replace.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::part::folder_of;
use crate::error::{Error, Result};

/// Identity of a file, whatever its path says.
struct Identity {
    path: PathBuf,
    /// Device and number.
    #[cfg(unix)]
    inode: Option<(u64, u64)>,
}

impl Identity {
    fn of(path: &Path) -> Self {
        // A file that is not there yet has the path of its folder.
        let beside = || Some(folder_of(path).canonicalize().ok()?.join(path.file_name()?));
        Self {
            path: path
                .canonicalize()
                .ok()
                .or_else(beside)
                .unwrap_or_else(|| path.to_owned()),
            #[cfg(unix)]
            inode: std::fs::metadata(path).ok().map(|found| {
                use std::os::unix::fs::MetadataExt;
                (found.dev(), found.ino())
            }),
        }
    }
}

/// Files that a run reads, known by any of their names.
#[derive(Clone, Debug, Default)]
pub struct InputFiles {
    paths: HashSet<PathBuf>,
    #[cfg(unix)]
    inodes: HashSet<(u64, u64)>,
}

impl InputFiles {
    /// Files at these paths, which need not be there.
    pub fn of<'p>(paths: impl IntoIterator<Item = &'p Path>) -> Self {
        let mut files = Self::default();
        paths.into_iter().for_each(|path| files.add(path));
        files
    }

    /// Add the file at a path.
    pub fn add(&mut self, path: &Path) {
        let own = Identity::of(path);
        #[cfg(unix)]
        self.inodes.extend(own.inode);
        self.paths.insert(own.path);
    }

    /// True for the path of one of the files.
    pub fn contains(&self, path: &Path) -> bool {
        let own = Identity::of(path);
        #[cfg(unix)]
        if own.inode.is_some_and(|inode| self.inodes.contains(&inode)) {
            return true;
        }
        self.paths.contains(&own.path)
    }

    /// Refuse to write to a path of one of the files, or to remove what lies there.
    ///
    /// # Errors
    /// With the path, if it is one of the files.
    pub fn check_output(&self, path: &Path) -> Result<()> {
        if self.contains(path) {
            Err(same_file(path, "is an input, and would be overwritten"))
        } else {
            Ok(())
        }
    }

    /// Refuse to replace one of the files, or to write two outputs into one file: asked before any work.
    ///
    /// # Errors
    /// With the path of the first such output.
    pub fn check_outputs(&self, outputs: &[&Path]) -> Result<()> {
        let mut written = Self::default();
        for output in outputs {
            self.check_output(output)?;
            if written.contains(output) {
                return Err(same_file(output, "would be written twice"));
            }
            written.add(output);
        }
        Ok(())
    }

    /// Refuse to replace a folder as a whole that has one of the files in it: asked before any work.
    ///
    /// # Errors
    /// With the path of the first such file.
    pub fn check_outside(&self, folder: &Path) -> Result<()> {
        let Ok(folder) = folder.canonicalize() else {
            return Ok(());
        };
        match self.paths.iter().filter(|file| file.starts_with(&folder)).min() {
            None => Ok(()),
            Some(file) => Err(same_file(
                file,
                &format!("is in {}, where an input would be overwritten", folder.display()),
            )),
        }
    }
}

fn same_file(output: &Path, what: &str) -> Error {
    Error::refused(
        "option/same-file",
        format!("{} {what}", output.display()),
        "name another file or folder to write to",
    )
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn an_input_is_known_by_any_of_its_names() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir(at("shards")).unwrap();
        fs::write(at("shards/0"), "draws").unwrap();
        std::os::unix::fs::symlink(at("shards/0"), at("link")).unwrap();
        fs::hard_link(at("shards/0"), at("other")).unwrap();
        let inputs = InputFiles::of([at("shards/0").as_path()]);
        for output in ["shards/0", "shards/../shards/0", "link", "other"] {
            let refused = inputs.check_outputs(&[&at(output)]).unwrap_err();
            assert_eq!(refused.id(), "option/same-file", "{output}");
        }
        assert!(inputs.check_outputs(&[&at("shards/1"), &at("new")]).is_ok());
        assert!(inputs.check_outputs(&[&at("new"), &at("shards/../new")]).is_err());
        for output in ["shards/0", "shards/new", "link"] {
            let outputs = InputFiles::of([at(output).as_path()]);
            assert!(outputs.check_outside(&at("shards")).is_err(), "{output}");
        }
        assert!(
            InputFiles::of([at("shards.csv").as_path()])
                .check_outside(&at("shards"))
                .is_ok()
        );
        assert!(
            InputFiles::of([at("none/new").as_path()])
                .check_outside(&at("none"))
                .is_ok()
        );
    }
}
