//! Images that are given as files, or as a folder of them.

use std::path::{Path, PathBuf};

use metalith::{Error, Result};

/// PNG, JPEG and NPY images of a folder, by name.
///
/// # Errors
/// If it cannot be read, or holds none.
pub fn of_folder(folder: &Path) -> Result<Vec<PathBuf>> {
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

/// The same of several files and folders, in the order in which they are given.
///
/// # Errors
/// As [`of_folder`].
pub fn of_all(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in given {
        match path.is_dir() {
            true => all.extend(of_folder(path)?),
            false => all.push(path.clone()),
        }
    }
    Ok(all)
}
