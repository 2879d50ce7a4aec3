//! Names of files.

use std::path::{Path, PathBuf};

use metalith::Design;

/// Paths of all inputs: those of a design, and those that arguments name.
pub(crate) fn inputs_of<'p>(design: &Design, named: impl IntoIterator<Item = &'p Path>) -> Vec<PathBuf> {
    let mut all = design.inputs();
    all.extend(named.into_iter().map(Path::to_owned));
    all
}

/// Borrowed form of a list of paths.
pub(crate) fn paths(list: &[PathBuf]) -> impl Iterator<Item = &Path> {
    list.iter().map(PathBuf::as_path)
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
pub(crate) fn writable(outputs: &[&Path]) -> metalith::Result<()> {
    outputs
        .iter()
        .try_for_each(|output| metalith::AtomicFile::create(output).map(drop))
}
