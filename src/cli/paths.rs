//! Names of files; what is read and what is written are different ones.

use std::path::{Path, PathBuf};

use metalith::{Error, Result};

/// Refuse to write over an input, or two outputs into one file: asked before any work.
///
/// # Errors
/// With the name of the first such file.
pub(crate) fn apart<'p>(inputs: impl IntoIterator<Item = &'p Path>, outputs: &[&Path]) -> Result<()> {
    let inputs: Vec<(&Path, Identity)> = inputs.into_iter().map(|path| (path, Identity::of(path))).collect();
    for (k, output) in outputs.iter().enumerate() {
        let own = Identity::of(output);
        let what = if inputs.iter().any(|(_, input)| own.is(input)) {
            "is an input, and would be overwritten"
        } else if outputs[..k].iter().any(|other| own.is(&Identity::of(other))) {
            "would be written twice"
        } else {
            continue;
        };
        return Err(same_file(output, what));
    }
    Ok(())
}

/// Refuse outputs in a folder whose files are all inputs, or inputs in a folder that is replaced as a whole: asked before any
/// work.
///
/// # Errors
/// With the name of the first such file.
pub(crate) fn outside(folder: &Path, files: &[&Path]) -> Result<()> {
    let Ok(folder) = folder.canonicalize() else {
        return Ok(());
    };
    match files.iter().find(|file| Identity::of(file).path.starts_with(&folder)) {
        None => Ok(()),
        Some(file) => Err(same_file(
            file,
            &format!("is in {}, where an input would be overwritten", folder.display()),
        )),
    }
}

fn same_file(output: &Path, what: &str) -> Error {
    Error::refused(
        "option/same-file",
        format!("{} {what}", output.display()),
        "name another file or folder to write to",
    )
}

/// The name of a file without its folders.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(feature = "training")]
/// Find out whether files can be written, before the work that they are for. What stands there stays, and folders are made.
///
/// # Errors
/// As [`metalith::AtomicFile::create`].
pub(crate) fn writable(outputs: &[&Path]) -> Result<()> {
    outputs
        .iter()
        .try_for_each(|output| metalith::AtomicFile::create(output).map(drop))
}

/// Identity of a file, whatever its path says.
struct Identity {
    path: PathBuf,
    #[cfg(unix)]
    inode: Option<(u64, u64)>,
}

impl Identity {
    fn of(path: &Path) -> Self {
        // A file that is not there yet has the path of its folder.
        let parent = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let beside = || Some(parent.canonicalize().ok()?.join(path.file_name()?));
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

    fn is(&self, other: &Self) -> bool {
        #[cfg(unix)]
        if self.inode.is_some() && self.inode == other.inode {
            return true;
        }
        self.path == other.path
    }
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
        for output in ["shards/0", "shards/../shards/0", "link", "other"] {
            let refused = apart([at("shards/0").as_path()], &[&at(output)]).unwrap_err();
            assert_eq!(refused.id(), "option/same-file", "{output}");
        }
        for output in ["shards/0", "shards/new", "link"] {
            assert!(outside(&at("shards"), &[&at(output)]).is_err(), "{output}");
        }
        assert!(apart([at("shards/0").as_path()], &[&at("shards/1"), &at("new")]).is_ok());
        assert!(outside(&at("shards"), &[&at("shards.csv")]).is_ok());
        assert!(outside(&at("none"), &[&at("none/new")]).is_ok());
    }
}
