//! Files that are read and written: images of a folder, and that no input is written over.

use std::path::{Path, PathBuf};

use metalith::{Error, Result};

/// Refuse to write over an input, or two outputs into one file: asked before any work.
///
/// # Errors
/// With the name of the first such file.
pub fn apart<'p>(inputs: impl IntoIterator<Item = &'p Path>, outputs: &[&Path]) -> Result<()> {
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
        return Err(Error::invalid(
            format!("{} {what}", output.display()),
            "name another file to write to",
        ));
    }
    Ok(())
}

/// Images of a folder by name.
///
/// # Errors
/// If the folder cannot be read or holds none.
pub fn images(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(Error::io("read", folder))?;
    let known = |path: &PathBuf| {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        extension.is_some_and(|e| ["png", "jpg", "jpeg", "npy"].contains(&e.as_str()))
    };
    let mut images: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).filter(known).collect();
    images.sort();
    if images.is_empty() {
        return Err(Error::invalid(
            format!("{} holds no image", folder.display()),
            "give a folder of PNG, JPEG or NPY files",
        ));
    }
    Ok(images)
}

/// What tells a file from others, whatever its path says.
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
