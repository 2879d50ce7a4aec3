//! Images that are given as files, or as a folder of them.

use std::path::PathBuf;

use metalith::Result;
use metalith::picture::scene::images_in;

/// Several files, and the images of folders, in the order in which they are given.
///
/// # Errors
/// As [`images_in`].
pub fn of_all(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in given {
        match path.is_dir() {
            true => all.extend(images_in(path)?),
            false => all.push(path.clone()),
        }
    }
    Ok(all)
}
