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

/// Refuse to write into a folder whose files are inputs, however many they are: asked before any work.
///
/// # Errors
/// With the name of the first such output.
pub(crate) fn outside(folder: &Path, outputs: &[&Path]) -> Result<()> {
    let Ok(folder) = folder.canonicalize() else {
        return Ok(());
    };
    match outputs
        .iter()
        .find(|output| Identity::of(output).path.starts_with(&folder))
    {
        None => Ok(()),
        Some(output) => Err(same_file(output, "is in a folder of inputs, and could overwrite one")),
    }
}

fn same_file(output: &Path, what: &str) -> Error {
    Error::refused(
        "option/same-file",
        format!("{} {what}", output.display()),
        "name another file to write to",
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
